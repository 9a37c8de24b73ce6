// An E57 file without its pages: each has 1020 bytes of payload and a checksum, and everything in the file but the
// places its parts name counts payload alone.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

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

}  // namespace lamina::e57
