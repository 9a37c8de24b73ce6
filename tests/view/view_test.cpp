// Pages hold what they are made of, whole and the same each time; what cannot be shown is refused; the server gives out
// nothing but the tiles, and to this machine alone.
#include "lamina/view.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>
#include <zlib.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "lamina/error.h"
#include "lamina/mesh.h"
#include "lamina/points.h"
#include "render/shapes.h"
#include "support/program.h"
#include "tools/tool_files.h"
#include "view/tile_files.h"

namespace lamina {
namespace {

using namespace test;
using nlohmann::json;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

void write_file(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

std::string from_base64(const std::string& text) {
  std::string bytes;
  std::uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const std::size_t digit = digits.find(c);
    if (digit == std::string::npos) continue;
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    if ((count = (count + 6) % 8) < 6) bytes += static_cast<char>(bits >> count & 255);
  }
  return bytes;
}

std::string unpacked(const std::string& packed) {
  z_stream inflater{};
  EXPECT_EQ(inflateInit2(&inflater, MAX_WBITS + 16), Z_OK);
  inflater.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  inflater.avail_in = static_cast<uInt>(packed.size());
  std::string bytes;
  int result = Z_OK;
  while (result == Z_OK) {
    std::string piece(1 << 16, '\0');
    inflater.next_out = reinterpret_cast<Bytef*>(piece.data());
    inflater.avail_out = static_cast<uInt>(piece.size());
    result = inflate(&inflater, Z_NO_FLUSH);
    bytes += piece.substr(0, piece.size() - inflater.avail_out);
  }
  EXPECT_EQ(result, Z_STREAM_END);
  inflateEnd(&inflater);
  return bytes;
}

/// What lies between two texts, the first time behind `from`; nothing where they are not there.
std::optional<std::string> between(const std::string& text, const std::string& begin, const std::string& end) {
  const std::size_t from = text.find(begin);
  if (from == std::string::npos) return std::nullopt;
  const std::size_t to = text.find(end, from + begin.size());
  return text.substr(from + begin.size(), to - from - begin.size());
}

std::string block_of(const std::string& page, const std::string& name) {
  const std::string begin = "<script type=\"text/plain\" data-block=\"" + name + "\">";
  std::string text;
  for (std::size_t at = page.find(begin); at != std::string::npos; at = page.find(begin, at + 1))
    text += page.substr(at + begin.size(), page.find("</script>", at) - at - begin.size());
  return unpacked(from_base64(text));
}

json description_of(const std::string& page) {
  return json::parse(between(page, "id=\"lamina\">", "</script>").value_or("{}"));
}

/// A request as a stranger might send it, byte for byte, and the whole answer.
std::string answer_of(int port, const std::string& request) {
  const int connection = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(connect(connection, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  EXPECT_EQ(send(connection, request.data(), request.size(), 0), static_cast<ssize_t>(request.size()));
  std::string answer;
  std::array<char, 4096> piece{};
  for (ssize_t n = 0; (n = recv(connection, piece.data(), piece.size(), 0)) > 0;)
    answer.append(piece.data(), static_cast<std::size_t>(n));
  close(connection);
  return answer;
}

std::string get(const std::string& path, const std::string& host = "127.0.0.1") {
  return fmt::format("GET {} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", path, host);
}

class View : public ::testing::Test {
 protected:
  View() {
    settings_.bundle = folder_ / "viewer.js";
    settings_.title = "a <model> & more.ply";
    write_file(settings_.bundle, "/* the viewer's code */");
    std::filesystem::create_directories(folder_ / "tiles/1");
    write_file(folder_ / "tiles/tileset.json", R"({"asset":{"version":"1.1"},"root":{}})");
    write_file(folder_ / "tiles/1/0.glb", std::string(100000, 'g'));
    write_file(folder_ / "tiles/notes.txt", "not a tile");
    write_file(folder_ / "secret.json", "secret");
    std::filesystem::create_symlink(folder_ / "secret.json", folder_ / "tiles/link.json");
  }
  void expect_refused(ExitCode code, const std::string& text, const std::function<void()>& act) {
    try {
      act();
      ADD_FAILURE() << "not refused: " << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code);
      EXPECT_THAT(error.what(), HasSubstr(text));
    }
    EXPECT_FALSE(std::filesystem::exists(page_));
  }

  TemporaryFolder folder_;
  ViewSettings settings_;
  std::string page_ = folder_ / "page.html";
};

TEST_F(View, PageHoldsTheMesh) {
  TriangleMesh mesh = sphere(1, 12);
  mesh.triangles.pop_back();  // a hole of three edges
  mesh.layout = {{"Curvature", ScalarType::float32}};
  mesh.attributes = {std::vector<float>(mesh.positions.size(), 0.5F)};
  const ViewStats stats = write_mesh_page(mesh, settings_, page_);
  EXPECT_EQ(stats.triangles, mesh.triangles.size());
  EXPECT_EQ(stats.boundary_edges, 3U);
  EXPECT_EQ(stats.boundary_loops, 1U);
  const std::string page = read_text(page_);
  write_mesh(mesh, folder_ / "mesh.glb");
  EXPECT_TRUE(block_of(page, "model") == read_text(folder_ / "mesh.glb")) << "the GLB is another one";
  EXPECT_EQ(block_of(page, "boundary").size(), 24U);
  const json description = description_of(page);
  EXPECT_EQ(description["kind"], "mesh");
  EXPECT_EQ(description["title"], settings_.title);
  EXPECT_EQ(description["triangles"], mesh.triangles.size());
  EXPECT_EQ(description["boundaryLoops"], 1);
  EXPECT_EQ(description["attributes"], json({"Curvature"}));
  EXPECT_EQ(description["up"], "y");
  EXPECT_THAT(page, HasSubstr("<title>a &lt;model&gt; &amp; more.ply</title>"));
  EXPECT_THAT(page, Not(HasSubstr("<model>")));
  EXPECT_THAT(page, HasSubstr("/* the viewer's code */"));
  EXPECT_THAT(page, EndsWith("</html>\n"));
  EXPECT_THAT(page, Not(HasSubstr("http")));
  write_mesh_page(mesh, settings_, folder_ / "again.html");
  EXPECT_TRUE(page == read_text(folder_ / "again.html")) << "not the same bytes";
}

TEST_F(View, LargeBlocksAreCut) {
  TriangleMesh mesh = sphere(1, 12);
  std::uint32_t state = 1;
  mesh.layout = {{"noise", ScalarType::float32}};
  mesh.attributes.resize(1);
  const auto random = [&state] { return static_cast<float>(state = state * 1664525 + 1013904223); };
  while (mesh.positions.size() < 900'000) mesh.positions.push_back({random(), random(), random()});
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) mesh.attributes[0].push_back(random());
  write_mesh_page(mesh, settings_, page_);
  const std::string page = read_text(page_);
  EXPECT_NE(page.find("data-block=\"model\""), page.rfind("data-block=\"model\""));
  write_mesh(mesh, folder_ / "mesh.glb");
  EXPECT_TRUE(block_of(page, "model") == read_text(folder_ / "mesh.glb"));
}

TEST_F(View, PointsAreThinnedEvenly) {
  SampleBatch rows = sphere_rows(5000, 3, 500000);
  PointColumns columns = sphere_columns();
  columns.attributes[3] = {"row", ScalarType::float32};
  for (std::size_t i = 0; i < rows.size(); ++i) rows.attributes[3][i] = static_cast<float>(i);
  rows.exact.clear();
  write_points(folder_ / "cloud.ply", rows, columns);
  settings_.points = 1000;
  const ViewStats stats = write_points_page(*open_points(folder_ / "cloud.ply"), settings_, page_);
  EXPECT_EQ(stats.points, 1000U);
  EXPECT_EQ(stats.points_there, 5000U);
  const std::string page = read_text(page_);
  EXPECT_EQ(description_of(page)["pointsThere"], 5000);
  EXPECT_EQ(description_of(page)["up"], "z") << "coordinates of a survey";
  write_file(folder_ / "model.glb", block_of(page, "model"));
  const std::string glb = read_text(folder_ / "model.glb");
  std::uint32_t length = 0;
  std::memcpy(&length, glb.data() + 12, 4);
  const json gltf = json::parse(glb.substr(20, length));
  EXPECT_EQ(gltf["meshes"][0]["primitives"][0]["mode"], 0);
  EXPECT_EQ(gltf["nodes"][0]["translation"], json({500000, 500000, 500000}));
  EXPECT_EQ(description_of(page)["attributes"], json({"red", "green", "blue", "row", "confidence"}));
  // One of each five.
  std::set<int> fives;
  for (const json& accessor : gltf["accessors"]) {
    if (accessor.value("name", "") != "row") continue;
    const json& view = gltf["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    for (std::size_t i = 0; i < stats.points; ++i) {
      float row = 0;
      std::memcpy(&row, glb.data() + 28 + length + view["byteOffset"].get<std::size_t>() + 4 * i, 4);
      fives.insert(static_cast<int>(row) / 5);
    }
  }
  EXPECT_EQ(fives.size(), stats.points);
}

TEST_F(View, TilesAreInThePage) {
  const ViewStats stats = write_tiles_page(folder_ / "tiles", settings_, page_);
  EXPECT_EQ(stats.tiles, 2U) << "the link and the text are none";
  const std::string page = read_text(page_);
  EXPECT_EQ(block_of(page, "file:1/0.glb"), std::string(100000, 'g'));
  EXPECT_EQ(block_of(page, "file:tileset.json"), R"({"asset":{"version":"1.1"},"root":{}})");
  EXPECT_EQ(description_of(page)["embedded"], true);
  EXPECT_LT(page.size(), 10000U) << "is packed";
}

TEST_F(View, RefusesWhatItCannotShow) {
  const TriangleMesh mesh = sphere(1, 12);
  expect_refused(ExitCode::empty, "without triangles", [&] { write_mesh_page({}, settings_, page_); });
  settings_.most_bytes = 1000;
  expect_refused(ExitCode::budget, "lamina tiles", [&] { write_mesh_page(mesh, settings_, page_); });
  expect_refused(ExitCode::budget, "--serve", [&] { write_tiles_page(folder_ / "tiles", settings_, page_); });
  write_points(folder_ / "cloud.ply", sphere_rows(1000), sphere_columns());
  expect_refused(ExitCode::budget, "--points 25 shows",
                 [&] { write_points_page(*open_points(folder_ / "cloud.ply"), settings_, page_); });
  settings_.most_bytes = 1000000;
  expect_refused(ExitCode::unreadable, "without a tileset.json",
                 [&] { write_tiles_page(folder_ / "tiles/1", settings_, page_); });
  for (const char* text : {"{\"asset\": {", "[]", R"({"asset":{"version":"1.1"}})", ""}) {
    write_file(folder_ / "tiles/tileset.json", text);
    expect_refused(ExitCode::unreadable, "tileset.json: is no",
                   [&] { write_tiles_page(folder_ / "tiles", settings_, page_); });
  }
  expect_refused(ExitCode::budget, "nowhere", [&] { write_mesh_page(mesh, settings_, folder_ / "nowhere/page.html"); });
  settings_.bundle = folder_ / "none.js";
  expect_refused(ExitCode::unreadable, "none.js", [&] { write_mesh_page(mesh, settings_, page_); });
}

TEST_F(View, NothingOutsideOfTheFolderIsServed) {
  const std::string tiles = folder_ / "tiles";
  EXPECT_TRUE(view::served_file(tiles, "tileset.json"));
  EXPECT_TRUE(view::served_file(tiles, "1/0.glb"));
  EXPECT_TRUE(view::served_file(tiles, "1/../tileset.json"));
  for (const char* name : {"../secret.json", "1/../../secret.json", "link.json", "/etc/passwd", "//etc/passwd", "1", "",
                           ".", "none.glb", "..", "1/../.."})
    EXPECT_FALSE(view::served_file(tiles, name)) << name;
  EXPECT_FALSE(view::served_file(tiles, std::string_view("tileset.json\0.glb", 17)));
}

TEST_F(View, ServesThisMachineAlone) {
  std::atomic<bool> cancel = false;
  RunContext run;
  run.cancel = &cancel;
  std::promise<std::string> address;
  std::future<std::string> listening = address.get_future();
  std::thread server([&] {
    try {
      serve_tiles(
          folder_ / "tiles", settings_, 0, [&](const std::string& text) { address.set_value(text); }, run);
    } catch (const Error& error) {
      address.set_value(error.what());
    }
  });
  const std::string said = listening.get();
  if (said.find("without a server") != std::string::npos) {
    server.join();
    GTEST_SKIP() << said;
  }
  EXPECT_THAT(said, StartsWith("http://127.0.0.1:"));
  const int port = std::stoi(said.substr(said.rfind(':') + 1));
  EXPECT_THAT(answer_of(port, get("/")), HasSubstr("tiles/tileset.json"));
  EXPECT_THAT(answer_of(port, get("/tiles/tileset.json")), HasSubstr("application/json"));
  EXPECT_THAT(answer_of(port, get("/tiles/1/0.glb")), EndsWith(std::string(100000, 'g')));
  for (const char* path : {"/tiles/../secret.json", "/tiles/%2e%2e/secret.json", "/tiles/..%2fsecret.json",
                           "/tiles/link.json", "/tiles//etc/passwd", "/secret.json", "/tiles/"}) {
    const std::string answer = answer_of(port, get(path));
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 404")) << path;
    EXPECT_THAT(answer, Not(HasSubstr("secret"))) << path;
  }
  EXPECT_THAT(answer_of(port, get("/", "evil.example")), StartsWith("HTTP/1.1 403"));
  std::string post = get("/tiles/tileset.json");
  EXPECT_THAT(answer_of(port, post.replace(0, 3, "PUT")), StartsWith("HTTP/1.1 405"));
  const std::string head = answer_of(port, "HEAD" + get("/tiles/1/0.glb").substr(3));
  EXPECT_THAT(head, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(head, HasSubstr("Content-Length: 100000"));
  EXPECT_THAT(head, EndsWith("\r\n\r\n"));
  try {
    serve_tiles(
        folder_ / "tiles", settings_, port, [](const std::string&) {}, run);
    ADD_FAILURE() << "two servers share a port";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("is taken"));
  }
  // 0100007F is 127.0.0.1 as the kernel writes it; 0A: listens.
  EXPECT_THAT(read_text("/proc/net/tcp"), HasSubstr(fmt::format("0100007F:{:04X} 00000000:0000 0A", port)));
  EXPECT_THAT(read_text("/proc/net/tcp"), Not(HasSubstr(fmt::format("00000000:{:04X} ", port))));
  cancel = true;
  server.join();
}

TEST_F(View, ToolSaysWhatItNeeds) {
  const std::string mesh = sphere_mesh(folder_ / "mesh.ply");
  // A program without anything beside it.
  std::filesystem::copy_file(LAMINA_PROGRAM, folder_ / "lamina");
  const Outcome alone =
      run_shell(test::quoted(folder_ / "lamina") + " view " + test::quoted(mesh) + " -o " + test::quoted(page_));
  EXPECT_EQ(alone.code, 2);
  EXPECT_THAT(alone.err, HasSubstr("scripts/setup viewer"));
  EXPECT_FALSE(std::filesystem::exists(page_));
  // And with it.
  std::filesystem::create_directories(folder_ / "share/lamina");
  std::filesystem::copy_file(settings_.bundle, folder_ / "share/lamina/viewer.js");
  const Outcome whole =
      run_shell(test::quoted(folder_ / "lamina") + " view " + test::quoted(mesh) + " -o " + test::quoted(page_));
  EXPECT_EQ(whole.code, 0) << whole.err;
  EXPECT_THAT(whole.err, HasSubstr("triangles"));
  const std::string view = test::quoted(folder_ / "lamina") + " view ";
  EXPECT_EQ(run_shell(view + test::quoted(folder_ / "none.ply") + " -o " + test::quoted(folder_ / "none.html")).code,
            3);
  EXPECT_EQ(run_shell(view + test::quoted(mesh)).code, 2);
  EXPECT_EQ(run_shell(view + test::quoted(mesh) + " --serve 0").code, 2);
  const Outcome thinned =
      run_shell(view + test::quoted(mesh) + " --points 9 -o " + test::quoted(folder_ / "thin.html"));
  EXPECT_EQ(thinned.code, 2);
  EXPECT_THAT(thinned.err, HasSubstr("--points thins out points"));
}

}  // namespace
}  // namespace lamina
