#include "meshes/glb.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "base/number.h"
#include "lamina/error.h"
#include "meshes/mesh_blocks.h"

namespace lamina::meshes {
namespace {

/// Some of a mesh's vertices: a bit for each, and their places among each other.
class VertexSet {
 public:
  explicit VertexSet(std::uint64_t vertices) : words_(vertices / 64 + 1) {}

  [[nodiscard]] bool has(std::uint64_t vertex) const { return (words_[vertex / 64] >> vertex % 64 & 1) != 0; }
  void insert(std::uint64_t vertex) {
    if (has(vertex)) return;
    words_[vertex / 64] |= std::uint64_t{1} << vertex % 64;
    ++size_;
    if (!(vertex > 0 && has(vertex - 1))) ++runs_;
    if ((vertex + 1) / 64 < words_.size() && has(vertex + 1)) --runs_;
  }
  void clear() {
    words_.assign(words_.size(), 0);
    size_ = runs_ = 0;
  }

  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] std::uint64_t runs() const { return runs_; }  ///< of vertices that follow each other

  /// Everything is in it: place_of() may be asked.
  void number() {
    before_.clear();
    std::uint32_t before = 0;
    for (std::size_t word = 0; word < words_.size(); ++word) {
      if (word % kGroup == 0) before_.push_back(before);
      before += static_cast<std::uint32_t>(std::popcount(words_[word]));
    }
  }
  /// How many of those before this one are in it.
  [[nodiscard]] std::uint32_t place_of(std::uint64_t vertex) const {
    const std::size_t word = vertex / 64;
    std::uint32_t place = before_[word / kGroup];
    for (std::size_t w = word / kGroup * kGroup; w < word; ++w)
      place += static_cast<std::uint32_t>(std::popcount(words_[w]));
    return place + static_cast<std::uint32_t>(std::popcount(words_[word] & ((std::uint64_t{1} << vertex % 64) - 1)));
  }
  /// The first one at or behind `from`, `end` where there is none before that.
  [[nodiscard]] std::uint64_t next(std::uint64_t from, std::uint64_t end) const { return find(from, end, 0); }
  /// The first one that is not in it.
  [[nodiscard]] std::uint64_t next_gap(std::uint64_t from, std::uint64_t end) const {
    return find(from, end, ~std::uint64_t{0});
  }

 private:
  static constexpr std::size_t kGroup = 8;

  [[nodiscard]] std::uint64_t find(std::uint64_t from, std::uint64_t end, std::uint64_t inverted) const {
    while (from < end) {
      const std::uint64_t bits = (words_[from / 64] ^ inverted) >> from % 64;
      if (bits != 0) return std::min<std::uint64_t>(end, from + static_cast<std::uint64_t>(std::countr_zero(bits)));
      from = (from / 64 + 1) * 64;
    }
    return end;
  }

  std::vector<std::uint64_t> words_;
  std::vector<std::uint32_t> before_;  ///< vertices before each group of words
  std::uint64_t size_ = 0, runs_ = 0;
};

using SetCorners = std::array<std::uint32_t, 3>;

/// Cuts a mesh into pieces of no more bytes than a buffer may have: triangles in their order, behind them the vertices
/// that none has.
class GlbCutter {
 public:
  struct Cut {
    std::uint64_t first_triangle = 0, triangles = 0;
    std::uint64_t first_loose = 0, end_loose = 0;  ///< between these are its vertices that no triangle has
  };

  GlbCutter(MeshBlocks& mesh, std::uint64_t most, std::string name)
      : mesh_(mesh),
        most_(most),
        row_(glb_data_bytes(mesh.layout(), mesh.has_normals(), 1, 0)),
        name_(std::move(name)),
        here_(mesh.vertices()),
        used_(mesh.vertices()) {}

