// Payload cut into E57's pages, each with its checksum.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "e57/paged_file.h"

namespace lamina::e57 {

/// Writes to a file from its beginning on. The first page can be changed until the end: it is written as it is then by
/// whoever finishes the file. Functions return 0 or an errno value.
class PageWriter {
 public:
  [[nodiscard]] std::uint64_t payload() const { return payload_; }  ///< bytes so far
  [[nodiscard]] std::uint64_t pages() const { return (payload_ + kPagePayload - 1) / kPagePayload; }
  int append(int fd, std::span<const std::byte> bytes);
  int finish(int fd);  ///< fills the last page up with zeros

  /// Changes bytes of the first page.
  void put(std::size_t offset, std::span<const std::byte> bytes);
  /// The first page with its checksum, once all is finished.
  [[nodiscard]] std::string first_page() const;
  /// Of all pages written so far.
  [[nodiscard]] std::uint64_t hash() const { return hash_; }

 private:
  static constexpr std::size_t kPages = 128;  ///< written at once
  int write_pages(int fd);

  std::vector<std::byte> pages_ = std::vector<std::byte>(kPages * kPageBytes),
                         first_ = std::vector<std::byte>(kPageBytes);
  std::size_t filled_ = 0;  ///< payload bytes in `pages_`
  std::uint64_t payload_ = 0, hash_ = 0;
};

}  // namespace lamina::e57
