// OFF with optional colours and normals of the vertices.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/number.h"
#include "lamina/error.h"
#include "meshes/formats.h"

namespace lamina::meshes {
namespace {

/// Lines that hold something: blanks trimmed, comments (#) cut off, empty ones passed over.
class OffLines {
 public:
  explicit OffLines(std::istream& in) : in_(in) {}
  /// Empty at the end of the file; valid until the next call.
  std::string_view next() {
    while (std::getline(in_, line_)) {
      ++number_;
      line_.resize(std::min(line_.find('#'), line_.size()));
      if (const auto text = trimmed(line_); !text.empty()) return text;
    }
    return {};
  }
  [[nodiscard]] std::uint64_t number() const { return number_; }

 private:
  std::istream& in_;
  std::string line_;
  std::uint64_t number_ = 0;
};

class OffReader {
 public:
  OffReader(std::istream& in, const std::string& path) : lines_(in), path_(path) {}

  TriangleMesh read() {
    header();
    // The counts are not to be believed before the lines have been seen.
    for (std::uint64_t v = 0; v < vertices_; ++v) vertex(next_line("vertex", v, vertices_));
    for (std::uint64_t f = 0; f < faces_; ++f) face(next_line("face", f, faces_));
    if (!lines_.next().empty()) fail("more lines than the header's counts promise");
    settle_colours();
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ExitCode::unreadable, fmt::format("{}: line {}: {}", path_, lines_.number(), what));
  }

  std::string_view next_line(const char* what, std::uint64_t i, std::uint64_t count) {
    const auto text = lines_.next();
    if (text.empty())
      fail(fmt::format("ends in {} {} of the {} its header promises: the file is cut short", what, i, count));
    return text;
  }

  std::uint64_t count(std::string_view& text) const {
    const auto value = take_decimal(text);
    if (!value || !(*value >= 0) || *value >= 4294967295.0 || *value != std::floor(*value))
      fail("an OFF header needs the counts of vertices and faces");
    return static_cast<std::uint64_t>(*value);
  }

  void header() {
    std::string_view text = lines_.next();
    const auto magic = text.substr(0, text.find_first_of(" \t"));
    if (!magic.ends_with("OFF")) fail("not an OFF file (no \"OFF\" at its start)");
    if (text.find("BINARY") != std::string_view::npos) fail("binary OFF is not supported: convert to PLY");
    const auto kind = magic.substr(0, magic.size() - 3);
    if (kind.find_first_not_of("CN") != std::string_view::npos)
      fail(fmt::format("{} is not supported, only vertices of three coordinates with colours (C) and normals (N)",
                       magic));
    normals_ = kind.find('N') != std::string_view::npos;
    text = trimmed(text.substr(magic.size()));
    if (text.empty()) text = lines_.next();
    vertices_ = count(text);
    faces_ = count(text);
  }

  std::array<double, 3> triple(std::string_view& text, const char* what) const {
    std::array<double, 3> p{};
    for (double& c : p) {
      const auto value = take_decimal(text);
      if (!value) fail(fmt::format("{} needs three numbers", what));
      c = *value;
    }
    return p;
  }

  void vertex(std::string_view text) {
    mesh_.positions.push_back(triple(text, "a vertex"));
    if (normals_) {
      const auto n = triple(text, "a normal");
      mesh_.normals.push_back({static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])});
    }
    std::size_t channel = 0;
    for (auto c = take_decimal(text); c && channel < 4; c = take_decimal(text), ++channel) {
      if (colours_.size() == channel) colours_.emplace_back(mesh_.positions.size() - 1);
      colours_[channel].push_back(static_cast<float>(*c));
    }
    for (auto& c : colours_) c.resize(mesh_.positions.size());
  }

  void face(std::string_view text) {
    const auto corners = take_decimal(text);
    if (!corners || !(*corners >= 3)) fail("a polygon needs three corners");
    const std::uint32_t first = index(text);
    std::uint32_t last = index(text);
    for (double k = 2; k < *corners; ++k) {
      const std::uint32_t next = index(text);
      mesh_.triangles.push_back({first, last, next});
      last = next;
    }
  }

  std::uint32_t index(std::string_view& text) const {
    const auto v = take_decimal(text);
    if (!v || !(*v >= 0) || *v != std::floor(*v)) fail("a face needs its number of corners and as many vertex numbers");
    if (*v >= static_cast<double>(vertices_))
      fail(fmt::format("the face names vertex {} but there are {}", *v, vertices_));
    return static_cast<std::uint32_t>(*v);
  }

  void settle_colours() {
    if (colours_.size() < 3) return;
    static constexpr const char* kNames[] = {"red", "green", "blue", "alpha"};
    for (std::size_t k = 0; k < colours_.size(); ++k) mesh_.layout.push_back({kNames[k], ScalarType::float32});
    mesh_.attributes = std::move(colours_);
    settle_colour_range(mesh_);
  }

  OffLines lines_;
  const std::string& path_;
  bool normals_ = false;
  std::uint64_t vertices_ = 0, faces_ = 0;
  std::vector<std::vector<float>> colours_;
  TriangleMesh mesh_;
};

}  // namespace

TriangleMesh read_off(FileBuffer& file, const std::string& path) {
  std::istream in(&file);
  try {
    TriangleMesh mesh = OffReader(in, path).read();
    file.require_sound();
    return mesh;
  } catch (const Error&) {
    file.require_sound();  // what looked like an early end may be a damaged archive
    throw;
  }
}

}  // namespace lamina::meshes
