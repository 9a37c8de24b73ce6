// Whether a .vdb file's lengths are true, before OpenVDB believes them.
#pragma once
#include <array>
#include <cstdint>
#include <istream>
#include <string>

namespace lamina::volume {

/// Walks through the file as OpenVDB's reader will: every length must fit into the file and every compressed piece must
/// hold as many bytes as its node wants, where the reader would run over the end of its arrays. Values are not
/// looked at; of grids of types that OpenVDB does not come with only what precedes the tree is. Throws
/// std::runtime_error saying what is wrong, std::ios::failure where the file ends too early. The stream has exceptions
/// on, stands at the file's beginning, and stands there again afterwards.
void check_vdb(std::istream& file);

/// Throws std::runtime_error.
[[noreturn]] void wrong(const std::string& what);

/// Reads forward, never past the end: throws std::ios::failure there, as the stream does.
class Walker {
 public:
  explicit Walker(std::istream& file) : file_(file) {
    file_.seekg(0, std::ios::end);
    left_ = static_cast<std::uint64_t>(file_.tellg());
    size_ = left_;
    file_.seekg(0);
  }
  void skip(std::uint64_t bytes) {
    take(bytes);
    // Seeking throws the stream's buffer away.
    std::array<char, 4096> unused;
    if (bytes <= unused.size())
      file_.read(unused.data(), static_cast<std::streamsize>(bytes));
    else
      file_.seekg(static_cast<std::streamoff>(bytes), std::ios::cur);
  }
  void read(void* to, std::uint64_t bytes) {
    take(bytes);
    file_.read(static_cast<char*>(to), static_cast<std::streamsize>(bytes));
  }
  template <class T>
  T number() {
    T value{};
    read(&value, sizeof value);
    return value;
  }
  std::string text();
  void go_to(std::int64_t place);
  [[nodiscard]] std::uint64_t left() const { return left_; }

 private:
  void take(std::uint64_t bytes) {
    if (bytes > left_) throw std::ios::failure("the end");
    left_ -= bytes;
  }
  std::istream& file_;
  std::uint64_t left_ = 0, size_ = 0;
};

/// A compressed piece of so many bytes, which must be sound; returns the size of what is in it.
std::uint64_t check_blosc(Walker& w, std::uint64_t bytes);
/// The same for a piece that is unpacked to see whether it can be.
std::uint64_t unpack_blosc(Walker& w, std::uint64_t bytes);
/// Whether a piece of so many bytes is that of an array: short ones are filled up before they are compressed.
bool holds(std::uint64_t unpacked, std::uint64_t bytes);

/// OpenVDB reads metadata by its type, whatever length stands before it. Returns whether it says that values are saved
/// with 16 bits.
bool check_metadata(Walker& w);

/// Walks through the passes in which OpenVDB writes the attributes of so many leaves, from behind the tree's topology
/// to the grid's end: arrays must be as long as they say, pages must hold what is taken out of them, and compressed
/// pieces must be sound. Throws as check_vdb() does. `version` of the file.
void check_points(Walker& w, std::uint64_t leaves, std::uint32_t version);

}  // namespace lamina::volume