  /// The next piece, whose vertices are then in vertices(); false behind the last one.
  bool next(Cut& cut) {
    cut = {triangle_, 0, loose_, loose_};
    here_.clear();
    for (; triangle_ < mesh_.triangles(); ++triangle_, ++cut.triangles) {
      const SetCorners& t = corners(triangle_);
      std::uint64_t vertices = here_.size();
      for (const std::uint32_t v : t) vertices += here_.has(v) ? 0 : 1;
      if (!fits(vertices, cut.triangles + 1)) return close();
      for (const std::uint32_t v : t) {
        here_.insert(v);
        used_.insert(v);
      }
    }
    for (; loose_ < mesh_.vertices(); cut.end_loose = ++loose_) {
      if (used_.has(loose_)) continue;
      if (!fits(here_.size() + 1, cut.triangles)) return close();
      here_.insert(loose_);
    }
    return close();
  }

  /// Makes the vertices those of a piece again, after the last one.
  void go_back(const Cut& cut) {
    here_.clear();
    for_corners(cut, [&](const SetCorners& t) {
      for (const std::uint32_t v : t) here_.insert(v);
    });
    for (std::uint64_t v = cut.first_loose; v < cut.end_loose; ++v) {
      if (!used_.has(v)) here_.insert(v);
    }
    here_.number();
  }

  [[nodiscard]] const VertexSet& vertices() const { return here_; }

  template <class Use>
  void for_corners(const Cut& cut, const Use& use) {
    for (std::uint64_t t = cut.first_triangle; t < cut.first_triangle + cut.triangles; ++t) use(corners(t));
  }

 private:
  [[nodiscard]] bool fits(std::uint64_t vertices, std::uint64_t triangles) const {
    const std::uint64_t runs = std::min(vertices, here_.runs() + vertices - here_.size());
    return vertices * row_ + triangles * kGlbTriangleBytes + runs * kGlbRunBytes <= most_;
  }

  bool close() {
    here_.number();
    const bool empty = here_.size() == 0;
    if (empty && (triangle_ < mesh_.triangles() || loose_ < mesh_.vertices())) {
      throw Error(ExitCode::budget,
                  fmt::format("{}: a triangle has so many attributes that no buffer of {} bytes holds "
                              "it; write a .ply",
                              name_, most_));
    }
    return !empty;
  }

  const SetCorners& corners(std::uint64_t triangle) {
    if (triangle < first_ || triangle >= first_ + block_.size()) {
      first_ = triangle;
      mesh_.read_triangles(first_, std::min<std::uint64_t>(kBlockRows, mesh_.triangles() - first_), block_);
    }
    const SetCorners& t = block_[triangle - first_];
    if (std::max({t[0], t[1], t[2]}) >= mesh_.vertices()) {
      throw Error(ExitCode::usage, fmt::format("{}: triangle {} names vertex {}, the mesh has {}", name_, triangle,
                                               std::max({t[0], t[1], t[2]}), mesh_.vertices()));
    }
    return t;
  }

  MeshBlocks& mesh_;
  std::uint64_t most_, row_;
  std::string name_;
  VertexSet here_, used_;
  std::uint64_t triangle_ = 0, loose_ = 0;  ///< that come next
  std::uint64_t first_ = 0;                 ///< of block_
  std::vector<SetCorners> block_;
};

/// Calls use(block, index in it) for those vertices that are in the set.
template <class Use>
void for_set_vertices(MeshBlocks& mesh, const VertexSet& set, const Use& use) {
  TriangleMesh block;
  const std::uint64_t all = mesh.vertices();
  for (std::uint64_t v = set.next(0, all); v < all; v = set.next(v, all)) {
    const std::uint64_t first = v / kBlockRows * kBlockRows, end = std::min<std::uint64_t>(first + kBlockRows, all);
    mesh.read_vertices(first, end - first, block);
    for (; v < end; v = set.next(v + 1, end)) use(block, v - first);
  }
}

class GlbSetWriter {
 public:
  GlbSetWriter(MeshBlocks& mesh, ResultFile& out, const GlbLimits& limits)
      : mesh_(mesh), out_(out), limits_(limits), cutter_(mesh, limits.buffer, out.name()) {}

