#include "points/pcd_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "base/number.h"
#include "lamina/error.h"
#include "points/input_file.h"
#include "points/point_columns.h"
#include "points/text_rows.h"

namespace lamina {
namespace {

constexpr std::size_t kMostFields = 256;
constexpr std::size_t kMostValues = 1 << 16;

class PcdHeaderParser {
 public:
  PcdHeaderParser(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  PcdHeader parse() {
    while (next_line()) {
      if (words_.empty() || words_[0].starts_with('#')) continue;
      const std::string_view keyword = words_[0];
      words_.erase(words_.begin());
      if (keyword == "DATA") {
        data();
        return finish();
      }
      take(keyword);
    }
    throw Error(ExitCode::unreadable, fmt::format("{}: no DATA line in the first {} bytes: the PCD header is cut short",
                                                  name_, text_.size()));
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ExitCode::unreadable, fmt::format("{}, line {}: {}", name_, header_.lines, what));
  }

  /// About the header as a whole, which the last line read is not to blame for.
  [[noreturn]] void fail_header(const std::string& what) const {
    throw Error(ExitCode::unreadable, fmt::format("{}: in the PCD header, {}", name_, what));
  }

  bool next_line() {
    const std::size_t end = text_.find('\n', static_cast<std::size_t>(header_.bytes));
    if (end == std::string_view::npos) return false;
    split_line(text_.substr(static_cast<std::size_t>(header_.bytes), end - static_cast<std::size_t>(header_.bytes)),
               kBlanks, words_);
    header_.bytes = end + 1;
    ++header_.lines;
    return true;
  }

  std::uint64_t number(std::string_view word) const {
    const std::optional<std::uint64_t> value = parse_whole(word);
    if (!value) fail(fmt::format("{} is no whole number", quoted_word(word)));
    return *value;
  }

  std::uint64_t only_number() const {
    if (words_.size() != 1) fail("one whole number expected");
    return number(words_[0]);
  }

  void take(std::string_view keyword) {
    if (keyword == "FIELDS" || keyword == "COLUMNS") {
      if (words_.size() > kMostFields) fail(fmt::format("more than {} fields", kMostFields));
      if (!header_.fields.empty()) fail("a second list of fields");
      for (const std::string_view word : words_)
        header_.fields.push_back({usual_name(word), ScalarType::float32, 4, 1});
    } else if (keyword == "SIZE" || keyword == "TYPE" || keyword == "COUNT") {
      if (words_.size() != header_.fields.size()) {
        fail(fmt::format("{} values for {} fields", words_.size(), header_.fields.size()));
      }
      std::vector<std::string>& kept = keyword == "SIZE" ? sizes_ : keyword == "TYPE" ? types_ : counts_;
      kept.assign(words_.begin(), words_.end());
    } else if (keyword == "WIDTH") {
      width_ = only_number();
    } else if (keyword == "HEIGHT") {
      height_ = only_number();
    } else if (keyword == "POINTS") {
      points_ = only_number();
    } else if (keyword == "VIEWPOINT") {
      const std::vector<std::string_view> none{"0", "0", "0", "1", "0", "0", "0"};
      header_.has_viewpoint = words_ != none;
      const auto is_zero = [](std::string_view word) {
        double value = 1;
        return is_number(word, value) && value == 0;
      };
      header_.is_moved = words_.size() < 3 || !std::all_of(words_.begin(), words_.begin() + 3, is_zero);
    } else if (keyword != "VERSION") {
      fail(fmt::format("{} is no keyword of a PCD header", quoted_word(keyword)));
    }
  }

  void data() {
    const std::string_view kind = words_.size() == 1 ? words_[0] : std::string_view{};
    if (kind == "ascii") {
      header_.data = PcdData::ascii;
    } else if (kind == "binary") {
      header_.data = PcdData::binary;
    } else if (kind == "binary_compressed") {
      header_.data = PcdData::binary_compressed;
    } else {
      fail(fmt::format("data {} are not known; ascii, binary and binary_compressed are", quoted_word(kind)));
    }
  }

  void give_type(PcdField& field, const std::string& size, const std::string& type) const {
    const std::string both = type + size;
    const auto is = [&](const char* wanted) { return both == wanted; };
    field.bytes = static_cast<std::size_t>(number(size));
    field.type = is("I1")   ? std::optional(ScalarType::int8)
                 : is("U1") ? std::optional(ScalarType::uint8)
                 : is("I2") ? std::optional(ScalarType::int16)
                 : is("U2") ? std::optional(ScalarType::uint16)
                 : is("I4") ? std::optional(ScalarType::int32)
                 : is("U4") ? std::optional(ScalarType::uint32)
                 : is("F4") ? std::optional(ScalarType::float32)
                 : is("F8") ? std::optional(ScalarType::float64)
                            : std::nullopt;
    if (!field.type && !is("I8") && !is("U8")) {
      fail_header(fmt::format("field {} has TYPE {} and SIZE {}, which is no type of a PCD file",
                              quoted_word(field.name), quoted_word(type), quoted_word(size)));
    }
  }

  PcdHeader finish() {
    if (header_.fields.empty()) fail_header("the header has no FIELDS line before DATA");
    std::size_t values = 0;
    for (std::size_t i = 0; i < header_.fields.size(); ++i) {
      PcdField& field = header_.fields[i];
      give_type(field, sizes_.empty() ? "4" : sizes_[i], types_.empty() ? "F" : types_[i]);
      if (!counts_.empty())
        field.count = static_cast<std::size_t>(std::min<std::uint64_t>(number(counts_[i]), kMostValues));
      values += field.count;
    }
    if (values == 0 || values >= kMostValues) fail_header(fmt::format("{} values a point are not read", values));
    const bool has_size = width_ && height_;
    // Two numbers below 2^32 do not overflow; greater ones no file holds.
    constexpr std::uint64_t kMost = 0xFFFFFFFFU;
    if (has_size && (*width_ > kMost || *height_ > kMost)) fail_header("WIDTH or HEIGHT is absurd");
    if (!points_ && !has_size) fail_header("the header has neither POINTS nor WIDTH and HEIGHT");
    header_.points = points_ ? *points_ : *width_ * *height_;
    if (has_size && *height_ > 1 && *width_ > 1) header_.width = *width_;
    if (has_size && *width_ * *height_ != header_.points) {
      fail_header(fmt::format("POINTS is {}, but WIDTH times HEIGHT {}", header_.points, *width_ * *height_));
    }
    return std::move(header_);
  }

  std::string_view text_;
  const std::string& name_;
  std::vector<std::string_view> words_;
  PcdHeader header_;
  std::vector<std::string> sizes_, types_, counts_;
  std::optional<std::uint64_t> width_, height_, points_;
};

}  // namespace

std::size_t PcdHeader::point_bytes() const {
  std::size_t sum = 0;
  for (const PcdField& field : fields) sum += field.bytes * field.count;
  return sum;
}

bool is_packed(const PcdField& field) {
  return (field.name == "rgb" || field.name == "rgba") && field.bytes == 4 && field.count == 1;
}

std::size_t pcd_channels(const PcdField& field) {
  return field.name == "rgba" ? 4 : 3;
}

PcdHeader parse_pcd_header(std::string_view text, const std::string& name) {
  return PcdHeaderParser(text, name).parse();
}

}  // namespace lamina
