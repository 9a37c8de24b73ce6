// A .vdb file's tag, a UUID, made from the contents: equal grids give equal bytes.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace lamina::volume {

/// The tag, a UUID in text, stands behind magic number, three version numbers and a flag.
inline constexpr std::size_t kTagAt = 8 + 3 * 4 + 1;
inline constexpr std::size_t kTagSize = 36;

/// Takes the file in pieces of any size, its tag as zeros.
class ContentTag {
 public:
  void add(std::string_view bytes);
  [[nodiscard]] std::string text() const;

 private:
  void mix(std::uint64_t word);

  std::uint64_t a_ = 0xcbf29ce484222325ULL, b_ = 0x84222325cbf29ce4ULL;
  std::uint64_t word_ = 0;    ///< bytes that make no eight yet
  std::uint64_t length_ = 0;  ///< of all pieces
};

}  // namespace lamina::volume
