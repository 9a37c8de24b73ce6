// An E57 file without its pages, read and written: each has 1020 bytes of payload and a checksum, and everything in the
// file but the places its parts name counts payload alone.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace lamina::e57 {

inline constexpr std::size_t kPageBytes = 1024;
inline constexpr std::size_t kPagePayload = 1020;
inline constexpr std::size_t kFileHeaderBytes = 48;

/// A file, whoever opened it.
struct FileBytes {
  /// Fills `data` from `offset` on; fewer bytes only at the end of the file. From any thread.
  std::function<std::size_t(std::uint64_t offset, void* data, std::size_t size)> read;
  std::uint64_t size = 0;
  std::string name;  ///< for messages
};

/// Reads from any thread. Throws Error(unreadable) naming file and page for a page whose checksum is wrong, unless
/// these are ignored.
class PagedFile {
 public:
  /// Throws Error(unreadable) for a header that makes no sense, and a file shorter than its header says.
  PagedFile(FileBytes bytes, bool ignore_checksums);
  [[nodiscard]] const std::string& name() const { return bytes_.name; }
  [[nodiscard]] std::uint64_t size() const { return size_; }  ///< payload bytes
  /// The XML section, which says what else there is.
  [[nodiscard]] std::uint64_t xml() const { return xml_; }
  [[nodiscard]] std::uint64_t xml_bytes() const { return xml_bytes_; }

  /// Fills `out` with the payload from `offset` on. Throws Error(unreadable) when the file ends before.
  void read(std::uint64_t offset, std::span<std::byte> out) const;

  /// Throws Error(unreadable): "FILE: `what`".
  [[noreturn]] void refuse(const std::string& what) const;

 private:
  void take_header();

  FileBytes bytes_;
  bool ignore_checksums_;
  std::uint64_t size_ = 0, xml_ = 0, xml_bytes_ = 0;
};

/// Where in the payload the byte at an offset of the file is; what points into a checksum means the page behind it.
std::uint64_t payload_offset(std::uint64_t file_offset);
/// The other way.
std::uint64_t file_offset(std::uint64_t payload_offset);

// CRC-32C, the checksum of E57's pages.

/// Castagnoli's polynomial, as iSCSI has it.
std::uint32_t crc32c(const std::byte* data, std::size_t bytes);

// Payload cut into E57's pages, each with its checksum.

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
