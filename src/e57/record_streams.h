// The records of a scan: a section of packets, each with a piece of every field's stream.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "e57/contents.h"
#include "e57/paged_file.h"

namespace lamina::e57 {

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
