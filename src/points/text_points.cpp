#include "points/text_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>

#include "lamina/error.h"
#include "points/row_parser.h"
#include "points/text_file.h"
#include "points/text_layout.h"

namespace lamina {
namespace {

bool is_row(std::string_view line) {
  return !is_comment(line);
}

class TextPoints final : public PointSource {
 public:
  TextPoints(InputFile file, const std::string& path, const std::string& columns)
      : file_(std::move(file)), line_end_(line_end_of(file_)) {
    info_.path = path;
    const TextLayout layout = understand_text(file_, line_end_, columns, info_);
    parser_.emplace(
        layout.columns, layout.separator,
        ", as in the rows looked at before; say what it is with --columns (red:uchar, red:ushort, red:float)");
    count_rows(layout);
    info_.random_access = true;
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    first = std::min(first, info_.count);
    count = static_cast<std::size_t>(std::min<std::uint64_t>(count, info_.count - first));
    const std::vector<ColumnTarget> targets = prepare_batch(info_, parser_->columns(), first, count, out);
    std::size_t done = 0;
    auto block = std::upper_bound(blocks_.begin(), blocks_.end(), first,
                                  [](std::uint64_t row, const Block& b) { return row < b.first; });
    for (--block; done < count; ++block) {
      const std::uint64_t begin = first + done - block->first;
      const auto rows = static_cast<std::size_t>(std::min<std::uint64_t>(count - done, block->rows.count() - begin));
      for_rows(file_, line_end_, block->rows, begin, rows, is_row,
               [&](std::string_view line, std::uint64_t number, std::size_t i) {
                 parser_->parse(file_, line, number, done + i, targets);
               });
      done += rows;
    }
    round_exact_attributes(out);
  }

 private:
  /// Rows behind a count, or all of them.
  struct Block {
    std::uint64_t first = 0;
    RowIndex rows;
  };

  [[nodiscard]] std::uint64_t parse_count(std::string_view line, std::uint64_t number) const {
    std::vector<std::string_view> words;
    split_line(line, kBlanks, words);
    std::uint64_t count = 0;
    const char* end = words[0].data() + words[0].size();
    const auto [stop, error] = std::from_chars(words[0].data(), end, count);
    if (error != std::errc{} || stop != end || words.size() != 1) {
      throw Error(
          ExitCode::unreadable,
          fmt::format("{}, line {}: the number of rows of the next scan expected, {} stands there; put it right "
                      "or delete all such numbers",
                      file_.name, number, quoted_word(line)));
    }
    return count;
  }

  void count_rows(const TextLayout& layout) {
    LineReader lines(file_, 0, 0, line_end_);
    std::string_view line;
    std::uint64_t left = 0;  // rows of the block
    if (!layout.counted) blocks_.emplace_back();
    while (lines.next(line)) {
      if (lines.line() <= layout.top_lines || is_comment(line)) continue;
      if (layout.counted && left == 0) {
        left = parse_count(line, lines.line());
        if (left > 0) blocks_.push_back({info_.count, {}});
        continue;
      }
      blocks_.back().rows.add(lines);
      ++info_.count;
      --left;
    }
    if (layout.counted && left > 0) {
      throw Error(
          ExitCode::unreadable,
          fmt::format("{}: {} more rows promised when it ends at line {}: it was cut short, or a number of rows is "
                      "wrong",
                      file_.name, left, lines.line()));
    }
    if (blocks_.empty()) blocks_.emplace_back();
  }

  InputFile file_;
  char line_end_;
  std::optional<RowParser> parser_;
  std::vector<Block> blocks_;
};

}  // namespace

std::unique_ptr<PointSource> open_text(InputFile file, const std::string& path, const std::string& columns) {
  return std::make_unique<TextPoints>(std::move(file), path, columns);
}

}  // namespace lamina
