#include "meshes/text_census.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <istream>

#include "lamina/error.h"
#include "meshes/line_reader.h"

namespace lamina::meshes {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", path, what));
}

/// True for a line of the OBJ keyword `letter`.
bool keyword(std::string_view line, char letter) {
  return line.size() > 1 && line[0] == letter && (line[1] == ' ' || line[1] == '\t');
}

/// The three coordinates `text` begins with. OpenMesh stops at a number it cannot read: so must we, by name.
std::array<double, 3> position(std::string_view text, const std::string& path, std::uint64_t line) {
  std::array<double, 3> p{};
  for (double& c : p) {
    const auto value = next_number(text);
    if (!value || !std::isfinite(*value)) fail(path, fmt::format("line {}: a vertex needs three finite numbers", line));
    c = *value;
  }
  return p;
}

TextCensus census_obj(std::istream& in, const std::string& path) {
  TextCensus census;
  census.faces = 0;
  std::string line;
  for (std::uint64_t number = 1; std::getline(in, line); ++number) {
    const auto text = trimmed(line);
    if (keyword(text, 'v')) census.positions.push_back(position(text.substr(1), path, number));
    if (keyword(text, 'f')) ++*census.faces;
    if (!text.empty() && text.back() == '\\' && text[0] != '#')
      fail(path, fmt::format("line {} is continued on the next: join the lines, or convert to PLY", number));
  }
  if (census.positions.empty()) fail(path, "holds no vertices: not an OBJ file?");
  return census;
}

/// A binary file may begin with "solid" too: its length decides.
TextCensus census_stl(std::istream& in, const std::string& path) {
  std::array<char, 84> head{};
  in.read(head.data(), head.size());
  const bool whole_head = in.gcount() == static_cast<std::streamsize>(head.size());
  std::uint32_t count = 0;
  std::memcpy(&count, head.data() + 80, sizeof(count));
  if constexpr (std::endian::native == std::endian::big) count = __builtin_bswap32(count);
  std::uint64_t rest = 0;
  std::array<char, 1 << 16> skipped;
  while (in) {
    in.read(skipped.data(), skipped.size());
    rest += static_cast<std::uint64_t>(in.gcount());
  }
  if (whole_head && rest == 50 * std::uint64_t{count}) return {count, {}, true};
  if (std::string_view(head.data(), 5) != "solid")
    fail(path, whole_head ? fmt::format("its header promises {} triangles but {} bytes follow instead of {}: the file "
                                        "is cut short or damaged",
                                        count, rest, 50 * std::uint64_t{count})
                          : "not an STL file");
  in.clear();
  in.seekg(0);
  TextCensus census{0, {}, false};
  bool ended = false;
  for (std::string line; std::getline(in, line);) {
    const auto text = trimmed(line);
    if (text.starts_with("facet")) ++*census.faces;
    if (text.starts_with("endsolid")) ended = true;
  }
  if (!ended) fail(path, "ends without \"endsolid\": the file is cut short");
  return census;
}

}  // namespace

TextCensus take_census(FileBuffer& file, const std::string& path, TextFormat format) {
  std::istream in(&file);
  in.seekg(0);
  TextCensus census;
  switch (format) {
    case TextFormat::obj:
      census = census_obj(in, path);
      break;
    case TextFormat::stl:
      census = census_stl(in, path);
      break;
  }
  file.require_sound();
  return census;
}

}  // namespace lamina::meshes
