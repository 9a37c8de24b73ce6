// The folder that chunks are made from.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>

#include <filesystem>

#include "base/descriptor.h"
#include "chunks/chunked.h"

namespace lamina {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

class KeptStore : public ::testing::Test {
 protected:
  KeptStore() {
    settings_.input = test::write_cloud(test::torus_cloud(3000), folder_ / "in.ply");
    whole_ = test::whole_bytes(settings_, folder_);
    write_store(settings_, store_, {});
    from_store_.input = store_;
    from_store_.output = folder_ / "from_store.ply";
  }
  std::string refusal(ExitCode code) {
    try {
      reconstruct_surface(from_store_, {});
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code) << error.what();
      return error.what();
    }
    ADD_FAILURE() << "ran";
    return {};
  }
  test::TemporaryFolder folder_;
  SurfaceSettings settings_, from_store_;
  const std::string store_ = folder_ / "store";
  std::string whole_;
};

TEST_F(KeptStore, IsAnInputLikeAFile) {
  for (int again = 0; again < 2; ++again) {
    reconstruct_surface(from_store_, {});
    EXPECT_TRUE(test::read_file(from_store_.output) == whole_);
  }
}

TEST_F(KeptStore, IsNotOverwritten) {
  EXPECT_THROW(write_store(settings_, store_, {}), Error);
  reconstruct_surface(from_store_, {});
}

TEST_F(KeptStore, AppearsWhenCompleteOnly) {
  const long before = folder_.entries();
  settings_.input = folder_ / "missing.ply";
  EXPECT_THROW(write_store(settings_, folder_ / "other", {}), Error);
  EXPECT_EQ(folder_.entries(), before);
}

TEST_F(KeptStore, ThoseOfKilledRunsAreRemoved) {
  fs::create_directory(folder_ / ".other.partial-1");
  test::write_file(folder_ / ".other.partial-1/samples.00", "what a killed run has left");
  const std::string live = folder_ / ".other.partial-2";
  fs::create_directory(live);
  const Descriptor held(::open(live.c_str(), O_RDONLY | O_DIRECTORY));
  ASSERT_EQ(::flock(held.get(), LOCK_EX), 0);
  write_store(settings_, folder_ / "other", {});
  EXPECT_FALSE(fs::exists(folder_ / ".other.partial-1"));
  EXPECT_TRUE(fs::exists(live));
}

TEST_F(KeptStore, RefusesOtherWaysOfReading) {
  from_store_.frame = FrameMode::axis;
  EXPECT_THAT(refusal(ExitCode::usage), AllOf(HasSubstr("--frame"), HasSubstr("pca")));
}

TEST_F(KeptStore, NamesTheFileThatIsDamaged) {
  for (const fs::directory_entry& file : fs::directory_iterator(store_)) {
    const std::string path = file.path().string(), bytes = test::read_file(path);
    ASSERT_FALSE(bytes.empty());
    const bool describes = file.path().filename() == "store.json";
    for (const std::size_t at : {std::size_t{0}, bytes.size() / 3, bytes.size() - 2}) {
      std::string changed = bytes;
      changed[at] = static_cast<char>(changed[at] ^ 4);
      test::write_file(path, changed);
      // A description may say other things and be sound in itself.
      if (!describes) {
        EXPECT_THAT(refusal(ExitCode::unreadable), HasSubstr(store_)) << path;
      }
    }
    test::write_file(path, bytes.substr(0, bytes.size() - 3));
    EXPECT_THAT(refusal(ExitCode::unreadable), HasSubstr(path));
    fs::rename(path, folder_ / "aside");
    if (!describes) {
      EXPECT_THAT(refusal(ExitCode::unreadable), HasSubstr(path));
    }
    fs::rename(folder_ / "aside", path);
    test::write_file(path, bytes);
  }
  reconstruct_surface(from_store_, {});
  EXPECT_TRUE(test::read_file(from_store_.output) == whole_);
}

TEST_F(KeptStore, ChunksOfSomethingElseAreRefused) {
  SurfaceSettings s = from_store_;
  s.output = folder_ / "part.lmesh";
  EXPECT_THROW(reconstruct_chunk(s, {0, 3}, {}), Error);
  EXPECT_THROW(reconstruct_chunk(s, {4, 3}, {}), Error);
  s.volume.path = folder_ / "x.vdb";
  EXPECT_THROW(reconstruct_chunk(s, {1, 3}, {}), Error);
  s.volume.path.clear();
  s.input = settings_.input;
  EXPECT_THROW(reconstruct_chunk(s, {1, 3}, {}), Error);
  EXPECT_FALSE(fs::exists(s.output));
}

/// A torus, every hundredth of whose samples is there twice, with a few strays beside it.
test::Cloud dirty_cloud() {
  test::Cloud cloud = test::torus_cloud(4000);
  const std::size_t clean = cloud.size();
  for (std::size_t i = 0; i < clean; i += 100) {
    const test::Point3 p = cloud.positions[i];
    const test::Point3 n = cloud.normals[i];
    cloud.add(p, n);
  }
  for (int i = 0; i < 5; ++i) cloud.add({2.4 + 0.3 * i, 0, 0}, {1, 0, 0});
  return cloud;
}

class CleanedStore : public ::testing::Test {
 protected:
  CleanedStore() {
    settings_.input = test::write_cloud(dirty_cloud(), folder_ / "in.ply");
    settings_.clean.merge = 0;
    settings_.clean.sigma = 4;
    settings_.clean.pick.every = 2;
    whole_ = test::whole_bytes(settings_, folder_);
    const SurfaceStats stats = write_store(settings_, store_, {});
    EXPECT_GT(stats.cleaned.outliers, 0u);
    EXPECT_GT(stats.cleaned.merged, 0u);
    EXPECT_GT(stats.cleaned.skipped, 0u);
  }
  test::TemporaryFolder folder_;
  SurfaceSettings settings_;
  const std::string store_ = folder_ / "store";
  std::string whole_;
};

TEST_F(CleanedStore, ChunksAreThoseOfTheCleanedCloud) {
  SurfaceSettings chunks;
  EXPECT_TRUE(test::merged_bytes(test::make_parts(chunks, store_, 3, folder_), folder_) == whole_);
}

TEST_F(CleanedStore, TakesTheOptionsItWasMadeWithAndNoOthers) {
  settings_.input = store_;
  settings_.output = folder_ / "again.ply";
  reconstruct_surface(settings_, {});
  EXPECT_TRUE(test::read_file(settings_.output) == whole_);
  settings_.clean.sigma = 2;
  try {
    reconstruct_surface(settings_, {});
    ADD_FAILURE() << "ran";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::usage);
    EXPECT_THAT(error.what(), AllOf(HasSubstr("outliers 4"), HasSubstr("outliers 2"), HasSubstr("lamina sort")));
  }
}

TEST_F(CleanedStore, ACheckpointCleansToo) {
  settings_.output = folder_ / "resumable.ply";
  reconstruct_resumable(settings_, {folder_ / "checkpoint", false}, {});
  EXPECT_TRUE(test::read_file(settings_.output) == whole_);
}

}  // namespace
}  // namespace lamina
