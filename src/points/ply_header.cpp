#include "points/ply_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <optional>
#include <set>

#include "base/number.h"
#include "lamina/error.h"

namespace lamina {
namespace {

constexpr std::string_view kGoesOn = "+";  ///< begins a comment that the one before goes on in

constexpr std::size_t kLongestHeader = 1 << 20;

/// The line's next word, taken from it; empty at its end.
std::string_view take_word(std::string_view& line) {
  constexpr std::string_view kSpace = " \t\r\n\v\f";
  const std::size_t begin = std::min(line.find_first_not_of(kSpace), line.size());
  const std::size_t end = std::min(line.find_first_of(kSpace, begin), line.size());
  const std::string_view found = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return found;
}

/// Walks the lines of a header; its errors name the line.
class PlyHeaderParser {
 public:
  PlyHeaderParser(std::string_view text, const std::string& name) : text_(text), name_(name) {
    // Old Macintosh files end lines in a lone CR; the first line tells.
    const std::size_t end = text_.find_first_of("\r\n");
    const bool lone_cr =
        end != std::string_view::npos && text_[end] == '\r' && (end + 1 == text_.size() || text_[end + 1] != '\n');
    header_.line_end = lone_cr ? '\r' : '\n';
  }

  PlyHeader parse() {
    while (next_line()) {
      const std::string_view keyword = word();
      if (header_.lines == 1) {
        if (keyword != "ply") fail("'ply' expected: not a PLY file");
      } else if (keyword == "format") {
        format();
      } else if (keyword == "element") {
        element();
      } else if (keyword == "property") {
        property();
      } else if (keyword == "end_header") {
        if (!has_format_) fail("the header ends without a format line");
        return std::move(header_);
      } else if (keyword == "comment") {
        comment();
      } else if (!keyword.empty() && keyword != "obj_info") {
        fail(fmt::format("{} is no keyword of a PLY header", quoted_word(keyword)));
      }
    }
    throw Error(ExitCode::unreadable, fmt::format("{}: no end_header in the first {} bytes: the header is cut short or "
                                                  "this is not a PLY file",
                                                  name_, text_.size()));
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ExitCode::unreadable, fmt::format("{}, line {}: {}", name_, header_.lines, what));
  }

  /// A line counts only when its end is there: data may follow the last one directly.
  bool next_line() {
    const std::size_t end = text_.find(header_.line_end, header_.bytes);
    if (end == std::string_view::npos) return false;
    line_ = text_.substr(header_.bytes, end - header_.bytes);
    header_.bytes = end + 1;
    ++header_.lines;
    return true;
  }

  std::string_view word() { return take_word(line_); }

  std::string_view needed_word(std::string_view what) {
    const std::string_view found = word();
    if (found.empty()) fail(fmt::format("{} expected, the line ends", what));
    return found;
  }

  void end_of_line() {
    if (const std::string_view more = word(); !more.empty())
      fail(fmt::format("{} is too much here", quoted_word(more)));
  }

  void comment() {
    const std::string_view kind = word();
    if (kind == "crs") {
      header_.crs = trimmed(line_);
      crs_line_ = header_.lines;
    } else if (kind == kGoesOn && crs_line_ > 0 && crs_line_ + 1 == header_.lines) {
      header_.crs += trimmed(line_);
      crs_line_ = header_.lines;
    }
  }

  void format() {
    if (has_format_) fail("a second format line");
    const std::string_view encoding = needed_word("a format");
    if (encoding == "ascii") {
      header_.format = PlyFormat::ascii;
    } else if (encoding == "binary_little_endian") {
      header_.format = PlyFormat::little_endian;
    } else if (encoding == "binary_big_endian") {
      header_.format = PlyFormat::big_endian;
    } else {
      fail(fmt::format("format {} is not supported; ascii, binary_little_endian and binary_big_endian are",
                       quoted_word(encoding)));
    }
    const std::string_view version = needed_word("a version");
    if (version != "1.0") fail(fmt::format("PLY version {} is not supported; 1.0 is", quoted_word(version)));
    end_of_line();
    has_format_ = true;
  }

  void element() {
    PlyElement element;
    element.name = needed_word("an element's name");
    const std::string_view count = needed_word("a count");
    const std::optional<std::uint64_t> number = parse_whole(count);
    if (!number) {
      fail(fmt::format("the count of element {} is {}; a whole number expected", quoted_word(element.name),
                       quoted_word(count)));
    }
    element.count = *number;
    end_of_line();
    const auto is_same = [&](const PlyElement& other) { return other.name == element.name; };
    if (std::any_of(header_.elements.begin(), header_.elements.end(), is_same))
      fail(fmt::format("element {} is there already", quoted_word(element.name)));
    header_.elements.push_back(std::move(element));
  }

