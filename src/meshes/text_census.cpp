#include <fmt/format.h>

#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <istream>

#include "base/little_endian.h"
#include "base/number.h"
#include "lamina/error.h"
#include "meshes/readers.h"

namespace lamina::meshes {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", path, what));
}

/// As OpenMesh's reader parts words.
bool is_blank(char c) {
  return std::isspace(static_cast<unsigned char>(c)) != 0;
}

/// True for a line of the OBJ keyword `letter`.
bool keyword(std::string_view line, char letter) {
  return line.size() > 1 && line[0] == letter && is_blank(line[1]);
}

/// The three coordinates `text` begins with. OpenMesh stops at a number it cannot read: so must we, by name.
std::array<double, 3> position(std::string_view text, const std::string& path, std::uint64_t line) {
  std::array<double, 3> p{};
  for (double& c : p) {
    const auto value = take_decimal(text);
    if (!value || !std::isfinite(*value)) fail(path, fmt::format("line {}: a vertex needs three finite numbers", line));
    c = *value;
  }
  return p;
}

/// The corners of a face, VERTEX[/[TEXTURE][/NORMAL]] each. OpenMesh's reader ends the program over a corner without
/// its vertex and a normal that is not there.
void require_face(std::string_view text, const std::string& path, std::uint64_t line, std::uint64_t normals) {
  const auto refuse = [&](const std::string& what) { fail(path, fmt::format("line {}: {}", line, what)); };
  for (std::uint64_t corners = 0;;) {
    while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
    if (text.empty() || text.front() == '#') {
      if (corners == 0) refuse("a face without corners");
      return;
    }
    ++corners;
    for (int part = 0; part < 3; ++part) {
      std::int64_t number = 0;
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
      const bool there = error == std::errc{};
      if (!there && part != 1)
        refuse("a face's corner is VERTEX, VERTEX/TEXTURE/NORMAL or VERTEX//NORMAL, whole numbers");
      if (there) text.remove_prefix(static_cast<std::size_t>(end - text.data()));
      // From the first on, or from the last one back.
      const std::uint64_t place =
          number < 0 ? ~static_cast<std::uint64_t>(number) + 1 : static_cast<std::uint64_t>(number);
      if (part == 2 && (place < 1 || place > normals))
        refuse(fmt::format("the face names normal {} but there are {} before it", number, normals));
      if (text.empty() || text.front() != '/') break;
      if (part < 2) text.remove_prefix(1);
    }
    if (!text.empty() && !is_blank(text.front()))
      refuse("a face's corner is VERTEX, VERTEX/TEXTURE/NORMAL or VERTEX//NORMAL, whole numbers");
  }
}

TextCensus census_obj(std::istream& in, const std::string& path) {
  TextCensus census;
  census.faces = 0;
  std::string line;
  std::uint64_t normals = 0;
  for (std::uint64_t number = 1; std::getline(in, line); ++number) {
    const auto text = trimmed(line);
    if (!text.empty() && text.back() == '\\' && text[0] != '#')
      fail(path, fmt::format("line {} is continued on the next: join the lines, or convert to PLY", number));
    if (keyword(text, 'v')) census.positions.push_back(position(text.substr(1), path, number));
    if (text.starts_with("vn") && text.size() > 2 && is_blank(text[2])) ++normals;
    if (keyword(text, 'f')) {
      require_face(text.substr(1), path, number, normals);
      ++*census.faces;
    }
  }
  if (census.positions.empty()) fail(path, "holds no vertices: not an OBJ file?");
  return census;
}

/// A binary file may begin with "solid" too: its length decides.
TextCensus census_stl(std::istream& in, const std::string& path) {
  std::array<char, 84> head{};
  in.read(head.data(), head.size());
  const bool whole_head = in.gcount() == static_cast<std::streamsize>(head.size());
  const auto count = load_little<std::uint32_t>(reinterpret_cast<const std::byte*>(head.data()) + 80);
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
