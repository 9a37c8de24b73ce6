#include "common/text.h"

#include <gtest/gtest.h>

#include "lamina/error.h"

namespace lamina::tools {
namespace {

TEST(Text, CountsKeepThreeDigits) {
  EXPECT_EQ(count_text(0), "0");
  EXPECT_EQ(count_text(999), "999");
  EXPECT_EQ(count_text(1000), "1.00 k");
  EXPECT_EQ(count_text(12'345), "12.3 k");
  EXPECT_EQ(count_text(999'600), "1.00 M");
  EXPECT_EQ(count_text(1'234'567), "1.23 M");
  EXPECT_EQ(count_text(400'000'000), "400 M");
  EXPECT_EQ(bytes_text(172'000'000), "172 MB");
  EXPECT_EQ(bytes_text(12), "12 B");
}

TEST(Text, SecondsReadAsTime) {
  EXPECT_EQ(seconds_text(0.421), "0.42 s");
  EXPECT_EQ(seconds_text(12.34), "12.3 s");
  EXPECT_EQ(seconds_text(59.97), "1 min 00 s");
  EXPECT_EQ(seconds_text(185), "3 min 05 s");
  EXPECT_EQ(seconds_text(7620), "2 h 07 min");
}

TEST(Text, BytesHaveUnits) {
  EXPECT_EQ(parse_bytes("1000"), 1000u);
  EXPECT_EQ(parse_bytes("512M"), 512u << 20);
  EXPECT_EQ(parse_bytes("4g"), std::size_t{4} << 30);
  EXPECT_EQ(parse_bytes("1.5GiB"), std::size_t{3} << 29);
  EXPECT_EQ(parse_bytes("2kb"), 2048u);
  EXPECT_EQ(parse_bytes("7B"), 7u);
  for (const char* text : {"", "M", "4X", "-1G", "4GG", "4 G", "1e30T", "nan", "4iB"}) {
    EXPECT_THROW(parse_bytes(text), Error) << text;
  }
}

TEST(Text, NearestWordForgivesSmallSlips) {
  const std::vector<std::string> words{"--size", "--view", "--supersample"};
  EXPECT_EQ(nearest_word("--sise", words), "--size");
  EXPECT_EQ(nearest_word("--veiw", words), "--view");
  EXPECT_EQ(nearest_word("--supersampel", words), "--supersample");
  EXPECT_EQ(nearest_word("--threads", words), "");
  EXPECT_EQ(nearest_word("x", {}), "");
}

}  // namespace
}  // namespace lamina::tools
