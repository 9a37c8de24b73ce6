// Full disks and limits: what could not be written is said, and nothing of it is left.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include <atomic>
#include <csignal>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <iterator>
#include <string>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "meshes/mesh_sink.h"
#include "meshes/sunk_mesh.h"

namespace lamina {
namespace {

using test::kColours;
using test::outcome;
using test::outcome_in_child;
using test::some_vertices;
using test::strip;
using test::write_mesh_to;
using testing::HasSubstr;

TEST(UnwritableMesh, FileSizeLimitIsReportedAndNothingLeft) {
  const test::TemporaryFolder folder;
  const std::string text = outcome_in_child([&] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{1'000'000, 1'000'000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    write_mesh_to({.path = folder / "mesh.ply", .attributes = kColours}, 100'000, 10);
  });
  EXPECT_THAT(text, HasSubstr("4: " + (folder / "mesh.ply") + ": cannot be written: File too large"));
  EXPECT_EQ(folder.entries(), 0);
}

/// In a small file system of its own, seen by the child process alone.
std::string outcome_on_small_disk(const std::string& where, const std::function<void()>& work) {
  return outcome_in_child([&] {
    if (::unshare(CLONE_NEWNS) != 0 || ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        ::mount("none", where.c_str(), "tmpfs", 0, "size=1m") != 0) {
      throw Error(ExitCode::internal, "no mount");
    }
    work();
  });
}

TEST(UnwritableMesh, FullDiskIsReportedWhereverItFills) {
  const test::TemporaryFolder small;
  const test::TemporaryFolder large;
  // Vertices too many; faces too many for the temporary folder; each fits but not both together.
  const std::string vertices = outcome_on_small_disk(
      small.path(), [&] { write_mesh_to({.path = small / "mesh.ply", .attributes = kColours}, 100'000, 9); });
  if (vertices == "1: no mount") GTEST_SKIP() << "may not mount";
  EXPECT_THAT(vertices, HasSubstr("4: " + (small / "mesh.ply") +
                                  ": cannot be written: No space left on device; free some space"));
  const std::string faces = outcome_on_small_disk(small.path(), [&] {
    write_mesh_to({.path = large / "mesh.ply", .tmp_dir = small.path(), .attributes = kColours}, 9, 200'000);
  });
  EXPECT_THAT(faces, HasSubstr("4: " + small.path() + ": the temporary face file"));
  EXPECT_THAT(faces, HasSubstr("No space left on device"));
  EXPECT_EQ(large.entries(), 0);
  const std::string both = outcome_on_small_disk(small.path(), [&] {
    const auto count = [&] { return std::distance(std::filesystem::directory_iterator(small.path()), {}); };
    const std::string text =
        outcome([&] { write_mesh_to({.path = small / "mesh.ply", .attributes = kColours}, 15'000, 40'000); });
    throw Error(ExitCode::internal, text + " left " + std::to_string(count()));
  });
  EXPECT_THAT(both, HasSubstr("mesh.ply: cannot be written: No space left on device"));
  EXPECT_THAT(both, HasSubstr("left 0"));
}

TEST(UnwritableMesh, OtherFormatsFailAsThePlyDoes) {
  const test::TemporaryFolder folder;
  const auto write = [&](const std::string& path, const RunContext& run) {
    MeshSink sink({.path = path, .attributes = kColours});
    sink.append_vertices(some_vertices(0, 1000));
    sink.append_triangles(strip(998));
    sink.commit(run);
  };
  for (const char* name : {"mesh.obj", "mesh.off", "mesh.stl"}) {
    std::atomic<bool> cancelled = true;
    RunContext run;
    run.cancel = &cancelled;
    EXPECT_EQ(outcome([&] { write(folder / name, run); }), "1: cancelled") << name;
    EXPECT_THAT(outcome([&] { write(folder / (std::string("no/such/") + name), {}); }), HasSubstr("4: ")) << name;
    const std::string text = outcome_in_child([&] {
      const rlimit limit{100'000, 100'000};  // the PLY's records fit, the text does not
      ::setrlimit(RLIMIT_FSIZE, &limit);
      std::signal(SIGXFSZ, SIG_IGN);
      MeshSink sink({.path = folder / name, .attributes = kColours});
      sink.append_vertices(some_vertices(0, 2400));
      sink.append_triangles(strip(2398));
      sink.commit();
    });
    EXPECT_THAT(text, HasSubstr("4: " + (folder / name) + ": cannot be written")) << name;
    EXPECT_EQ(folder.entries(), 0) << name;
  }
}

}  // namespace
}  // namespace lamina
