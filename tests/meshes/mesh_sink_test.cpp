#include "meshes/mesh_sink.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <cstring>
#include <functional>
#include <random>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "lamina/mesh.h"
#include "lamina/points.h"
#include "meshes/sunk_mesh.h"

namespace lamina {
namespace {

using test::kColours;
using test::outcome;
using test::outcome_in_child;
using test::some_triangles;
using test::some_vertices;
using test::strip;
using test::Triangles;
using test::write_mesh_to;
using testing::HasSubstr;
TEST(MeshSink, WritesWhatWasAppended) {
  constexpr std::size_t kVertices = 30'000;  // beyond the buffers
  constexpr std::size_t kTriangles = 60'000;
  const test::TemporaryFolder folder;
  for (const bool wide : {false, true}) {
    const MeshSinkSettings settings{.path = folder / "mesh.ply", .attributes = kColours, .double_positions = wide};
    write_mesh_to(settings, kVertices, kTriangles);
    EXPECT_EQ(folder.entries(), 1);

    const auto source = open_points(folder / "mesh.ply");  // checks the faces' number and the file's length
    EXPECT_EQ(source->info().count, kVertices);
    EXPECT_EQ(source->info().double_precision, wide);
    EXPECT_EQ(source->info().attributes, kColours);
    SampleBatch read;
    source->read(0, kVertices, read);
    const VertexBatch expected = some_vertices(0, kVertices);
    for (std::size_t i = 0; i < kVertices; ++i) {
      ASSERT_EQ(read.y[i], wide ? expected.y[i] : static_cast<double>(static_cast<float>(expected.y[i])));
    }
    EXPECT_EQ(read.nz, expected.nz);
    EXPECT_EQ(read.attributes, expected.attributes);

    const std::string bytes = test::read_file(folder / "mesh.ply");
    const Triangles triangles = some_triangles(0, kTriangles, kVertices);
    const char* face = bytes.data() + bytes.size() - 13 * kTriangles;
    for (std::size_t i = 0; i < kTriangles; ++i, face += 13) {
      ASSERT_EQ(face[0], 3);
      ASSERT_EQ(std::memcmp(face + 1, triangles[i].data(), 12), 0);
    }
  }
}

TEST(MeshSink, BytesDoNotDependOnTheBatches) {
  constexpr std::size_t kVertices = 25'000;
  constexpr std::size_t kTriangles = 50'000;
  const test::TemporaryFolder folder;
  write_mesh_to({.path = folder / "whole.ply", .attributes = kColours}, kVertices, kTriangles);
  const std::string whole = test::read_file(folder / "whole.ply");
  for (unsigned seed = 0; seed < 5; ++seed) {
    std::mt19937 random(seed);
    MeshSink sink({.path = folder / "parts.ply", .attributes = kColours});
    while (sink.vertices() < kVertices || sink.triangles() < kTriangles) {
      if (random() % 2 != 0) {
        const std::size_t n = std::min<std::size_t>(random() % 3000, kVertices - sink.vertices());
        sink.append_vertices(some_vertices(sink.vertices(), n));
      } else {
        const std::size_t n = std::min<std::size_t>(random() % 6000, kTriangles - sink.triangles());
        sink.append_triangles(some_triangles(sink.triangles(), n, kVertices));
      }
    }
    sink.commit();
    EXPECT_EQ(sink.vertices(), kVertices);
    EXPECT_EQ(test::read_file(folder / "parts.ply"), whole);
  }
}

TEST(MeshSink, EmptyMeshIsAFileToo) {
  const test::TemporaryFolder folder;
  MeshSink({.path = folder / "mesh.ply"}).commit();
  EXPECT_EQ(open_points(folder / "mesh.ply")->info().count, 0);
}

TEST(MeshSink, WithoutCommitNothingIsLeftAndTheOldFileStays) {
  const test::TemporaryFolder folder;
  const test::TemporaryFolder tmp;
  const std::string path = test::write_file(folder / "mesh.ply", "old");
  {
    MeshSink sink({.path = path, .tmp_dir = tmp.path(), .attributes = kColours});
    sink.append_vertices(some_vertices(0, 50'000));
    sink.append_triangles(some_triangles(0, 100'000, 50'000));
    EXPECT_EQ(folder.entries(), 1);  // what is staged has no name
    EXPECT_EQ(tmp.entries(), 0);
    EXPECT_EQ(test::read_file(path), "old");
  }
  EXPECT_EQ(folder.entries(), 1);
  EXPECT_EQ(test::read_file(path), "old");
  write_mesh_to({.path = path, .attributes = kColours}, 3, 1);
  EXPECT_EQ(folder.entries(), 1);
  EXPECT_THAT(test::read_file(path), testing::StartsWith("ply\n"));
}

TEST(MeshSink, PermissionsFollowTheMask) {
  const test::TemporaryFolder folder;
  const mode_t old = ::umask(027);
  write_mesh_to({.path = folder / "mesh.ply", .attributes = kColours}, 3, 1);
  ::umask(old);
  struct stat status {};
  ASSERT_EQ(::stat((folder / "mesh.ply").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0640U);
}

TEST(MeshSink, LinksStayAndTheirFileIsReplaced) {
  const test::TemporaryFolder folder;
  const test::TemporaryFolder elsewhere;
  std::filesystem::create_symlink(elsewhere / "mesh.ply", folder / "link.ply");
  for (int i = 0; i < 2; ++i) {  // dangling, then not
    write_mesh_to({.path = folder / "link.ply", .attributes = kColours}, 3, 1);
    EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.ply"));
    EXPECT_EQ(open_points(elsewhere / "mesh.ply")->info().count, 3);
    EXPECT_EQ(elsewhere.entries(), 1);
  }
}

TEST(MeshSink, SinksOfOneNameDoNotMeet) {
  const test::TemporaryFolder folder;
  const std::string name(250, 'n');  // the hidden name must still fit
  MeshSink first({.path = folder / name, .attributes = kColours});
  MeshSink second({.path = folder / name, .attributes = kColours});
  first.append_vertices(some_vertices(0, 5));
  second.append_vertices(some_vertices(0, 6));
  first.commit();
  EXPECT_EQ(open_points(folder / name)->info().count, 5);
  second.commit();
  EXPECT_EQ(open_points(folder / name)->info().count, 6);
  EXPECT_EQ(folder.entries(), 1);
}

TEST(MeshSink, PlacesThatCannotBeWritten) {
  const test::TemporaryFolder folder;
  const auto opened = [&](const std::string& path, const std::string& tmp_dir = {}) {
    return outcome([&] { const MeshSink sink({.path = path, .tmp_dir = tmp_dir}); });
  };
  EXPECT_THAT(opened(folder / "none/mesh.ply"),
              HasSubstr("4: " + (folder / "none/mesh.ply") + ": cannot be written: the folder"));
  EXPECT_THAT(opened(folder.path()), HasSubstr("4: " + folder.path() + ": cannot be written: it is a directory"));
  EXPECT_THAT(opened(folder / "new/"), HasSubstr("it is a directory"));
  EXPECT_THAT(opened(""), HasSubstr("4: the output: cannot be written: its name is empty"));
  EXPECT_THAT(opened("/proc/mesh.ply"), HasSubstr("4: /proc/mesh.ply: cannot be written: "));
  EXPECT_THAT(opened(folder / "mesh.ply", folder / "none"),
              HasSubstr("4: " + (folder / "none") + ": cannot make a temporary file"));
  const std::string file = test::write_file(folder / "file", "");
  EXPECT_THAT(opened(file + "/mesh.ply"), HasSubstr("cannot be written"));
  EXPECT_EQ(folder.entries(), 1);
}

TEST(MeshSink, ProtectedFilesAndFoldersAreNotReplaced) {
  const test::TemporaryFolder folder;
  const std::string path = test::write_file(folder / "mesh.ply", "old");
  ::chmod(path.c_str(), 0444);
  ::chmod(folder.path().c_str(), 0777);
  const auto as_nobody = [&](const std::string& name) {
    return outcome_in_child([&] {
      if (::geteuid() == 0 && ::seteuid(65534) != 0) throw std::runtime_error("cannot change user");
      const MeshSink sink({.path = folder / name});
    });
  };
  EXPECT_THAT(as_nobody("mesh.ply"), HasSubstr("mesh.ply: cannot be written: Permission denied"));
  ::chmod(folder.path().c_str(), 0555);
  EXPECT_THAT(as_nobody("new.ply"), HasSubstr("new.ply: cannot be written: Permission denied"));
  ::chmod(folder.path().c_str(), 0755);
  EXPECT_EQ(folder.entries(), 1);
}

TEST(MeshSink, DefectsOfTheCallerAreNamed) {
  const test::TemporaryFolder folder;
  {
    MeshSink sink({.path = folder / "mesh.ply", .attributes = kColours});
    sink.append_vertices(some_vertices(0, 10));
    VertexBatch bad = some_vertices(0, 10);
    bad.z[4] = std::nan("");
    EXPECT_THAT(outcome([&] { sink.append_vertices(bad); }), HasSubstr("1: vertex 14 of the mesh would get z = nan"));
    sink.append_triangles({{0, 1, 10}});
    EXPECT_THAT(outcome([&] { sink.commit(); }), HasSubstr("a triangle uses vertex 10, the mesh has 10 vertices"));
    sink.append_vertices(some_vertices(0, 1));
    sink.commit();
    EXPECT_THAT(outcome([&] { sink.append_triangles({}); }), HasSubstr("is committed"));
    EXPECT_THAT(outcome([&] { sink.commit(); }), HasSubstr("is committed"));
  }
  EXPECT_EQ(folder.entries(), 1);
}

TEST(MeshSink, OtherFormatsHoldTheMeshOfThePly) {
  constexpr std::size_t kVertices = 30'000;  // some blocks
  const AttributeLayout layout{{"red", ScalarType::uint8},
                               {"green", ScalarType::uint8},
                               {"blue", ScalarType::uint8},
                               {"depth", ScalarType::uint16}};
  const test::TemporaryFolder folder;
  const auto write = [&](const std::string& name, bool wide) {
    MeshSink sink({.path = folder / name, .attributes = layout, .double_positions = wide, .comments = {"shift 1 2 3"}});
    VertexBatch batch = some_vertices(0, kVertices);
    batch.attributes = {batch.attributes[0], batch.attributes[0], batch.attributes[0], batch.attributes[1]};
    sink.append_vertices(batch);
    sink.append_triangles(strip(kVertices - 2));
    sink.append_triangles({{0, 15'000, static_cast<std::uint32_t>(kVertices - 1)}});  // from end to end
    sink.commit();
    return read_mesh(folder / name);
  };
  for (const bool wide : {false, true}) {
    const TriangleMesh ply = write("mesh.ply", wide);
    for (const char* name : {"mesh.obj", "mesh.OFF"}) {
      const TriangleMesh mesh = write(name, wide);
      EXPECT_EQ(mesh.positions, ply.positions) << name;
      EXPECT_EQ(mesh.normals, ply.normals) << name;
      EXPECT_EQ(mesh.triangles, ply.triangles) << name;
      ASSERT_GE(mesh.attributes.size(), 3U) << name;                                   // OFF has an opacity, too
      const float scale = mesh.layout[2].type == ScalarType::float32 ? 255.0F : 1.0F;  // OBJ's reach to 1
      for (std::size_t v = 0; v < kVertices; ++v)
        ASSERT_NEAR(scale * mesh.attributes[2][v], ply.attributes[2][v], 0.5) << name;
    }
    const TriangleMesh stl = write("mesh.stl", wide);
    ASSERT_EQ(stl.triangles.size(), ply.triangles.size());
    for (std::size_t t = 0; t < stl.triangles.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t c = 0; c < 3; ++c) {
          ASSERT_EQ(stl.positions[stl.triangles[t][k]][c],
                    static_cast<double>(static_cast<float>(ply.positions[ply.triangles[t][k]][c])));
        }
      }
    }
  }
  EXPECT_EQ(folder.entries(), 4);
  EXPECT_THAT(test::read_file(folder / "mesh.obj").substr(0, 60), HasSubstr("# shift 1 2 3"));
}

TEST(MeshSink, StandardOutputGetsTheSameBytes) {
  const test::TemporaryFolder folder;
  write_mesh_to({.path = folder / "mesh.ply", .attributes = kColours}, 20'000, 40'000);
  const std::string expected = test::read_file(folder / "mesh.ply");
  for (const int flags : {O_WRONLY, O_WRONLY | O_APPEND}) {
    const std::string path = test::write_file(folder / "out", "");
    const int out = ::open(path.c_str(), flags);
    {
      const test::Redirected standard_output(STDOUT_FILENO, out);
      write_mesh_to({.path = "-", .tmp_dir = folder.path(), .attributes = kColours}, 20'000, 40'000);
    }
    ::close(out);
    EXPECT_TRUE(test::read_file(path) == expected);
  }
}

TEST(MeshSink, UncommittedOrFullStandardOutput) {
  const test::TemporaryFolder folder;
  const std::string path = test::write_file(folder / "out", "");
  const int out = ::open(path.c_str(), O_WRONLY);
  {
    const test::Redirected standard_output(STDOUT_FILENO, out);
    MeshSink sink({.path = "-", .attributes = kColours});
    sink.append_vertices(some_vertices(0, 10));
  }
  ::close(out);
  EXPECT_EQ(test::read_file(path), "");
  const int full = ::open("/dev/full", O_WRONLY);
  const std::string text = outcome([&] {
    const test::Redirected standard_output(STDOUT_FILENO, full);
    write_mesh_to({.path = "-", .attributes = kColours}, 10, 1);
  });
  ::close(full);
  EXPECT_THAT(text, HasSubstr("4: standard output: cannot be written: No space left on device"));
}

TEST(MeshSink, DevicesAreWrittenNotReplaced) {
  write_mesh_to({.path = "/dev/null", .attributes = kColours}, 10, 1);
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
  EXPECT_THAT(outcome([] { write_mesh_to({.path = "/dev/full", .attributes = kColours}, 10, 1); }),
              HasSubstr("4: /dev/full: cannot be written: No space left on device"));
}

}  // namespace
}  // namespace lamina