  ScalarType type() {
    const std::string_view name = needed_word("a type");
    const std::optional<ScalarType> found = ply_type(name);
    if (!found) fail(fmt::format("{} is no PLY type", quoted_word(name)));
    return *found;
  }

  void property() {
    if (header_.elements.empty()) fail("a property before the first element");
    PlyProperty property;
    const std::string_view rest = line_;
    if (word() == "list") {
      property.list_count = type();
      if (*property.list_count == ScalarType::float32 || *property.list_count == ScalarType::float64) {
        fail("the length of a list must be of an integer type");
      }
    } else {
      line_ = rest;
    }
    property.type = type();
    property.name = needed_word("a property's name");
    end_of_line();
    header_.elements.back().properties.push_back(std::move(property));
  }

  std::string_view text_;
  const std::string& name_;
  std::string_view line_;
  PlyHeader header_;
  bool has_format_ = false;
  std::uint64_t crs_line_ = 0;  ///< the last one of a crs, from 1; 0: none so far
};

}  // namespace

bool PlyElement::has_list() const {
  return std::any_of(properties.begin(), properties.end(),
                     [](const PlyProperty& p) { return p.list_count.has_value(); });
}

std::size_t PlyElement::row_bytes() const {
  std::size_t bytes = 0;
  for (const PlyProperty& property : properties) bytes += static_cast<std::size_t>(byte_size(property.type));
  return bytes;
}

std::optional<std::size_t> PlyElement::find(std::string_view property) const {
  for (std::size_t i = 0; i < properties.size(); ++i)
    if (properties[i].name == property) return i;
  return std::nullopt;
}

PlyHeader parse_ply_header(std::string_view text, const std::string& name) {
  return PlyHeaderParser(text, name).parse();
}

void require_ply_names(std::string_view noun, const std::vector<std::string_view>& names) {
  std::set<std::string_view> taken{"x", "y", "z", "nx", "ny", "nz"};
  for (const std::string_view name : names) {
    const bool plain = !name.empty() && std::all_of(name.begin(), name.end(),
                                                    [](unsigned char c) { return std::iscntrl(c) == 0 && c != ' '; });
    if (plain && taken.insert(name).second) continue;
    throw Error(ExitCode::internal, fmt::format("{} '{}' cannot be written to a PLY: its name is empty, has blanks, or "
                                                "is there twice",
                                                noun, one_line(std::string(name))));
  }
}

std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
  return text;
}

std::string ply_comment(std::string_view text) {
  constexpr std::size_t kLongest = 240;
  const std::string all = one_line(std::string(text));
  // Readers drop blanks at a line's ends, and take a byte that begins with 10 for part of the character before.
  const auto can_end = [&](std::size_t at) {
    return all[at - 1] != ' ' && all[at] != ' ' && (static_cast<unsigned char>(all[at]) & 0xC0U) != 0x80U;
  };
  std::string lines = "comment ";
  std::size_t begin = 0;
  while (all.size() - begin > kLongest) {
    std::size_t end = begin + kLongest;
    while (end > begin + 1 && !can_end(end)) --end;
    lines += all.substr(begin, end - begin) + fmt::format("\ncomment {} ", kGoesOn);
    begin = end;
  }
  return lines + all.substr(begin) + "\n";
}

PlyHeader read_ply_header(const InputFile& file) {
  std::string text(static_cast<std::size_t>(std::min<std::uint64_t>(file.bytes, kLongestHeader)), '\0');
  text.resize(file.read(0, text.data(), text.size()));
  return parse_ply_header(text, file.name);
}

PlyHeader read_ply_header(std::streambuf& stream, const std::string& name) {
  std::string text;
  char line_end = '\n';
  std::size_t line = 0;  // where it begins
  while (text.size() < kLongestHeader) {
    const int c = stream.sbumpc();
    if (c == std::streambuf::traits_type::eof()) break;
    text.push_back(static_cast<char>(c));
    // The first line tells how lines end, as above.
    if (line == 0 && c == '\r' && stream.sgetc() != '\n') line_end = '\r';
    if (c != line_end) continue;
    std::string_view words = std::string_view(text).substr(line);
    if (take_word(words) == "end_header") break;
    line = text.size();
  }
  return parse_ply_header(text, name);
}

}  // namespace lamina
