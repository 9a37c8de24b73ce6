#include "meshes/ply_header.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <sstream>
#include <utility>

#include "lamina/error.h"

namespace lamina::meshes {
namespace {

std::optional<ScalarType> scalar_type(std::string_view word) {
  static constexpr std::array<std::pair<std::string_view, ScalarType>, 16> kTypes{{{"char", ScalarType::int8},
                                                                                   {"int8", ScalarType::int8},
                                                                                   {"uchar", ScalarType::uint8},
                                                                                   {"uint8", ScalarType::uint8},
                                                                                   {"short", ScalarType::int16},
                                                                                   {"int16", ScalarType::int16},
                                                                                   {"ushort", ScalarType::uint16},
                                                                                   {"uint16", ScalarType::uint16},
                                                                                   {"int", ScalarType::int32},
                                                                                   {"int32", ScalarType::int32},
                                                                                   {"uint", ScalarType::uint32},
                                                                                   {"uint32", ScalarType::uint32},
                                                                                   {"float", ScalarType::float32},
                                                                                   {"float32", ScalarType::float32},
                                                                                   {"double", ScalarType::float64},
                                                                                   {"float64", ScalarType::float64}}};
  for (const auto& [name, type] : kTypes)
    if (name == word) return type;
  return std::nullopt;
}

class HeaderParser {
 public:
  explicit HeaderParser(const std::string& path) : path_(path) {}

  void first_line(const std::string& line) {
    if (line != "ply")
      throw Error(ExitCode::unreadable, fmt::format("{}: not a PLY file (no \"ply\" at its start)", path_));
  }

  /// True when the line ends the header.
  bool take(const std::string& line, int number) {
    std::istringstream words(line);
    std::string keyword;
    if (!(words >> keyword) || keyword == "comment" || keyword == "obj_info") return false;
    if (keyword == "end_header") return finish(number);
    if (keyword == "format")
      format(words, number);
    else if (keyword == "element")
      element(words, number);
    else if (keyword == "property")
      property(words, number);
    else
      fail(number, fmt::format("unknown keyword \"{}\"", keyword));
    return false;
  }

  PlyHeader header;

  [[noreturn]] void fail(int line, const std::string& what) const {
    throw Error(ExitCode::unreadable, fmt::format("{}: line {} of the PLY header: {}", path_, line, what));
  }

 private:
  bool finish(int number) const {
    if (!has_format_) fail(number, "the header ends without a format line");
    return true;
  }

  void format(std::istringstream& words, int number) {
    std::string name;
    words >> name;
    if (name == "ascii")
      header.encoding = PlyEncoding::ascii;
    else if (name == "binary_little_endian")
      header.encoding = PlyEncoding::little;
    else if (name == "binary_big_endian")
      header.encoding = PlyEncoding::big;
    else
      fail(number, fmt::format("unknown format \"{}\"", name));
    has_format_ = true;
  }

  void element(std::istringstream& words, int number) {
    PlyElement e;
    std::string count;
    words >> e.name >> count;
    const char* end = count.data() + count.size();
    const auto parsed = std::from_chars(count.data(), end, e.count);
    if (count.empty() || parsed.ec != std::errc() || parsed.ptr != end)
      fail(number, fmt::format("\"{}\" is not a count of elements", count));
    header.elements.push_back(std::move(e));
  }

  void property(std::istringstream& words, int number) {
    if (header.elements.empty()) fail(number, "a property before any element");
    PlyProperty p;
    std::string type;
    words >> type;
    if (type == "list") {
      std::string count_type;
      words >> count_type >> type;
      p.count_type = scalar_type(count_type);
      if (!p.count_type || *p.count_type == ScalarType::float32 || *p.count_type == ScalarType::float64)
        fail(number, fmt::format("\"{}\" cannot count a list", count_type));
    }
    const auto value_type = scalar_type(type);
    if (!value_type) fail(number, fmt::format("unknown type \"{}\"", type));
    p.type = *value_type;
    if (!(words >> p.name)) fail(number, "a property without a name");
    header.elements.back().properties.push_back(std::move(p));
  }

  const std::string& path_;
  bool has_format_ = false;
};

}  // namespace

std::optional<std::size_t> PlyElement::find(std::string_view property) const {
  for (std::size_t i = 0; i < properties.size(); ++i)
    if (properties[i].name == property) return i;
  return std::nullopt;
}

PlyHeader read_ply_header(std::istream& in, const std::string& path) {
  HeaderParser parser(path);
  std::string line;
  for (int number = 1; number < 10000; ++number) {
    // A binary file that only pretends to be PLY must not be read whole in search of a line's end.
    line.clear();
    int c = in.get();
    for (; c != std::istream::traits_type::eof() && c != '\n' && line.size() < 4096; c = in.get())
      line.push_back(static_cast<char>(c));
    if (c != '\n') parser.fail(number, "the file ends inside its header");
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (number == 1)
      parser.first_line(line);
    else if (parser.take(line, number))
      return std::move(parser.header);
  }
  parser.fail(10000, "no end_header");
}

}  // namespace lamina::meshes
