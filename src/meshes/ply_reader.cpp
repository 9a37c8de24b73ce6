// PLY body: one pass in file order, element by element, value by value.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <limits>

#include "base/descriptor.h"
#include "base/number.h"
#include "lamina/error.h"
#include "meshes/formats.h"
#include "points/ply_header.h"

namespace lamina::meshes {
namespace {

/// Buffered bytes of the body; the values' decoders sit on top.
class Bytes {
 public:
  explicit Bytes(FileBuffer& file) : file_(file), buffer_(kReadBytes) {}

  /// `n` contiguous bytes, nullptr when the file ends before.
  const char* take(std::size_t n) {
    if (end_ - at_ < n && !refill(n)) return nullptr;
    const char* p = buffer_.data() + at_;
    at_ += n;
    return p;
  }
  /// Next byte without taking it, -1 at the end.
  int peek() {
    if (at_ == end_ && !refill(1)) return -1;
    return static_cast<unsigned char>(buffer_[at_]);
  }
  void skip_one() { ++at_; }

 private:
  bool refill(std::size_t n) {
    std::memmove(buffer_.data(), buffer_.data() + at_, end_ - at_);
    end_ -= at_;
    at_ = 0;
    while (end_ < n) {
      const auto got = file_.sgetn(buffer_.data() + end_, static_cast<std::streamsize>(buffer_.size() - end_));
      if (got <= 0) return false;
      end_ += static_cast<std::size_t>(got);
    }
    return true;
  }

  FileBuffer& file_;
  std::vector<char> buffer_;
  std::size_t at_ = 0, end_ = 0;
};

struct EndOfFile {};
struct NotANumber {
  std::string word;
};

class BinaryValues {
 public:
  BinaryValues(FileBuffer& file, bool swap) : bytes_(file), swap_(swap) {}
  double next(ScalarType type) {
    const char* p = bytes_.take(static_cast<std::size_t>(byte_size(type)));
    if (p == nullptr) throw EndOfFile{};
    return load_scalar(type, swap_, reinterpret_cast<const std::byte*>(p));
  }
  /// Editors like to end a file with a line break: that is not data.
  bool at_end() {
    while (bytes_.peek() == '\n' || bytes_.peek() == '\r') bytes_.skip_one();
    return bytes_.peek() < 0;
  }

 private:
  Bytes bytes_;
  bool swap_;
};

class AsciiValues {
 public:
  explicit AsciiValues(FileBuffer& file) : bytes_(file) {}
  double next(ScalarType) {
    if (at_end()) throw EndOfFile{};
    std::size_t n = 0;
    for (int c = bytes_.peek(); c > ' '; c = bytes_.peek()) {
      if (n == word_.size()) throw NotANumber{std::string(word_.data(), n)};
      word_[n++] = static_cast<char>(c);
      bytes_.skip_one();
    }
    double value = 0;
    const char* const end = word_.data() + n;
    if (parse_decimal(word_.data(), end, value) != end) throw NotANumber{std::string(word_.data(), n)};
    return value;
  }
  bool at_end() {
    for (int c = bytes_.peek(); c >= 0 && c <= ' '; c = bytes_.peek()) bytes_.skip_one();
    return bytes_.peek() < 0;
  }

 private:
  Bytes bytes_;
  std::array<char, 64> word_{};
};

template <class Values>
class BodyReader {
 public:
  BodyReader(Values values, const PlyHeader& header, FileBuffer& file, const std::string& path)
      : values_(std::move(values)), header_(header), file_(file), path_(path) {}

  TriangleMesh read() {
    for (const PlyElement& e : header_.elements) {
      try {
        row_ = 0;
        if (e.name == "vertex")
          vertices(e);
        else if (e.name == "face")
          faces(e);
        else
          skip_rows(e);
      } catch (const EndOfFile&) {
        file_.require_sound();
        fail(fmt::format("ends in {} {} of the {} its header promises: the file is cut short", e.name, row_, e.count));
      } catch (const NotANumber& bad) {
        fail(fmt::format("{} {}: \"{}\" is not a number", e.name, row_, bad.word));
      }
    }
    if (!values_.at_end()) fail("holds more data than its header promises: the header's counts are wrong");
    file_.require_sound();
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t)
      for (const auto v : mesh_.triangles[t])
        if (v >= mesh_.positions.size())
          fail(fmt::format("a face names vertex {} but there are {} (triangle {})", v, mesh_.positions.size(), t));
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ExitCode::unreadable, fmt::format("{}: {}", path_, what));
  }

  /// A header that lies must not make us reserve what the file cannot hold.
  [[nodiscard]] std::size_t believable(std::uint64_t count) const {
    const std::uint64_t most = file_.compressed() ? std::uint64_t{1} << 22 : file_.disk_bytes();
    return static_cast<std::size_t>(std::min(count, most));
  }

