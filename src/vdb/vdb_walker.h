// A .vdb file walked through as OpenVDB's reader will: what the checks of its parts share.
#pragma once
#include <array>
#include <cstdint>
#include <istream>
#include <string>

namespace lamina::volume {

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

}  // namespace lamina::volume
