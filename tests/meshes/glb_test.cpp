// GLB: what is written is what glTF 2.0 says, by the Khronos validator where it is installed, and reads back as it was.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "lamina/mesh.h"
#include "meshes/formats.h"
#include "meshes/glb_files.h"
#include "meshes/mesh_files.h"
#include "meshes/mesh_sink.h"

namespace lamina {
namespace {

using namespace testing_meshes;
using nlohmann::json;

TEST(Glb, PlyToGlbToPlyIsExact) {
  const ScratchFolder folder;
  write_mesh(with_everything(), folder.file("a.ply"));
  write_mesh(read_mesh(folder.file("a.ply")), folder.file("b.glb"));
  write_mesh(read_mesh(folder.file("b.glb")), folder.file("c.ply"));
  EXPECT_TRUE(bytes_of(folder.file("a.ply")) == bytes_of(folder.file("c.ply")));
}

TEST(Glb, ColoursOfEveryTypeComeBack) {
  const ScratchFolder folder;
  for (const auto& [type, white] : {std::pair{ScalarType::uint16, 65535.0F}, std::pair{ScalarType::float32, 1.0F}}) {
    TriangleMesh m = sphere(1, 9, 300);
    m.layout = {{"red", type}, {"green", type}, {"blue", type}};
    m.attributes.resize(3);
    for (std::size_t v = 0; v < m.positions.size(); ++v) {
      const auto share = static_cast<float>(v) / static_cast<float>(m.positions.size());
      for (std::size_t k = 0; k < 3; ++k)
        m.attributes[k].push_back(white > 1 ? std::round(white * share) : white * share);
    }
    write_mesh(m, folder.file("m.glb"));
    const TriangleMesh back = read_mesh(folder.file("m.glb"));
    EXPECT_EQ(back.layout, m.layout);
    for (std::size_t v = 0; v < m.positions.size(); ++v)
      ASSERT_NEAR(back.attributes[1][v], m.attributes[1][v], white > 1 ? 0 : 2e-7);
  }
}

TEST(Glb, GeoreferencedPositionsAreFloatsFromAMiddle) {
  const ScratchFolder folder;
  TriangleMesh m = sphere(700, 40, 60);
  for (auto& p : m.positions) p = {p[0] + 500000.123, p[1] + 4179332.456, p[2] + 1234.5};
  write_mesh(m, folder.file("m.glb"));
  const json document = json_of_glb(bytes_of(folder.file("m.glb")));
  EXPECT_EQ(document["nodes"][0]["translation"], json({499968, 4179328, 1280}));
  const TriangleMesh back = read_mesh(folder.file("m.glb"));
  for (std::size_t v = 0; v < m.positions.size(); ++v) {
    for (std::size_t k = 0; k < 3; ++k) ASSERT_NEAR(back.positions[v][k], m.positions[v][k], 1e-4);
  }
  // What came out of a GLB goes through another as it is.
  write_mesh(back, folder.file("again.glb"));
  EXPECT_EQ(read_mesh(folder.file("again.glb")).positions, back.positions);
}

TEST(Glb, IsWhatTheFormatAsksFor) {
  const ScratchFolder folder;
  const TriangleMesh m = with_everything();
  write_mesh(m, folder.file("m.glb"));
  const std::string bytes = bytes_of(folder.file("m.glb"));
  std::uint32_t length = 0;
  std::memcpy(&length, bytes.data() + 8, 4);
  EXPECT_EQ(length, bytes.size());
  const json document = json_of_glb(bytes);
  const json& primitive = document["meshes"][0]["primitives"][0];
  EXPECT_EQ(primitive["mode"], 4);
  for (const char* semantic : {"POSITION", "NORMAL", "COLOR_0", "_INTENSITY", "_CURVATURE", "_ID", "_TIME", "_KIND"})
    EXPECT_TRUE(primitive["attributes"].contains(semantic)) << semantic;
  EXPECT_EQ(primitive["attributes"].size(), 8U);
  EXPECT_FALSE(document["nodes"][0].contains("translation"));
  for (const json& accessor : document["accessors"]) {
    const json& view = document["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    EXPECT_EQ(view["byteOffset"].get<std::size_t>() % 4, 0U);
    EXPECT_EQ(view.value("byteStride", std::size_t{4}) % 4, 0U);
  }
  // Colours are linear: half of 255, as screens take it, is a fifth of the light.
  const json& colour = document["accessors"][primitive["attributes"]["COLOR_0"].get<std::size_t>()];
  const json& view = document["bufferViews"][colour["bufferView"].get<std::size_t>()];
  std::uint32_t text = 0;
  std::memcpy(&text, bytes.data() + 12, 4);
  const char* const data = bytes.data() + 28 + text + view["byteOffset"].get<std::size_t>();
  std::uint16_t red = 0;
  std::memcpy(&red, data + 64 * 8, 2);  // vertex 64 has 128
  EXPECT_EQ(m.attributes[1][64], 128);
  EXPECT_NEAR(red / 65535.0, 0.21586, 1e-4);
}

TEST(Glb, StreamsAsItIsWrittenFromMemory) {
  const ScratchFolder folder;
  const TriangleMesh m = with_everything();
  MeshSink sink({.path = folder.file("s.glb"),
                 .more_paths = {folder.file("s.ply"), folder.file("t.ply")},
                 .attributes = m.layout,
                 .comments = {"shift 1 2 3"}});
  VertexBatch batch;
  for (std::size_t v = 0; v < m.positions.size(); ++v) {
    batch.x.push_back(m.positions[v][0]), batch.y.push_back(m.positions[v][1]), batch.z.push_back(m.positions[v][2]);
    batch.nx.push_back(m.normals[v][0]), batch.ny.push_back(m.normals[v][1]), batch.nz.push_back(m.normals[v][2]);
  }
  batch.attributes = m.attributes;
  sink.append_vertices(batch);
  sink.append_triangles(m.triangles);
  sink.commit();
  EXPECT_EQ(folder.entries(), 3U);
  EXPECT_TRUE(bytes_of(folder.file("s.ply")) == bytes_of(folder.file("t.ply")));
  EXPECT_EQ(json_of_glb(bytes_of(folder.file("s.glb")))["asset"]["extras"]["comments"][1], "shift 1 2 3");
  const TriangleMesh ply = read_mesh(folder.file("s.ply")), glb = read_mesh(folder.file("s.glb"));
  EXPECT_EQ(ply.positions, glb.positions);
  EXPECT_EQ(ply.normals, glb.normals);
  EXPECT_EQ(ply.layout, glb.layout);
  EXPECT_EQ(ply.attributes, glb.attributes);
  EXPECT_EQ(ply.triangles, glb.triangles);
}

TEST(Glb, OneOutputThatFailsLeavesTheOthers) {
  const ScratchFolder folder;
  const std::string gone = folder.file("folder");
  std::filesystem::create_directory(gone);
  MeshSink sink({.path = gone + "/m.glb", .more_paths = {folder.file("m.ply")}});
  sink.append_vertices({.x = {0, 1, 0},
                        .y = {0, 0, 1},
                        .z = {0, 0, 0},
                        .nx = {0, 0, 0},
                        .ny = {0, 0, 0},
                        .nz = {1, 1, 1},
                        .attributes = {},
                        .radius = {},
                        .density = {},
                        .overhang = {},
                        .fitted = {}});
  sink.append_triangles({{0, 1, 2}});
  std::filesystem::remove(gone);
  expect_error(ExitCode::budget, [&] { sink.commit(); }, {"m.glb"});
  EXPECT_EQ(read_mesh(folder.file("m.ply")).triangles.size(), 1U);
  EXPECT_EQ(folder.entries(), 1U);
}

/// So large that nobody can read it.
class EndlessMesh final : public meshes::MeshBlocks {
 public:
  [[nodiscard]] std::uint64_t vertices() const override { return 100'000'000; }
  [[nodiscard]] std::uint64_t triangles() const override { return 200'000'000; }
  [[nodiscard]] bool has_normals() const override { return true; }
  [[nodiscard]] const AttributeLayout& layout() const override { return layout_; }
  void read_vertices(std::uint64_t, std::size_t, TriangleMesh&) override { ADD_FAILURE() << "was read"; }
  void read_triangles(std::uint64_t, std::size_t, std::vector<std::array<std::uint32_t, 3>>&) override {}

 private:
  AttributeLayout layout_;
};

TEST(Glb, WhatItCannotHoldIsRefused) {
  const ScratchFolder folder;
  EndlessMesh endless;
  expect_error(ExitCode::budget, [&] { meshes::write_glb(endless, "m.glb", [](std::string_view) {}); },
               {"m.glb", "4 GB", "4.8 GB", ".ply"});
  TriangleMesh m = tetrahedron();
  m.positions[2][1] = std::numeric_limits<double>::infinity();
  expect_error(ExitCode::usage, [&] { write_mesh(m, folder.file("n.glb")); }, {"n.glb", "vertex 2", "not finite"});
  m.positions[2][1] = 1e300;
  expect_error(ExitCode::usage, [&] { write_mesh(m, folder.file("n.glb")); }, {"n.glb", "1e+300"});
  EXPECT_FALSE(std::filesystem::exists(folder.file("n.glb")));
}

TEST(Glb, ScenesOfOtherProgramsAreRead) {
  const ScratchFolder folder;
  std::string data;
  for (const float c : {0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F, 0.0F, 1.0F})
    data.append(reinterpret_cast<const char*>(&c), 4);
  data += std::string("\0\1\2\3", 4);
  const std::string document = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[1]}],
    "nodes":[{"mesh":0,"scale":[-2,1,1]},{"children":[0,2],"translation":[10,20,30]},
             {"mesh":0,"rotation":[0,0,0.70710678118654752,0.70710678118654752]}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"mode":5},
                             {"attributes":{"POSITION":0},"mode":1},
                             {"attributes":{"POSITION":0},"indices":1,"mode":6}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},
                 {"bufferView":1,"componentType":5121,"count":4,"type":"SCALAR"}],
    "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":4}],
    "buffers":[{"byteLength":52}]})";
  const TriangleMesh m = read_mesh(folder.write("m.glb", glb_of(document, data)));
  ASSERT_EQ(m.positions.size(), 8U);  // primitives of a mesh share their vertices
  EXPECT_EQ(m.positions[1], (std::array<double, 3>{8, 20, 30}));
  EXPECT_NEAR(m.positions[5][0], 10, 1e-12);
  EXPECT_NEAR(m.positions[5][1], 21, 1e-12);
  const std::vector<std::array<std::uint32_t, 3>> expected{{0, 2, 1}, {1, 2, 3}, {0, 2, 1}, {0, 3, 2},
                                                           {4, 5, 6}, {5, 7, 6}, {4, 5, 6}, {4, 6, 7}};
  EXPECT_EQ(m.triangles, expected);
}

