// Meshes too large for one GLB, as tiny limits make them: pieces in files beside it, one mesh again when they are read.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <exception>
#include <filesystem>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "base/output_file.h"
#include "lamina/error.h"
#include "lamina/mesh.h"
#include "meshes/formats.h"
#include "meshes/glb.h"
#include "meshes/glb_files.h"
#include "meshes/mesh_blocks.h"
#include "meshes/mesh_files.h"
#include "meshes/mesh_sink.h"

namespace lamina {
namespace {

using namespace testing_meshes;
using nlohmann::json;

constexpr meshes::GlbLimits kTiny{90'000, 30'000};

void write_set(const TriangleMesh& mesh, const std::string& path, const meshes::GlbLimits& limits = kTiny) {
  ResultFile out(path);
  meshes::HeldMesh blocks(mesh);
  meshes::write_blocks(blocks, meshes::MeshFormat::glb, out, limits);
  out.commit();
}

void expect_same(const TriangleMesh& a, const TriangleMesh& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(a.layout, b.layout);
  EXPECT_EQ(a.attributes, b.attributes);
  EXPECT_EQ(a.triangles, b.triangles);
}

/// Triangles in any order, and vertices in none of them: at the ends and in between.
TriangleMesh shuffled_with_loose_vertices() {
  TriangleMesh mesh = with_everything();
  std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), std::mt19937(7));
  const auto last = static_cast<std::uint32_t>(mesh.positions.size() - 1);
  std::erase_if(mesh.triangles, [last](const auto& t) {
    return std::any_of(t.begin(), t.end(), [last](std::uint32_t v) { return v < 300 || v == 1234 || v == last; });
  });
  return mesh;
}

TEST(GlbSet, ReadsBackAsTheMeshItWas) {
  const ScratchFolder folder;
  TriangleMesh map = with_everything();
  for (auto& p : map.positions) p = {p[0] + 500000.123, p[1] + 4179332.456, p[2]};
  TriangleMesh bare = with_everything();
  bare.normals.clear();
  bare.layout.clear();
  bare.attributes.clear();
  for (const TriangleMesh& mesh : {with_everything(), map, bare, shuffled_with_loose_vertices()}) {
    write_mesh(mesh, folder.file("whole.glb"));
    write_set(mesh, folder.file("set.glb"));
    EXPECT_LE(std::filesystem::file_size(folder.file("set.glb")), kTiny.file);
    expect_same(read_mesh(folder.file("set.glb")), read_mesh(folder.file("whole.glb")));
  }
}

TEST(GlbSet, FilesAreWithinTheLimitAndNamedByTheGlb) {
  const ScratchFolder folder;
  write_set(with_everything(), folder.file("a mesh#1.glb"));
  const json document = json_of_glb(bytes_of(folder.file("a mesh#1.glb")));
  EXPECT_GT(document["buffers"].size(), 4U);
  EXPECT_EQ(document["buffers"].size(), folder.entries());
  EXPECT_EQ(document["meshes"][0]["primitives"].size(), folder.entries());
  EXPECT_FALSE(document["buffers"][0].contains("uri"));
  EXPECT_TRUE(document["buffers"][1]["uri"].get<std::string>().starts_with("a%20mesh%231.1."));
  const std::vector<std::string> files = meshes::companions_of_glb(folder.file("a mesh#1.glb"));
  ASSERT_EQ(files.size() + 1, folder.entries());
  for (const std::string& file : files) EXPECT_LE(std::filesystem::file_size(file), kTiny.buffer);
  // The same mesh, the same bytes.
  const std::string before = bytes_of(folder.file("a mesh#1.glb"));
  write_set(with_everything(), folder.file("a mesh#1.glb"));
  EXPECT_TRUE(bytes_of(folder.file("a mesh#1.glb")) == before);
  EXPECT_EQ(files.size() + 1, folder.entries());
}

