#include "points/text_rows.h"

#include <gtest/gtest.h>

#include "base/temporary_folder.h"

namespace lamina {
namespace {

TEST(LineReader, GivesLinesOfAnyLengthWithTheirNumbers) {
  const test::TemporaryFolder folder;
  std::vector<std::string> lines;
  std::string text = "head\n";
  for (std::size_t i = 0; i < 300; ++i) {
    lines.push_back(std::string(i % 17 == 0 ? 40'000 * (i % 5 + 1) : i + 1, static_cast<char>('a' + i % 26)));
    text += lines.back() + "\n  \r\n";  // each followed by a blank one
  }
  text.pop_back();
  const InputFile file = open_input(test::write_file(folder / "text.ply", "ply\n" + text), "");
  LineReader reader(file, 9, 2, '\n');
  std::string_view line;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    ASSERT_TRUE(reader.next(line));
    EXPECT_EQ(line, lines[i]);
    EXPECT_EQ(reader.line(), 3 + 2 * i);
  }
  EXPECT_FALSE(reader.next(line));
  EXPECT_FALSE(reader.next(line));
}

}  // namespace
}  // namespace lamina