TEST(Glb, DamageIsNamed) {
  const ScratchFolder folder;
  write_mesh(tetrahedron(), folder.file("m.glb"));
  const std::string whole = bytes_of(folder.file("m.glb"));
  for (std::size_t bytes = 4; bytes < whole.size(); bytes += 5)
    expect_error(ExitCode::unreadable, [&] { read_mesh(folder.write("cut.glb", whole.substr(0, bytes))); },
                 {"cut.glb"});
  expect_error(ExitCode::unreadable, [&] { read_mesh(folder.write("long.glb", whole + "more")); }, {"long as"});
  const auto refused = [&](const std::string& text, const std::vector<std::string>& words) {
    expect_error(
        ExitCode::unreadable, [&] { read_mesh(folder.write("bad.glb", glb_of(text, "0123"))); }, words);
  };
  refused("[]", {"no JSON object"});
  refused("{", {"no JSON object"});
  refused(R"({"extensionsRequired":["KHR_draco_mesh_compression"]})", {"KHR_draco_mesh_compression"});
  refused(R"({"buffers":[{"uri":"m.bin","byteLength":4}]})", {"m.bin", "not there"});
  refused(R"({"nodes":[{"children":[1]},{"children":[0]}],"scenes":[{"nodes":[0]}]})", {"nodes[0] is below itself"});
  refused(R"({"nodes":[{"mesh":7}]})", {"meshes[7]"});
  const auto with_accessor = [](const std::string& accessor) {
    return R"({"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
               "bufferViews":[{"buffer":0,"byteLength":4}],"accessors":[{)" +
           accessor + "}]}";
  };
  refused(with_accessor(R"("bufferView":0,"componentType":5126,"count":1,"type":"VEC3")"), {"beyond the file's data"});
  refused(with_accessor(R"("bufferView":0,"componentType":5126,"count":-1,"type":"VEC3")"), {"\"count\""});
  refused(with_accessor(R"("componentType":5126,"count":1000000000,"type":"VEC3")"), {"without data"});
  refused(with_accessor(R"("bufferView":0,"componentType":5121,"count":4,"type":"SCALAR")"), {"three numbers"});
  refused(R"({"asset":{"version":"2.0"}})", {"no vertices"});
}

TEST(Glb, TheValidatorFindsNothing) {
  if (!has_validator()) GTEST_SKIP() << "node or gltf-validator is missing; scripts/setup installs it where npm is";
  const ScratchFolder folder;
  TriangleMesh georeferenced = with_everything();
  for (auto& p : georeferenced.positions) p = {p[0] + 500000.123, p[1] + 4179332.456, p[2]};
  TriangleMesh odd = with_everything();
  odd.normals[1] = {0, 0, 0};
  odd.normals[2] = {3, 4, 0};
  odd.normals[3] = {std::nanf(""), 0, 0};
  odd.attributes[5][7] = std::nanf("");
  odd.layout[6].name = "CURVATURE";
  TriangleMesh points = with_everything();
  points.triangles.clear();
  TriangleMesh sixteen = with_everything();
  for (std::size_t a = 1; a < 4; ++a) sixteen.layout[a].type = ScalarType::uint16;
  for (const TriangleMesh& m : {with_everything(), georeferenced, odd, points, sixteen, tetrahedron()}) {
    write_mesh(m, folder.file("m.glb"));
    EXPECT_EQ(validated(folder.file("m.glb")), "");
  }
  MeshSink({.path = folder.file("empty.glb")}).commit();
  EXPECT_EQ(validated(folder.file("empty.glb")), "");
}

}  // namespace
}  // namespace lamina
