#include "e57/e57.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <span>
#include <utility>

#include "base/number.h"

namespace lamina::e57 {
namespace {

constexpr std::size_t kSectionHeader = 32;
constexpr std::size_t kMostPlaces = 1 << 14;
constexpr std::uint64_t kLeastApart = 64 << 10;
constexpr std::size_t kLargestPacket = 64 << 10;

enum : unsigned { kIndexPacket = 0, kDataPacket = 1, kEmptyPacket = 2 };

}  // namespace

template <class Out>
void StreamPieces::unpack(std::size_t which, std::size_t from, std::size_t count, Out* out) const {
  const Piece& piece = pieces_[which];
  const std::uint64_t bit = piece.bit + std::uint64_t{piece.field->bits()} * from;
  e57::unpack(*piece.field, piece.bytes.data() + bit / 8, static_cast<unsigned>(bit % 8), count, out);
}

template void StreamPieces::unpack(std::size_t, std::size_t, std::size_t, float*) const;
template void StreamPieces::unpack(std::size_t, std::size_t, std::size_t, double*) const;

RecordStreams::RecordStreams(std::shared_ptr<const PagedFile> file, Scan scan)
    : file_(std::move(file)), scan_(std::move(scan)) {
  // Some writers give scans without records no section.
  if (scan_.records == 0 && scan_.section < kFileHeaderBytes) return;
  take_section();
  index_packets();
}

void RecordStreams::take_section() {
  std::array<std::byte, kSectionHeader> header{};
  if (scan_.section < kFileHeaderBytes) {
    file_->refuse(fmt::format("a scan of {} records has no place in the file", scan_.records));
  }
  file_->read(scan_.section, header);
  const auto length = load_little<std::uint64_t>(header.data() + 8);
  const std::uint64_t at = file_offset(scan_.section);
  if (std::to_integer<int>(header[0]) != 1) {
    file_->refuse(fmt::format("the section of points at byte {} has the number {}, which is not theirs (1)", at,
                              std::to_integer<int>(header[0])));
  }
  if (length > file_->size() - scan_.section) {
    file_->refuse(fmt::format("the section of points at byte {} says it has {} bytes, more than follow", at, length));
  }
  end_ = scan_.section + length;
  begin_ = payload_offset(load_little<std::uint64_t>(header.data() + 16));
  if (scan_.records == 0) {
    begin_ = end_;
  } else if (begin_ < scan_.section + kSectionHeader || begin_ > end_) {
    file_->refuse(fmt::format("the packets of the section of points at byte {} are said to lie outside of it", at));
  }
}

RecordStreams::Packet RecordStreams::packet_at(std::uint64_t offset, std::vector<std::byte>& header) const {
  header.resize(header_bytes());
  const auto start = std::span(header).first(std::min<std::uint64_t>(header.size(), end_ - offset));
  const auto damaged = [&](const std::string& what) {
    file_->refuse(fmt::format("the packet at byte {} {}: the file is damaged", file_offset(offset), what));
  };
  if (start.size() < 4) damaged("is cut short");
  file_->read(offset, start);
  const auto kind = std::to_integer<unsigned>(header[0]);
  Packet packet{offset, std::size_t{1} + load_little<std::uint16_t>(header.data() + 2), kind == kDataPacket};
  if (kind > kEmptyPacket) damaged(fmt::format("is of a kind that is not known ({})", kind));
  if (packet.bytes % 4 != 0 || packet.bytes > end_ - offset) {
    damaged(fmt::format("says it has {} bytes, which cannot be", packet.bytes));
  }
  if (!packet.has_data) return packet;
  const std::size_t streams = packet.bytes < 6 ? 0 : load_little<std::uint16_t>(header.data() + 4);
  if (packet.bytes == 8 && streams == 0) {  // data of no record
    packet.has_data = false;
    return packet;
  }
  if (streams != scan_.fields.size() || packet.bytes < header_bytes()) {
    damaged(fmt::format("has {} streams, the scan {} fields", streams, scan_.fields.size()));
  }
  std::size_t all = header_bytes();
  for (std::size_t k = 0; k < scan_.fields.size(); ++k) all += stream_bytes(header, k);
  if (all > packet.bytes) damaged(fmt::format("has streams of {} bytes in {}", all, packet.bytes));
  return packet;
}

std::size_t RecordStreams::stream_bytes(const std::vector<std::byte>& header, std::size_t stream) const {
  return load_little<std::uint16_t>(header.data() + 6 + 2 * stream);
}

void RecordStreams::index_packets() {
  std::vector<std::byte> header;
  std::vector<std::uint64_t> bytes(scan_.fields.size());
  const std::uint64_t apart = std::max(kLeastApart, (end_ - begin_) / kMostPlaces);
  for (std::uint64_t offset = begin_; offset < end_;) {
    const Packet packet = packet_at(offset, header);
    if (packet.has_data) {
      if (places_.empty() || offset - places_.back().offset >= apart) places_.push_back({offset, bytes});
      for (std::size_t k = 0; k < bytes.size(); ++k) bytes[k] += stream_bytes(header, k);
    }
    offset += packet.bytes;
  }
  require_records(bytes);
}

void RecordStreams::require_records(const std::vector<std::uint64_t>& bytes) const {
  bool any = false;
  for (std::size_t k = 0; k < bytes.size(); ++k) {
    const Field& field = scan_.fields[k];
    const std::uint64_t bits = field.bits();
    any = any || bits > 0;
    if (bits == 0 || scan_.records <= 8 * bytes[k] / bits) continue;
    file_->refuse(
        fmt::format("the scan at byte {} should have {} records, its packets hold {} values of {}: the file "
                    "is damaged",
                    file_offset(scan_.section), scan_.records, 8 * bytes[k] / bits, field.name));
  }
  // Values that are all the same take no room; somewhere there must be something.
  if (!any && scan_.records > 1) {
    file_->refuse(
        fmt::format("the scan at byte {} has {} records and no data", file_offset(scan_.section), scan_.records));
  }
}

void RecordStreams::read(std::uint64_t first, std::size_t count, const std::vector<std::size_t>& fields,
                         StreamPieces& out) const {
  out.pieces_.resize(fields.size());
  for (std::size_t i = 0; i < fields.size(); ++i) {
    StreamPieces::Piece& piece = out.pieces_[i];
    piece.field = &scan_.fields[fields[i]];
    const std::uint64_t bits = piece.field->bits();
    piece.begin = first * bits / 8;
    piece.end = ((first + count) * bits + 7) / 8;
    piece.bit = static_cast<unsigned>(first * bits % 8);
    piece.bytes.resize(static_cast<std::size_t>(piece.end - piece.begin) + kUnpackSlack);
  }
  const auto behind = [&](const Place& place) {
    for (std::size_t i = 0; i < fields.size(); ++i) {
      if (place.before[fields[i]] > out.pieces_[i].begin) return true;
    }
    return false;
  };
  // Streams grow from place to place, each: those behind are at the end of the list.
  auto place = std::partition_point(places_.begin(), places_.end(), [&](const Place& p) { return !behind(p); });
  if (place == places_.begin()) return;
  --place;
  std::vector<std::uint64_t> at = place->before;
  std::vector<std::byte> header;
  std::vector<std::byte> body(kLargestPacket);
  std::uint64_t offset = place->offset;
  for (bool all = false; !all && offset < end_;) {
    const Packet packet = packet_at(offset, header);
    offset += packet.bytes;
    if (!packet.has_data) continue;
    const auto overlap = [&](std::size_t i) {
      const StreamPieces::Piece& piece = out.pieces_[i];
      const std::uint64_t begin = std::max(piece.begin, at[fields[i]]);
      const std::uint64_t end = std::min(piece.end, at[fields[i]] + stream_bytes(header, fields[i]));
      return std::pair{begin, std::max(begin, end)};
    };
    bool some = false;
    for (std::size_t i = 0; i < fields.size(); ++i) some = some || overlap(i).first < overlap(i).second;
    if (some) file_->read(packet.offset, std::span(body).first(packet.bytes));
    std::size_t stream = header_bytes();
    std::vector<std::size_t> streams(scan_.fields.size());
    for (std::size_t k = 0; k < streams.size(); ++k) {
      streams[k] = stream;
      stream += stream_bytes(header, k);
    }
    all = true;
    for (std::size_t i = 0; i < fields.size(); ++i) {
      StreamPieces::Piece& piece = out.pieces_[i];
      const auto [begin, end] = overlap(i);
      if (begin < end) {
        std::memcpy(piece.bytes.data() + (begin - piece.begin),
                    body.data() + streams[fields[i]] + (begin - at[fields[i]]), static_cast<std::size_t>(end - begin));
      }
      all = all && end >= piece.end;
    }
    for (std::size_t k = 0; k < streams.size(); ++k) at[k] += stream_bytes(header, k);
  }
}

namespace {

/// Integers of a whole number of bytes that begin at one: as many as a compiler does at once.
template <class Word, class Out, class Value>
void unpack_words(const std::byte* bytes, std::size_t count, const Value& value, Out* out) {
  for (std::size_t i = 0; i < count; ++i) out[i] = value(load_little<Word>(bytes + i * sizeof(Word)));
}

template <class Out, class Value>
void unpack_bits(const std::byte* bytes, unsigned bit, unsigned bits, std::size_t count, const Value& value, Out* out) {
  const std::uint64_t mask = bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
  std::uint64_t at = bit;
  for (std::size_t i = 0; i < count; ++i, at += bits) {
    const std::byte* const from = bytes + at / 8;
    const auto shift = static_cast<unsigned>(at % 8);
    std::uint64_t word = load_little<std::uint64_t>(from) >> shift;
    if (shift + bits > 64) word |= std::to_integer<std::uint64_t>(from[8]) << (64 - shift);
    out[i] = value(word & mask);
  }
}

template <class Out>
void unpack_integers(const Field& field, const std::byte* bytes, unsigned bit, std::size_t count, Out* out) {
  const auto minimum = static_cast<std::uint64_t>(field.minimum);
  const double scale = field.kind == Field::Kind::scaled_integer ? field.scale : 1;
  const double offset = field.kind == Field::Kind::scaled_integer ? field.offset : 0;
  const auto value = [=](std::uint64_t above) {
    return static_cast<Out>(static_cast<double>(static_cast<std::int64_t>(minimum + above)) * scale + offset);
  };
  switch (const unsigned bits = field.bits(); bit == 0 ? bits : 1) {
    case 0:
      return void(std::fill_n(out, count, value(0)));
    case 8:
      return unpack_words<std::uint8_t>(bytes, count, value, out);
    case 16:
      return unpack_words<std::uint16_t>(bytes, count, value, out);
    case 32:
      return unpack_words<std::uint32_t>(bytes, count, value, out);
    default:
      return unpack_bits(bytes, bit, bits, count, value, out);
  }
}

}  // namespace

template <class Out>
void unpack(const Field& field, const std::byte* bytes, unsigned bit, std::size_t count, Out* out) {
  const auto as_is = [](auto v) { return static_cast<Out>(v); };
  switch (field.kind) {
    case Field::Kind::single_float:
      return unpack_words<float>(bytes, count, as_is, out);
    case Field::Kind::double_float:
      return unpack_words<double>(bytes, count, as_is, out);
    case Field::Kind::integer:
    case Field::Kind::scaled_integer:
      return unpack_integers(field, bytes, bit, count, out);
    case Field::Kind::text:
      return;
  }
}

template void unpack(const Field&, const std::byte*, unsigned, std::size_t, float*);
template void unpack(const Field&, const std::byte*, unsigned, std::size_t, double*);

}  // namespace lamina::e57