TEST(GlbSet, AnOlderOneIsReplacedWhole) {
  const ScratchFolder folder;
  folder.write("m.bin", "mine");
  folder.write("m.1.bin", "mine");
  write_set(with_everything(), folder.file("m.glb"));
  const std::size_t first = folder.entries();
  TriangleMesh other = with_everything();
  for (auto& p : other.positions) p[0] += 1;
  other.triangles.resize(other.triangles.size() / 2);
  write_set(other, folder.file("m.glb"));
  EXPECT_LT(folder.entries(), first);
  EXPECT_EQ(folder.entries(), 3 + meshes::companions_of_glb(folder.file("m.glb")).size());
  EXPECT_EQ(read_mesh(folder.file("m.glb")).triangles, other.triangles);
  write_mesh(tetrahedron(), folder.file("m.glb"));
  EXPECT_EQ(folder.entries(), 3U);
  EXPECT_EQ(bytes_of(folder.file("m.1.bin")), "mine");
}

TEST(GlbSet, StreamsBesideOtherFormats) {
  const ScratchFolder folder;
  const TriangleMesh m = with_everything();
  MeshSink sink(
      {.path = folder.file("s.glb"), .more_paths = {folder.file("s.ply")}, .attributes = m.layout, .glb = kTiny});
  append_mesh(m, sink);
  sink.commit();
  EXPECT_EQ(folder.entries(), 2 + meshes::companions_of_glb(folder.file("s.glb")).size());
  expect_same(read_mesh(folder.file("s.glb")), read_mesh(folder.file("s.ply")));
}

/// What `work` throws in another process; empty where it throws nothing.
std::string said_in_child(const std::function<void()>& work) {
  std::array<int, 2> ends{};
  if (::pipe(ends.data()) != 0) return "no pipe";
  const pid_t child = ::fork();
  if (child == 0) {
    std::string said;
    try {
      work();
    } catch (const std::exception& error) {
      said = error.what();
    }
    const auto written = ::write(ends[1], said.data(), said.size());
    ::_exit(written == static_cast<ssize_t>(said.size()) ? 0 : 1);
  }
  ::close(ends[1]);
  std::string said;
  std::array<char, 512> text{};
  for (ssize_t got = 0; (got = ::read(ends[0], text.data(), text.size())) > 0;)
    said.append(text.data(), static_cast<std::size_t>(got));
  ::close(ends[0]);
  ::waitpid(child, nullptr, 0);
  return said;
}

TEST(GlbSet, AFullDiskLeavesTheOlderOne) {
  const ScratchFolder folder;
  const TriangleMesh mesh = with_everything();
  // Pieces fit one by one but not all together.
  const std::string said = said_in_child([&] {
    if (::unshare(CLONE_NEWNS) != 0 || ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        ::mount("none", folder.file("").c_str(), "tmpfs", 0, "size=128k") != 0)
      throw Error(ExitCode::internal, "no mount");
    write_mesh(tetrahedron(), folder.file("m.glb"));
    const std::string before = bytes_of(folder.file("m.glb"));
    std::string text;
    try {
      write_set(mesh, folder.file("m.glb"));
    } catch (const Error& error) {
      text = error.what();
    }
    if (folder.entries() != 1) text += " files left";
    if (bytes_of(folder.file("m.glb")) != before) text += " another file";
    throw Error(ExitCode::budget, text);
  });
  if (said == "no mount") GTEST_SKIP() << "may not mount";
  EXPECT_NE(said.find("m.glb: cannot be written to its end: No space left on device"), std::string::npos) << said;
  EXPECT_EQ(said.find(" files left"), std::string::npos) << said;
  EXPECT_EQ(said.find(" another file"), std::string::npos) << said;
}

TEST(GlbSet, WhatFailsAtTheEndLeavesNothing) {
  const ScratchFolder folder;
  const std::string inner = folder.file("inner");
  std::filesystem::create_directory(inner);
  // The GLB's name is taken by a folder when everything else is in its place.
  {
    ResultFile out(inner + "/m.glb");
    const TriangleMesh mesh = with_everything();
    meshes::HeldMesh blocks(mesh);
    meshes::write_blocks(blocks, meshes::MeshFormat::glb, out, kTiny);
    std::filesystem::create_directory(inner + "/m.glb");
    expect_error(ExitCode::budget, [&] { out.commit(); }, {"m.glb"});
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(inner), {}), 1);
  // One that nobody commits.
  {
    ResultFile out(folder.file("n.glb"));
    const TriangleMesh mesh = with_everything();
    meshes::HeldMesh blocks(mesh);
    meshes::write_blocks(blocks, meshes::MeshFormat::glb, out, kTiny);
  }
  EXPECT_EQ(folder.entries(), 1U);
}

