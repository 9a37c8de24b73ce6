#include "base/descriptor.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "base/temporary_folder.h"
#include "lamina/error.h"

namespace lamina {
namespace {

std::string contents(int fd, std::size_t bytes) {
  std::string text(bytes + 1, '\0');
  text.resize(pread_all(fd, text.data(), text.size(), 0).bytes);
  return text;
}

TEST(Descriptor, UnlinkedFileLeavesNoName) {
  const test::TemporaryFolder folder;
  const Descriptor file = open_unlinked(folder.path());
  EXPECT_EQ(write_all(file.get(), "abc", 3), 0);
  EXPECT_EQ(pwrite_all(file.get(), "X", 1, 1), 0);
  EXPECT_EQ(contents(file.get(), 3), "aXc");
  EXPECT_EQ(folder.entries(), 0);
}

TEST(Descriptor, UnlinkedFileInMissingFolderIsRefused) {
  try {
    open_unlinked("/nonexistent/here");
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::budget);
    EXPECT_THAT(e.what(), testing::AllOf(testing::HasSubstr("/nonexistent/here"), testing::HasSubstr("No such file")));
  }
}

TEST(Descriptor, CopiesToFileAppendedFileAndPipe) {
  const test::TemporaryFolder folder;
  std::string text;
  for (int i = 0; i < 100'000; ++i) text += std::to_string(i);
  const Descriptor from = open_unlinked(folder.path());
  ASSERT_EQ(write_all(from.get(), text.data(), text.size()), 0);

  const Descriptor to = open_unlinked(folder.path());
  ASSERT_EQ(write_all(to.get(), "head", 4), 0);
  EXPECT_EQ(copy_all(from.get(), text.size(), to.get()), 0);
  EXPECT_EQ(contents(to.get(), text.size() + 4), "head" + text);

  const Descriptor moved = open_unlinked(folder.path());
  const Descriptor source = open_unlinked(folder.path());
  ASSERT_EQ(write_all(source.get(), text.data(), text.size()), 0);
  ASSERT_EQ(write_all(moved.get(), "head", 4), 0);
  EXPECT_EQ(move_all(source.get(), text.size(), moved.get()), 0);
  EXPECT_EQ(contents(moved.get(), text.size() + 4), "head" + text);
  EXPECT_EQ(move_all(source.get(), text.size() + 1, moved.get()), EIO);

  // copy_file_range and sendfile refuse files opened for appending.
  const std::string name = test::write_file(folder / "log", "head");
  const Descriptor appended(::open(name.c_str(), O_WRONLY | O_APPEND));
  EXPECT_EQ(copy_all(from.get(), text.size(), appended.get()), 0);
  EXPECT_EQ(test::read_file(name), "head" + text);

  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const Descriptor out(ends[0]);
  Descriptor in(ends[1]);
  std::string received;
  std::thread reader([&] {
    char buffer[4096];
    for (ssize_t n = 0; (n = ::read(out.get(), buffer, sizeof buffer)) > 0;)
      received.append(buffer, static_cast<std::size_t>(n));
  });
  EXPECT_EQ(copy_all(from.get(), text.size(), in.get()), 0);
  in.close();
  reader.join();
  EXPECT_EQ(received, text);
}

TEST(Descriptor, CopyReportsShortSourceAndFullTarget) {
  const test::TemporaryFolder folder;
  const Descriptor from = open_unlinked(folder.path());
  ASSERT_EQ(write_all(from.get(), "abc", 3), 0);
  EXPECT_EQ(copy_all(from.get(), 4, open_unlinked(folder.path()).get()), EIO);
  const Descriptor full(::open("/dev/full", O_WRONLY));
  if (full) {
    EXPECT_EQ(copy_all(from.get(), 3, full.get()), ENOSPC);
  }
}

}  // namespace
}  // namespace lamina
