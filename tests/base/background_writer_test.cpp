#include "base/spill_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <random>
#include <string>

#include "base/descriptor.h"
#include "base/temporary_folder.h"

namespace lamina {
namespace {

std::string read_back(int fd, std::size_t bytes) {
  std::string text(bytes, '\0');
  text.resize(pread_all(fd, text.data(), bytes, 0).bytes);
  return text;
}

RC_GTEST_PROP(BackgroundWriter, WritesEveryBufferInOrder, (unsigned seed)) {
  std::mt19937 random(seed);
  const test::TemporaryFolder folder;
  const Descriptor streamed = open_unlinked(folder.path());
  const Descriptor placed = open_unlinked(folder.path());
  std::string expected_stream, expected_places;
  BackgroundWriter writer(64, 1 + random() % 5);
  for (int i = 0; i < 40; ++i) {
    const std::size_t bytes = 1 + random() % 64;
    const std::string text(bytes, static_cast<char>('a' + random() % 26));
    auto buffer = writer.buffer();
    std::memcpy(buffer.get(), text.data(), bytes);
    if (random() % 2 == 0) {
      RC_ASSERT(writer.write(streamed.get(), std::move(buffer), bytes) == 0);
      expected_stream += text;
    } else {
      RC_ASSERT(writer.write(placed.get(), std::move(buffer), bytes, expected_places.size()) == 0);
      expected_places += text;
    }
    if (i == 20) RC_ASSERT(writer.drain() == 0);
  }
  RC_ASSERT(writer.drain() == 0);
  RC_ASSERT(read_back(streamed.get(), 4000) == expected_stream);
  RC_ASSERT(read_back(placed.get(), 4000) == expected_places);
}

TEST(BackgroundWriter, FinishesWhatItWasGivenBeforeItEnds) {
  const test::TemporaryFolder folder;
  const Descriptor file = open_unlinked(folder.path());
  {
    BackgroundWriter writer(1 << 16, 3);
    for (int i = 0; i < 50; ++i) {
      auto buffer = writer.buffer();
      std::memset(buffer.get(), i, writer.buffer_bytes());
      writer.write(file.get(), std::move(buffer), writer.buffer_bytes());
    }
  }
  const std::string text = read_back(file.get(), 60 << 16);
  ASSERT_EQ(text.size(), std::size_t{50} << 16);
  for (int i = 0; i < 50; ++i) EXPECT_EQ(text[(static_cast<std::size_t>(i) << 16) + 77], i);
}

TEST(BackgroundWriter, TellsOfAFullDiskAndWritesNothingMore) {
  const Descriptor full(::open("/dev/full", O_WRONLY | O_CLOEXEC));
  if (!full) GTEST_SKIP() << "no /dev/full";
  const test::TemporaryFolder folder;
  const Descriptor file = open_unlinked(folder.path());
  BackgroundWriter writer(16, 2);
  writer.write(full.get(), writer.buffer(), 16);
  EXPECT_EQ(writer.drain(), ENOSPC);
  EXPECT_EQ(writer.write(file.get(), writer.buffer(), 16), ENOSPC);
  EXPECT_EQ(writer.drain(), ENOSPC);
  EXPECT_EQ(read_back(file.get(), 16), "");
}

}  // namespace
}  // namespace lamina
