// What E57 files are made of (ASTM E2807): pages with checksums, the XML section, and the packets of records.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
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

// What the XML section of an E57 file says of its scans.

/// A value of every record, in a stream of its own.
struct Field {
  enum class Kind : std::uint8_t { integer, scaled_integer, single_float, double_float, text };
  std::string name;  ///< with the prefix of its extension, as in nor:normalX
  Kind kind = Kind::double_float;
  std::int64_t minimum = INT64_MIN, maximum = INT64_MAX;  ///< of integers, before they are scaled
  double scale = 1, offset = 0;                           ///< value = scale * integer + offset
  /// Of a value in the stream: as many as the largest integer above the minimum has.
  [[nodiscard]] unsigned bits() const;
};

using Limits = std::optional<std::pair<double, double>>;

struct Scan {
  std::uint64_t section = 0;  ///< payload offset of its records
  std::uint64_t records = 0;
  std::vector<Field> fields;
  bool has_pose = false;
  bool has_rotation = false;
  std::array<double, 4> rotation{1, 0, 0, 0};  ///< unit quaternion w x y z
  std::array<double, 3> translation{};
  Limits intensity;
  std::array<Limits, 3> colour;  ///< red green blue
};

struct Contents {
  std::string coordinate_metadata;  ///< the coordinate system, mostly as well-known text
  std::vector<Scan> scans;
  std::uint64_t images = 0;
};

/// Throws Error(unreadable) naming the line of the XML section where it is malformed.
Contents read_contents(const PagedFile& file);

// The records of a scan: a section of packets, each with a piece of every field's stream.

/// Pieces of some streams, as many records of each.
class StreamPieces {
 public:
  /// `count` values of the field in stream `which` (as asked for), from record `from` of these on.
  template <class Out>
  void unpack(std::size_t which, std::size_t from, std::size_t count, Out* out) const;

 private:
  friend class RecordStreams;
  struct Piece {
    const Field* field = nullptr;
    std::uint64_t begin = 0, end = 0;  ///< bytes of the stream
    unsigned bit = 0;                  ///< where the first record begins in the first byte
    std::vector<std::byte> bytes;      ///< and some behind, which mean nothing
  };
  std::vector<Piece> pieces_;
};

/// Any records from any thread: the first reading notes where packets are, every so often.
class RecordStreams {
 public:
  /// Reads the headers of the packets. Throws Error(unreadable) for packets that make no sense, and when they hold
  /// fewer records than the scan has.
  RecordStreams(std::shared_ptr<const PagedFile> file, Scan scan);
  [[nodiscard]] const Scan& scan() const { return scan_; }
  [[nodiscard]] const PagedFile& file() const { return *file_; }
  [[nodiscard]] std::uint64_t section_bytes() const { return end_ - begin_; }

  /// Pieces of the streams of those fields that hold the records [first, first + count), all of which there are.
  void read(std::uint64_t first, std::size_t count, const std::vector<std::size_t>& fields, StreamPieces& out) const;

 private:
  struct Packet {
    std::uint64_t offset = 0;  ///< in the payload
    std::size_t bytes = 0;
    bool has_data = false;
  };
  /// Where a packet is, and how much of each stream lies before it.
  struct Place {
    std::uint64_t offset = 0;
    std::vector<std::uint64_t> before;
  };

  void take_section();
  void index_packets();
  void require_records(const std::vector<std::uint64_t>& bytes) const;
  /// The packet at `offset`, the header of which is put into `header`.
  [[nodiscard]] Packet packet_at(std::uint64_t offset, std::vector<std::byte>& header) const;
  [[nodiscard]] std::size_t stream_bytes(const std::vector<std::byte>& header, std::size_t stream) const;
  [[nodiscard]] std::size_t header_bytes() const { return 6 + 2 * scan_.fields.size(); }

  std::shared_ptr<const PagedFile> file_;
  Scan scan_;
  std::uint64_t begin_ = 0, end_ = 0;  ///< the packets, in the payload
  std::vector<Place> places_;
};

// The values of a stream: floats, or integers packed without gaps, the lowest bit first.

/// How many bytes behind a stream's last may be read.
inline constexpr std::size_t kUnpackSlack = 16;

/// `count` values of a field, scaled, from those bytes on, where the first begins at bit `bit` (0 to 7).
template <class Out>
void unpack(const Field& field, const std::byte* bytes, unsigned bit, std::size_t count, Out* out);

extern template void unpack(const Field&, const std::byte*, unsigned, std::size_t, float*);
extern template void unpack(const Field&, const std::byte*, unsigned, std::size_t, double*);

}  // namespace lamina::e57