  void skip_rows(const PlyElement& e) {
    // Rows without properties take no bytes: the file's end would never stop us.
    if (e.properties.empty()) return;
    for (; row_ < e.count; ++row_)
      for (const PlyProperty& p : e.properties) skip(p);
  }
  void skip(const PlyProperty& p) {
    if (!p.list_count) {
      values_.next(p.type);
      return;
    }
    const double n = values_.next(*p.list_count);
    for (double i = 0; i < n; ++i) values_.next(p.type);
  }

  void vertices(const PlyElement& e) {
    const auto x = e.find("x"), y = e.find("y"), z = e.find("z");
    if (!x || !y || !z) fail("its vertices have no x y z");
    if (e.count >= std::numeric_limits<std::uint32_t>::max())
      fail(fmt::format("{} vertices are too many for a mesh in memory", e.count));
    const auto nx = e.find("nx"), ny = e.find("ny"), nz = e.find("nz");
    const bool normals = nx && ny && nz;
    // Where each property goes: 0-2 position, 3-5 normal, 6.. attribute, -1 nowhere.
    std::vector<int> target(e.properties.size(), -1);
    for (std::size_t i = 0; i < e.properties.size(); ++i) {
      const auto is = [&](const std::optional<std::size_t>& column) { return column && *column == i; };
      if (is(x) || is(y) || is(z)) {
        target[i] = is(x) ? 0 : is(y) ? 1 : 2;
      } else if (normals && (is(nx) || is(ny) || is(nz))) {
        target[i] = is(nx) ? 3 : is(ny) ? 4 : 5;
      } else if (!e.properties[i].list_count) {
        target[i] = 6 + static_cast<int>(mesh_.layout.size());
        mesh_.layout.push_back({e.properties[i].name, e.properties[i].type});
      }
    }
    mesh_.attributes.resize(mesh_.layout.size());
    mesh_.positions.reserve(believable(e.count));
    if (normals) mesh_.normals.reserve(believable(e.count));
    for (auto& a : mesh_.attributes) a.reserve(believable(e.count));
    for (; row_ < e.count; ++row_) {
      std::array<double, 6> fixed{};
      for (std::size_t i = 0; i < target.size(); ++i) {
        const PlyProperty& p = e.properties[i];
        if (target[i] < 0)
          skip(p);
        else if (target[i] < 6)
          fixed[static_cast<std::size_t>(target[i])] = values_.next(p.type);
        else
          mesh_.attributes[static_cast<std::size_t>(target[i]) - 6].push_back(static_cast<float>(values_.next(p.type)));
      }
      mesh_.positions.push_back({fixed[0], fixed[1], fixed[2]});
      if (normals)
        mesh_.normals.push_back(
            {static_cast<float>(fixed[3]), static_cast<float>(fixed[4]), static_cast<float>(fixed[5])});
    }
  }

  void faces(const PlyElement& e) {
    auto list = e.find("vertex_indices");
    if (!list) list = e.find("vertex_index");
    if (!list || !e.properties[*list].list_count) fail("its faces have no list vertex_indices");
    mesh_.triangles.reserve(believable(e.count));
    for (; row_ < e.count; ++row_)
      for (std::size_t i = 0; i < e.properties.size(); ++i) {
        if (i == *list)
          polygon(e.properties[i]);
        else
          skip(e.properties[i]);
      }
  }

  void polygon(const PlyProperty& p) {
    const double n = values_.next(*p.list_count);
    if (n < 3) fail(fmt::format("face {} has {} corners; a polygon needs three", row_, n));
    const std::uint32_t first = index(p), second = index(p);
    std::uint32_t last = second;
    for (double i = 2; i < n; ++i) {
      const std::uint32_t next = index(p);
      mesh_.triangles.push_back({first, last, next});
      last = next;
    }
  }

  std::uint32_t index(const PlyProperty& p) {
    const double v = values_.next(p.type);
    if (!(v >= 0) || v >= 4294967295.0 || v != static_cast<double>(static_cast<std::uint32_t>(v)))
      fail(fmt::format("face {}: {} is not a vertex number", row_, v));
    return static_cast<std::uint32_t>(v);
  }

  Values values_;
  const PlyHeader& header_;
  FileBuffer& file_;
  const std::string& path_;
  TriangleMesh mesh_;
  std::uint64_t row_ = 0;
};

}  // namespace

TriangleMesh read_ply(FileBuffer& file, const std::string& path) {
  const PlyHeader header = read_ply_header(file, path);
  if (std::none_of(header.elements.begin(), header.elements.end(), [](const auto& e) { return e.name == "vertex"; }))
    throw Error(ExitCode::unreadable, fmt::format("{}: has no element vertex", path));
  if (header.format == PlyFormat::ascii) return BodyReader<AsciiValues>(AsciiValues(file), header, file, path).read();
  const bool swap = (header.format == PlyFormat::big_endian) == (std::endian::native == std::endian::little);
  return BodyReader<BinaryValues>(BinaryValues(file, swap), header, file, path).read();
}

}  // namespace lamina::meshes