TEST(GlbSet, RefusesWhatItCannotSplit) {
  const ScratchFolder folder;
  const std::string pipe = folder.file("m.glb");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  expect_error(ExitCode::budget, [&] { write_set(with_everything(), pipe); }, {"m.glb", "pipe", ".ply"});
  expect_error(ExitCode::budget,
               [&] {
                 write_set(with_everything(), folder.file("n.glb"), {60'000, 100});
               },
               {"n.glb", "no buffer of 100 bytes"});
  expect_error(ExitCode::budget,
               [&] {
                 write_set(with_everything(), folder.file("n.glb"), {30'000, 30'000});
               },
               {"n.glb", "at most 30000 bytes"});
  TriangleMesh bad = with_everything();
  bad.triangles[5][1] = 1'000'000;
  expect_error(ExitCode::usage, [&] { write_set(bad, folder.file("n.glb")); }, {"n.glb", "triangle 5", "1000000"});
  EXPECT_EQ(folder.entries(), 1U);
}

TEST(GlbSet, DamageOfItsFilesIsNamed) {
  const ScratchFolder folder;
  write_set(with_everything(), folder.file("m.glb"));
  const std::string file = meshes::companions_of_glb(folder.file("m.glb")).at(1);
  const std::string name = std::filesystem::path(file).filename().string(), bytes = bytes_of(file);
  folder.write(name, bytes.substr(0, bytes.size() - 1));
  expect_error(ExitCode::unreadable, [&] { read_mesh(folder.file("m.glb")); }, {"m.glb", name, "cut short"});
  std::filesystem::remove(file);
  expect_error(ExitCode::unreadable, [&] { read_mesh(folder.file("m.glb")); }, {"m.glb", name, "not there"});
  folder.write("secret.bin", "0123");
  std::filesystem::create_directory(folder.file("in"));
  for (const char* uri : {"../secret.bin", "%2e%2e/secret.bin", "/etc/passwd", "file:///etc/passwd",
                          "https://example.com/a.bin", "data:application/octet-stream;base64,AAAA", "", "%00", "a%"}) {
    const std::string text = fmt::format(R"({{"buffers":[{{"uri":"{}","byteLength":4}}]}})", uri);
    expect_error(ExitCode::unreadable, [&] { read_mesh(folder.write("in/bad.glb", glb_of(text, "0123"))); },
                 {"bad.glb", "keeps data in"});
  }
}

TEST(GlbSet, WhatAnotherProgramHasChangedStaysInPieces) {
  const ScratchFolder folder;
  write_set(with_everything(), folder.file("m.glb"));
  const TriangleMesh whole = read_mesh(folder.file("m.glb"));
  const std::string bytes = bytes_of(folder.file("m.glb"));
  json document = json_of_glb(bytes);
  constexpr std::size_t kHeads = 28;  // of the file and both chunks
  std::uint32_t length = 0;
  std::memcpy(&length, bytes.data() + 12, 4);
  document["meshes"][0]["primitives"][1].erase("extras");
  folder.write("m.glb", glb_of(document.dump(), bytes.substr(kHeads + length)));
  const TriangleMesh pieces = read_mesh(folder.file("m.glb"));
  EXPECT_EQ(pieces.triangles.size(), whole.triangles.size());
  EXPECT_GT(pieces.positions.size(), whole.positions.size());
}

TEST(GlbSet, TheValidatorFindsNothing) {
  if (!has_validator()) GTEST_SKIP() << "node or gltf-validator is missing; scripts/setup installs it where npm is";
  const ScratchFolder folder;
  for (const TriangleMesh& mesh : {with_everything(), shuffled_with_loose_vertices()}) {
    write_set(mesh, folder.file("a set.glb"));
    EXPECT_EQ(validated(folder.file("a set.glb")), "");
  }
}

}  // namespace
}  // namespace lamina
