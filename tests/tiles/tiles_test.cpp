#include "lamina/tiles.h"

#include <gtest/gtest.h>

#include <sys/resource.h>
#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "lamina/error.h"
#include "meshes/mesh_files.h"
#include "support/paths.h"
#include "tiles/tile_files.h"

namespace lamina {
namespace {

using namespace testing_meshes;
using namespace testing_tiles;
namespace fs = std::filesystem;

TileSettings into(const std::string& folder, bool compress = true, const std::string& crs = {}) {
  return {folder, compress, crs};
}

/// Edges between places that do not have one triangle on either side, of all tiles together.
std::vector<std::array<std::array<std::int64_t, 3>, 2>> open_edges(const Tileset& set,
                                                                   const std::vector<const Json*>& tiles) {
  std::map<std::array<std::array<std::int64_t, 3>, 2>, int> sides;
  for (const Json* tile : tiles)
    for (const Triangle& t : set.triangles(*tile))
      for (std::size_t k = 0; k < 3; ++k) {
        const auto &a = t[k].at, &b = t[(k + 1) % 3].at;
        if (a < b) ++sides[{a, b}];
        if (b < a) --sides[{b, a}];
      }
  std::vector<std::array<std::array<std::int64_t, 3>, 2>> open;
  for (const auto& [edge, sum] : sides) {
    if (sum != 0) open.push_back(edge);
  }
  return open;
}

std::map<std::string, std::string> all_files(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files[fs::relative(entry.path(), folder).string()] = bytes_of(entry.path().string());
  }
  return files;
}

TEST(Tiles, LeavesHaveEveryTriangleWithItsColours) {
  const ScratchFolder folder;
  const TriangleMesh mesh = bumpy_ball(100, true, {3, 4, 5});
  for (const bool compress : {true, false}) {
    const std::string name = folder.file(compress ? "small" : "plain");
    const TileStats stats = write_small_tiles(mesh, into(name, compress, {}));
    const Tileset set(name);
    std::vector<Triangle> found;
    set.visit([&](const Json& tile, const Json*) {
      if (tile.contains("children")) return;
      const auto some = set.triangles(tile);
      EXPECT_GT(some.size(), 600U);
      EXPECT_LT(some.size(), 1200U);
      found.insert(found.end(), some.begin(), some.end());
    });
    auto wanted = expected_triangles(mesh, set);
    std::sort(found.begin(), found.end());
    std::sort(wanted.begin(), wanted.end());
    EXPECT_TRUE(found == wanted);
    EXPECT_EQ(stats.triangles, mesh.triangles.size());
    EXPECT_GE(stats.levels, 3);
  }
}

TEST(Tiles, EveryTileHasTheAttributes) {
  const ScratchFolder folder;
  TriangleMesh mesh = bumpy_ball(70, true);
  mesh.layout.insert(mesh.layout.end(), {{"height", ScalarType::float64}, {"Class", ScalarType::uint8}});
  mesh.attributes.resize(5);
  for (const auto& p : mesh.positions) {
    mesh.attributes[3].push_back(static_cast<float>(p[2]));
    mesh.attributes[4].push_back(p[2] > 0 ? 200.0F : 7.0F);
  }
  for (const bool compress : {true, false}) {
    const std::string name = folder.file(compress ? "small" : "plain");
    write_small_tiles(mesh, into(name, compress, {}));
    const Tileset set(name);
    set.visit([&](const Json& tile, const Json*) {
      const Glb glb = read_glb_chunks(name + "/" + tile["content"]["uri"].get<std::string>());
      const Json& primitive = glb.json["meshes"][0]["primitives"][0];
      const Json& attributes = primitive["attributes"];
      const auto at = numbers_of(glb, attributes["POSITION"], 3), heights = numbers_of(glb, attributes["_HEIGHT"], 1),
                 classes = numbers_of(glb, attributes["_CLASS"], 1);
      EXPECT_EQ(glb.json["accessors"][attributes["_CLASS"].get<std::size_t>()]["name"], "Class");
      ASSERT_EQ(3 * heights.size(), at.size());
      ASSERT_EQ(heights.size(), classes.size());
      const bool leaf = !tile.contains("children");
      for (std::size_t v = 0; v < heights.size(); ++v) {
        // y up in the content; a vertex of a coarser tile has its attribute from along an edge.
        const double z =
            at[3 * v + 1] * set.step + glb.json["nodes"][0]["translation"][1].get<double>() + set.origin[2];
        ASSERT_NEAR(heights[v], z, leaf ? 1e-4 : 0.1);
        if (leaf && std::abs(z) > 0.01) {
          ASSERT_EQ(classes[v], z > 0 ? 200 : 7);
        }
      }
    });
  }
}

TEST(Tiles, TreeIsSound) {
  const ScratchFolder folder;
  const TileStats stats = write_small_tiles(bumpy_ball(90, false), into(folder.file("set")));
  const Tileset set(folder.file("set"));
  EXPECT_EQ(set.json["asset"]["version"], "1.1");
  EXPECT_EQ(set.json["root"]["refine"], "REPLACE");
  std::set<std::string> contents;
  set.visit([&](const Json& tile, const Json* above) {
    EXPECT_TRUE(contents.insert(tile["content"]["uri"].get<std::string>()).second);
    const auto box = tile["boundingVolume"]["box"].get<std::array<double, 12>>();
    for (const Triangle& t : set.triangles(tile))
      for (const Corner& c : t)
        for (std::size_t k = 0; k < 3; ++k)
          ASSERT_LE(std::abs(static_cast<double>(c.at[k]) * set.step - box[k]), box[3 + 4 * k] * (1 + 1e-12));
    const double error = tile["geometricError"];
    EXPECT_EQ(error == 0, !tile.contains("children"));
    if (above == nullptr) return;
    EXPECT_LE(error, (*above)["geometricError"].get<double>());
    const auto outer = (*above)["boundingVolume"]["box"].get<std::array<double, 12>>();
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_LE(std::abs(box[k] - outer[k]) + box[3 + 4 * k], outer[3 + 4 * k] * (1 + 1e-12));
  });
  EXPECT_EQ(contents.size(), stats.tiles);
  EXPECT_EQ(all_files(set.folder).size(), stats.tiles + 1);
  EXPECT_GE(set.json["geometricError"].get<double>(), set.json["root"]["geometricError"].get<double>());
}

TEST(Tiles, NoCracksWhateverLevelsAreShownTogether) {
  const ScratchFolder folder;
  write_small_tiles(bumpy_ball(110, true), into(folder.file("set"), false, {}));
  const Tileset set(folder.file("set"));
  EXPECT_TRUE(open_edges(set, set.cut([](const Json&) { return false; })).empty());
  EXPECT_TRUE(open_edges(set, set.cut([](const Json&) { return true; })).empty());
  std::mt19937 random(7);
  for (int i = 0; i < 20; ++i) {
    const auto cut = set.cut([&](const Json&) { return random() % 3 != 0; });
    ASSERT_TRUE(open_edges(set, cut).empty()) << cut.size() << " tiles";
  }
}

TEST(Tiles, RimsOfTheMeshAreSimplifiedAndNoOthersAppear) {
  const ScratchFolder folder;
  const TriangleMesh mesh = bumpy_ball(110, false);
  write_small_tiles(mesh, into(folder.file("set"), false, {}));
  const Tileset set(folder.file("set"));
  const auto finest = open_edges(set, set.cut([](const Json&) { return true; }));
  const auto coarsest = open_edges(set, set.cut([](const Json&) { return false; }));
  EXPECT_EQ(finest.size(), 2U * 220);
  EXPECT_LT(coarsest.size(), finest.size() / 2);
  std::mt19937 random(9);
  for (int i = 0; i < 8; ++i) {
    for (const auto& edge : open_edges(set, set.cut([&](const Json&) { return random() % 2 != 0; })))
      for (const auto& end : edge)  // the rims lie at 0.5 from the poles, which is z = +-0.88
        ASSERT_GT(std::abs(static_cast<double>(end[2]) * set.step + set.origin[2]), 0.75);
  }
}

// What an error says: no vertex of a tile is much farther from the ball than that, in the root mean square.
TEST(Tiles, ErrorsAreThoseOfTheSurface) {
  const ScratchFolder folder;
  TriangleMesh ball = bumpy_ball(110, true);
  for (auto& p : ball.positions) {
    const double r = std::hypot(p[0], p[1], p[2]);
    for (double& c : p) c /= r;
  }
  write_small_tiles(ball, into(folder.file("set"), false, {}));
  const Tileset set(folder.file("set"));
  set.visit([&](const Json& tile, const Json*) {
    double sum = 0;
    std::size_t count = 0;
    for (const Triangle& t : set.triangles(tile)) {
      Vec3 middle{};
      for (const Corner& c : t)
        for (std::size_t k = 0; k < 3; ++k) middle[k] += (static_cast<double>(c.at[k]) * set.step + set.origin[k]) / 3;
      const double off = std::hypot(middle[0], middle[1], middle[2]) - 1;
      sum += off * off;
      ++count;
    }
    constexpr double kOfTheMesh = 3e-4;  // how far its own triangles are from the ball
    EXPECT_LT(std::sqrt(sum / static_cast<double>(count)), kOfTheMesh + tile["geometricError"].get<double>());
  });
}

TEST(Tiles, SameBytesForAnyThreads) {
  const ScratchFolder folder;
  const TriangleMesh mesh = bumpy_ball(90, false);
  std::map<std::string, std::string> first;
  for (const int threads : {1, 4}) {
    RunContext run;
    run.threads = threads;
    const std::string name = folder.file(std::to_string(threads));
    write_tiles(mesh, into(name), run);
    const auto files = all_files(name);
    if (first.empty()) first = files;
    EXPECT_TRUE(first == files);
    write_small_tiles(mesh, into(name + "small"), run);
  }
  EXPECT_TRUE(all_files(folder.file("1small")) == all_files(folder.file("4small")));
}

TEST(Tiles, CoordinatesOfMapsStayWithinAMillimetre) {
  const ScratchFolder folder;
  TriangleMesh mesh = bumpy_ball(60, true);
  const Vec3 at{412345.678, 5654321.123, 321.5};
  for (auto& p : mesh.positions)
    for (std::size_t k = 0; k < 3; ++k) p[k] = at[k] + 900 * p[k];
  write_small_tiles(mesh, into(folder.file("set"), true, "EPSG:32633"));
  const Tileset set(folder.file("set"));
  EXPECT_LE(set.step, 0.001);
  EXPECT_EQ(set.json["asset"]["extras"]["crs"], "EPSG:32633");
  auto wanted = expected_triangles(mesh, set);
  std::vector<Triangle> found;
  for (const Json* leaf : set.cut([](const Json&) { return true; })) {
    const auto some = set.triangles(*leaf);
    found.insert(found.end(), some.begin(), some.end());
  }
  std::sort(found.begin(), found.end());
  std::sort(wanted.begin(), wanted.end());
  EXPECT_TRUE(found == wanted);
  // The root stands on the Earth, its third axis up.
  const auto m = set.json["root"]["transform"].get<std::array<double, 16>>();
  const double radius = std::hypot(m[12], m[13], m[14]);
  EXPECT_NEAR(radius, 6'365'500, 1500);
  EXPECT_GT((m[8] * m[12] + m[9] * m[13] + m[10] * m[14]) / radius, 0.999);
  EXPECT_TRUE(open_edges(set, set.cut([&](const Json& t) { return t.contains("refine"); })).empty());
}

TEST(Tiles, AFileReadInPiecesGivesTheSame) {
  const ScratchFolder folder;
  const TriangleMesh mesh = bumpy_ball(60, false, {1e6, 0, 0});
  write_mesh(mesh, folder.file("m.ply"));
  ASSERT_TRUE(write_tiles_of_file(folder.file("m.ply"), into(folder.file("streamed"))));
  write_tiles(read_mesh(folder.file("m.ply")), into(folder.file("held")));
  EXPECT_TRUE(all_files(folder.file("streamed")) == all_files(folder.file("held")));
  write_mesh(mesh, folder.file("m.obj"));
  EXPECT_FALSE(write_tiles_of_file(folder.file("m.obj"), into(folder.file("none"))));
  // One that is damaged: a face with a vertex that is not there.
  std::string bytes = bytes_of(folder.file("m.ply"));
  bytes[bytes.size() - 1] = '\x7F';
  folder.write("bad.ply", bytes);
  expect_error(ExitCode::unreadable, [&] { write_tiles_of_file(folder.file("bad.ply"), into(folder.file("none"))); },
               {"names vertex"});
  EXPECT_FALSE(fs::exists(folder.file("none")));
}

TEST(Tiles, MeshesThatAreNoManifoldsAndFlatOnesWork) {
  const ScratchFolder folder;
  TriangleMesh mesh = bumpy_ball(60, true);
  const std::size_t ball = mesh.triangles.size();
  for (std::size_t t = 0; t < ball; t += 50) {
    const auto [a, b, c] = mesh.triangles[t];
    mesh.triangles.push_back({a, b, static_cast<std::uint32_t>(mesh.positions.size() / 2)});  // a third at its edge
    mesh.triangles.push_back({a, a, c});                                                      // none at all
  }
  const TileStats stats = write_small_tiles(mesh, into(folder.file("set")));
  EXPECT_EQ(stats.triangles, mesh.triangles.size() - (ball + 49) / 50);
  TriangleMesh one;
  one.positions = {{1, 1, 1}, {2, 1, 1}, {1, 2, 1}};
  one.triangles = {{0, 1, 2}};
  EXPECT_EQ(write_tiles(one, into(folder.file("one"))).tiles, 1U);
  one.positions = {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
  EXPECT_EQ(write_tiles(one, into(folder.file("point"))).tiles, 1U);
}

TEST(Tiles, RefusalsLeaveNothing) {
  const ScratchFolder folder;
  const TriangleMesh mesh = bumpy_ball(20, true);
  TriangleMesh points = mesh;
  points.triangles.clear();
  TriangleMesh broken = mesh;
  broken.positions[7][1] = std::nan("");
  const std::string set = folder.file("set");
  expect_error(ExitCode::unreadable, [&] { write_tiles(points, into(set)); }, {"no triangles", "points"});
  expect_error(ExitCode::unreadable, [&] { write_tiles({}, into(set)); }, {"empty"});
  expect_error(ExitCode::unreadable, [&] { write_tiles(broken, into(set)); }, {"vertex 7", "not finite"});
  expect_error(ExitCode::budget, [&] { write_tiles(mesh, into(folder.file("no/where"))); }, {"no/where"});
  folder.write("file", "x");
  expect_error(ExitCode::budget, [&] { write_tiles(mesh, into(folder.file("file"))); }, {"is a file"});
  EXPECT_EQ(folder.entries(), 1U);
  fs::create_directories(folder.file("full/of"));
  expect_error(ExitCode::budget, [&] { write_tiles(mesh, into(folder.file("full"))); }, {"not empty"});
  EXPECT_EQ(folder.entries(), 2U);
  const std::atomic<bool> cancel = true;
  RunContext run;
  run.cancel = &cancel;
  expect_error(ExitCode::internal, [&] { write_tiles(mesh, into(set), run); }, {"cancelled"});
  EXPECT_EQ(folder.entries(), 2U);
  fs::create_directories(set);
  EXPECT_EQ(write_tiles(mesh, into(set + "/")).tiles, 1U);
  EXPECT_TRUE(fs::exists(set + "/tileset.json"));
}

TEST(Tiles, AFullDiskLeavesNothing) {
  const ScratchFolder folder;
  const TriangleMesh mesh = bumpy_ball(60, true);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{20'000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  try {
    write_tiles(mesh, into(folder.file("set")));
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::budget) << error.what();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(folder.entries(), 0U);
}

/// Wherever it comes from, among tiles that are built side by side.
TEST(Tiles, AnErrorInATileEndsTheRunAndLeavesNothing) {
  const ScratchFolder folder;
  const TriangleMesh mesh = bumpy_ball(90, false);
  for (int last = 1; last < 12; ++last) {
    RunContext run;
    run.threads = 4;
    int told = 0;
    run.progress = [&](const Progress&) {
      if (++told == last) throw Error(ExitCode::budget, "the disk is full");
    };
    expect_error(ExitCode::budget, [&] { write_small_tiles(mesh, into(folder.file("set")), run); }, {"is full"});
    EXPECT_EQ(folder.entries(), 0U);
  }
}

TEST(Tiles, WhatAKilledRunLeftIsRemoved) {
  const ScratchFolder folder;
  fs::create_directories(folder.file(".set.partial-1-0/tiles"));
  write_tiles(bumpy_ball(20, true), into(folder.file("set")));
  EXPECT_EQ(folder.entries(), 1U);
  fs::remove_all(folder.file("set"));
  fs::create_directories(folder.file(".set.partial-1-0/tiles"));
  const fs::path before = fs::current_path();
  fs::current_path(fs::path(folder.file("set")).parent_path());
  write_tiles(bumpy_ball(20, true), into("set"));
  fs::current_path(before);
  EXPECT_EQ(folder.entries(), 1U);
}

TEST(Tiles, KhronosValidatorFindsNothing) {
  if (!fs::exists(LAMINA_SOURCE_DIR "/tests/interop/node_modules/gltf-validator") ||
      std::system("node --version > /dev/null 2>&1") != 0)
    GTEST_SKIP() << "gltf-validator is not installed";
  const ScratchFolder folder;
  TriangleMesh mesh = bumpy_ball(40, true);
  mesh.layout.insert(mesh.layout.end(), {{"height", ScalarType::float32}, {"class", ScalarType::uint8}});
  mesh.attributes.resize(5, std::vector<float>(mesh.positions.size(), 1.5F));
  write_small_tiles(mesh, into(folder.file("plain"), false, {}));
  write_small_tiles(mesh, into(folder.file("packed"), true, {}));
  for (auto& p : mesh.positions) p[0] *= 1e4;
  write_small_tiles(mesh, into(folder.file("wide"), true, "EPSG:25832"));
  for (const char* set : {"plain", "packed", "wide"}) {
    const std::string out = folder.file("report");
    const std::string command = "node '" LAMINA_SOURCE_DIR "/tests/interop/validate_glb.cjs' '" + folder.file(set) +
                                "/tiles/0.glb' > '" + out + "' 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << bytes_of(out);
  }
}

}  // namespace
}  // namespace lamina
