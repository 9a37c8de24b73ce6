// Files that another program writes to while they are read, and reads that fail.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "points/input_file.h"
#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina {
namespace {

using ::testing::HasSubstr;

std::string refused_change(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::unreadable);
    return e.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

class ChangingFile : public ::testing::Test {
 protected:
  void read_some(PointSource& source) {
    SampleBatch batch;
    source.read(0, 10, batch);
  }
  test::TemporaryFolder folder_;
  const SampleBatch rows_ = test::sphere_rows(1000);
};

TEST_F(ChangingFile, EveryFormatNoticesARowThatIsOverwritten) {
  for (const char* name : {"cloud.ply", "cloud.xyz", "cloud.pcd", "cloud.las"}) {
    const std::string path = test::write_points(folder_ / name, rows_, test::sphere_columns());
    const auto source = open_points(path);
    read_some(*source);
    const auto size = std::filesystem::file_size(path);
    std::fstream(path, std::ios::binary | std::ios::in | std::ios::out).seekp(static_cast<std::streamoff>(size) - 9)
        << "1";
    // The clock that stamps files may not have ticked since the file was made.
    timespec later[2] = {{0, UTIME_OMIT}, {4'000'000'000, 5}};
    ASSERT_EQ(::utimensat(AT_FDCWD, path.c_str(), later, 0), 0);
    EXPECT_THAT(refused_change([&] { read_some(*source); }), HasSubstr("another program wrote to it")) << name;
  }
}

TEST_F(ChangingFile, GrowingAndShrinkingFilesAreNoticed) {
  const std::string path = test::write_points(folder_ / "cloud.ply", rows_, test::sphere_columns());
  const auto size = std::filesystem::file_size(path);
  for (const auto now : {size + 1, size / 2}) {
    std::filesystem::resize_file(path, size);
    const auto source = open_points(path);
    read_some(*source);
    std::filesystem::resize_file(path, now);
    EXPECT_THAT(refused_change([&] { read_some(*source); }), HasSubstr(path));
  }
}

TEST_F(ChangingFile, AFileThatIsReplacedIsReadToItsEnd) {
  const std::string path = test::write_points(folder_ / "cloud.ply", rows_, test::sphere_columns());
  const auto source = open_points(path);
  test::write_file(folder_ / "new.ply", "another");
  std::filesystem::rename(folder_ / "new.ply", path);
  read_some(*source);
}

TEST_F(ChangingFile, AReadThatFailsIsSaid) {
  // The system reads no folders: what stands for a bad disk.
  const InputFile file{Descriptor(::open(folder_.path().c_str(), O_RDONLY)), 100, "scan.ply"};
  char byte = 0;
  EXPECT_THAT(refused_change([&] { file.read(0, &byte, 1); }), HasSubstr("scan.ply: cannot be read"));
}

}  // namespace
}  // namespace lamina