  void write() {
    box_ = glb_box_of(mesh_, out_.name());
    std::vector<GlbPiece> pieces;
    // The GLB names the others, so it is written last.
    GlbCutter::Cut first, cut;
    while (cutter_.next(cut)) {
      pieces.push_back(piece_of(cut));
      if (pieces.size() == 1)
        first = cut;
      else
        write_beside(cut, pieces);
    }
    const std::string json = describe_glb(mesh_, pieces);
    const std::uint64_t data = bytes_of(pieces[0]);
    if (glb_file_bytes(json, data) > limits_.file) {
      throw Error(ExitCode::budget,
                  fmt::format("{}: a GLB holds at most {} bytes, and what is said of the mesh takes {}; write a .ply",
                              out_.name(), limits_.file, json.size()));
    }
    cutter_.go_back(first);
    const GlbBytes::Sink sink = [this](std::string_view bytes) { out_.write(bytes); };
    GlbBytes bytes(sink);
    bytes.add_head(json, data);
    add_data(first, bytes);
    bytes.flush();
  }

 private:
  [[nodiscard]] GlbPiece piece_of(const GlbCutter::Cut& cut) {
    GlbPiece piece;
    piece.vertices = cutter_.vertices().size();
    piece.triangles = cut.triangles;
    piece.runs = cutter_.vertices().runs();
    piece.box = box_;
    bool any = false;
    for_set_vertices(mesh_, cutter_.vertices(), [&](const TriangleMesh& block, std::size_t v) {
      const auto& p = block.positions[v];
      for (std::size_t k = 0; k < 3; ++k) {
        piece.box.low[k] = any ? std::min(piece.box.low[k], p[k]) : p[k];
        piece.box.high[k] = any ? std::max(piece.box.high[k], p[k]) : p[k];
      }
      any = true;
    });
    return piece;
  }

  [[nodiscard]] std::uint64_t bytes_of(const GlbPiece& piece) const {
    return glb_data_bytes(mesh_.layout(), mesh_.has_normals(), piece.vertices, piece.triangles) +
           piece.runs * kGlbRunBytes;
  }

