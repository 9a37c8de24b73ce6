#include "meshes/text_census.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstring>
#include <sstream>

#include "lamina/error.h"

namespace lamina::meshes {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", path, what));
}

std::string_view trimmed(const std::string& line) {
  const auto first = line.find_first_not_of(" \t\r");
  if (first == std::string::npos) return {};
  return std::string_view(line).substr(first, line.find_last_not_of(" \t\r") - first + 1);
}

bool keyword(std::string_view line, char letter) {
  return line.size() > 1 && line[0] == letter && (line[1] == ' ' || line[1] == '\t');
}

TextCensus census_obj(std::istream& in, const std::string& path) {
  TextCensus census{0, 0, false};
  std::string line;
  for (std::uint64_t number = 1; std::getline(in, line); ++number) {
    const auto text = trimmed(line);
    if (keyword(text, 'v')) ++*census.vertices;
    if (keyword(text, 'f')) ++*census.faces;
    if (!text.empty() && text.back() == '\\' && text[0] != '#')
      fail(path, fmt::format("line {} is continued on the next: join the lines, or convert to PLY", number));
  }
  if (*census.vertices == 0) fail(path, "holds no vertices: not an OBJ file?");
  return census;
}

/// The counts follow the keyword, on its line or on the next that is neither empty nor a comment.
TextCensus census_off(std::istream& in, const std::string& path) {
  std::string line, words;
  for (int i = 0; i < 1000 && std::getline(in, line); ++i) {
    line.resize(std::min(line.find('#'), line.size()));
    const auto text = trimmed(line);
    if (i == 0 && text.find("OFF") == std::string_view::npos) fail(path, "not an OFF file (no \"OFF\" at its start)");
    if (text.find("BINARY") != std::string_view::npos) fail(path, "binary OFF is not supported: convert to PLY");
    words += std::string(text) + ' ';
    std::istringstream counts(words.substr(words.find("OFF") + 3));
    std::uint64_t v = 0, f = 0;
    if (counts >> v >> f) return {v, f, false};
  }
  fail(path, "its OFF header has no counts of vertices and faces");
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
  if (whole_head && rest == 50 * std::uint64_t{count}) return {std::nullopt, count, true};
  if (std::string_view(head.data(), 5) != "solid")
    fail(path, whole_head ? fmt::format("its header promises {} triangles but {} bytes follow instead of {}: the file "
                                        "is cut short or damaged",
                                        count, rest, 50 * std::uint64_t{count})
                          : "not an STL file");
  in.clear();
  in.seekg(0);
  TextCensus census{std::nullopt, 0, false};
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
    case TextFormat::off:
      census = census_off(in, path);
      break;
    case TextFormat::stl:
      census = census_stl(in, path);
      break;
  }
  file.require_sound();
  return census;
}

}  // namespace lamina::meshes