  void write_beside(const GlbCutter::Cut& cut, std::vector<GlbPiece>& pieces) {
    ResultFile& file = out_.add_companion();
    auto sum = static_cast<std::uint32_t>(::crc32_z(0, nullptr, 0));
    const GlbBytes::Sink sink = [&](std::string_view bytes) {
      sum = static_cast<std::uint32_t>(::crc32_z(sum, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
      file.write(bytes);
    };
    GlbBytes bytes(sink);
    add_data(cut, bytes);
    bytes.flush();
    const std::filesystem::path glb(out_.path());
    const std::string name = fmt::format("{}.{}.{:08x}.bin", glb.stem().string(), pieces.size() - 1, sum);
    out_.name_companion((glb.parent_path() / name).string());
    pieces.back().uri = uri_of_file(name);
  }

  void add_data(const GlbCutter::Cut& cut, GlbBytes& bytes) {
    const VertexSet& set = cutter_.vertices();
    for (const GlbColumn& column : glb_columns(mesh_.layout(), mesh_.has_normals(), box_)) {
      for_set_vertices(mesh_, set, [&](const TriangleMesh& block, std::size_t v) {
        std::array<std::byte, kMostGlbColumn> record{};
        column.encode(block, v, record.data());
        bytes.add(record.data(), column.stride);
      });
    }
    cutter_.for_corners(cut, [&](const SetCorners& t) {
      for (const std::uint32_t v : t) bytes.add(set.place_of(v));
    });
    const std::uint64_t all = mesh_.vertices();
    for (std::uint64_t v = set.next(0, all), end = 0; v < all; v = set.next(end, all)) {
      end = set.next_gap(v, all);
      bytes.add(static_cast<std::uint32_t>(v));
      bytes.add(static_cast<std::uint32_t>(end - v));
    }
  }

  MeshBlocks& mesh_;
  ResultFile& out_;
  GlbLimits limits_;
  GlbCutter cutter_;
  GlbBox box_;
};

/// Whether this is the name of a file that was written beside a GLB of that stem.
bool is_companion_name(std::string_view name, const std::string& stem) {
  constexpr std::string_view kEnding = ".bin";
  constexpr std::size_t kSum = 8;
  if (!name.starts_with(stem + ".") || !name.ends_with(kEnding)) return false;
  name.remove_suffix(kEnding.size());
  name.remove_prefix(stem.size() + 1);
  const std::size_t dot = name.find('.');
  if (dot == 0 || dot == std::string_view::npos || name.size() != dot + 1 + kSum) return false;
  const auto digits = name.substr(0, dot), sum = name.substr(dot + 1);
  return std::all_of(digits.begin(), digits.end(), [](unsigned char c) { return std::isdigit(c) != 0; }) &&
         std::all_of(sum.begin(), sum.end(), [](unsigned char c) { return std::isxdigit(c) != 0; });
}

/// The JSON of a GLB; nothing that is an object where it has none.
nlohmann::json json_of_glb_at(const std::string& path) {
  constexpr std::size_t kMostJson = std::size_t{64} << 20;
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return {};
  std::ifstream file(path, std::ios::binary);
  std::array<char, glb::kHeaderBytes + glb::kChunkHeaderBytes> head{};
  if (!file.read(head.data(), head.size())) return {};
  const auto word = [&](std::size_t n) {
    return load_little<std::uint32_t>(reinterpret_cast<const std::byte*>(head.data()) + n * sizeof(std::uint32_t));
  };
  if (word(0) != glb::kMagic || word(4) != glb::kJsonChunk || word(3) > kMostJson) return {};
  std::string text(word(3), '\0');
  if (!file.read(text.data(), static_cast<std::streamsize>(text.size()))) return {};
  return nlohmann::json::parse(text, nullptr, false);
}

}  // namespace

void write_glb_set(MeshBlocks& mesh, ResultFile& out, const GlbLimits& limits) {
  if (out.path().empty()) {
    throw Error(ExitCode::budget,
                fmt::format("{}: a GLB of this mesh needs further files beside it, of which a pipe or device has none; "
                            "write to a file, or a .ply",
                            out.name()));
  }
  GlbSetWriter(mesh, out, limits).write();
}

std::vector<std::string> companions_of_glb(const std::string& path) {
  std::vector<std::string> files;
  if (path.empty()) return files;
  const nlohmann::json json = json_of_glb_at(path);
  if (!json.is_object() || !json.contains("buffers") || !json["buffers"].is_array()) return files;
  const std::filesystem::path glb(path);
  for (const nlohmann::json& buffer : json["buffers"]) {
    if (!buffer.is_object() || !buffer.contains("uri") || !buffer["uri"].is_string()) continue;
    const auto name = file_of_uri(buffer["uri"].get<std::string>());
    if (name && is_companion_name(*name, glb.stem().string())) files.push_back((glb.parent_path() / *name).string());
  }
  return files;
}

std::string uri_of_file(const std::string& name) {
  constexpr std::string_view kPlain = "-._~";
  std::string uri;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    const bool letter = byte < 0x80 && std::isalnum(byte) != 0;
    if (letter || kPlain.find(c) != std::string_view::npos)
      uri += c;
    else
      uri += fmt::format("%{:02X}", byte);
  }
  return uri;
}

std::optional<std::string> file_of_uri(const std::string& uri) {
  std::string name;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] == ':' || uri[i] == '?' || uri[i] == '#') return std::nullopt;  // a scheme, a query
    if (uri[i] != '%') {
      name += uri[i];
      continue;
    }
    unsigned byte = 0;
    const char* const from = uri.data() + i + 1;
    if (i + 2 >= uri.size() || std::from_chars(from, from + 2, byte, 16).ptr != from + 2 || byte == 0)
      return std::nullopt;
    name += static_cast<char>(byte);
    i += 2;
  }
  const std::filesystem::path path(name);
  const bool leaves = std::any_of(path.begin(), path.end(), [](const auto& part) { return part == ".."; });
  if (name.empty() || path.is_absolute() || leaves || name.find('\0') != std::string::npos) return std::nullopt;
  return name;
}

}  // namespace lamina::meshes
