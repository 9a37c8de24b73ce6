#include "e57/e57.h"

#include <fmt/format.h>
#include <nmmintrin.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <utility>

#include "base/descriptor.h"
#include "base/number.h"
#include "lamina/error.h"

namespace lamina::e57 {

PagedFile::PagedFile(FileBytes bytes, bool ignore_checksums)
    : bytes_(std::move(bytes)), ignore_checksums_(ignore_checksums), size_(bytes_.size / kPageBytes * kPagePayload) {
  if (size_ == 0) {
    refuse(fmt::format("is cut short: {} bytes, an E57 file has at least {}", bytes_.size, kPageBytes));
  }
  take_header();
}

void PagedFile::take_header() {
  std::array<std::byte, kFileHeaderBytes> header{};
  read(0, header);
  const std::byte* const at = header.data();
  const auto major = load_little<std::uint32_t>(at + 8);
  const auto minor = load_little<std::uint32_t>(at + 12);
  const auto length = load_little<std::uint64_t>(at + 16);
  const auto page = load_little<std::uint64_t>(at + 40);
  if (major != 1) refuse(fmt::format("E57 version {}.{} is not known; 1.0 is", major, minor));
  if (page != kPageBytes) refuse(fmt::format("has pages of {} bytes (at byte 40); E57 1.0 has {}", page, kPageBytes));
  if (length > bytes_.size) {
    refuse(
        fmt::format("the header says {} bytes (at byte 16), the file has {}: it was cut short", length, bytes_.size));
  }
  size_ = length / kPageBytes * kPagePayload;
  xml_ = payload_offset(load_little<std::uint64_t>(at + 24));
  xml_bytes_ = load_little<std::uint64_t>(at + 32);
  if (xml_ < kFileHeaderBytes || xml_ > size_ || xml_bytes_ > size_ - xml_) {
    refuse(
        fmt::format("the XML section ({} bytes at byte {}) does not lie in the file: its writer was stopped before "
                    "it was complete",
                    xml_bytes_, load_little<std::uint64_t>(at + 24)));
  }
}

void PagedFile::read(std::uint64_t offset, std::span<std::byte> out) const {
  if (offset > size_ || out.size() > size_ - offset) {
    refuse(fmt::format("names {} bytes at byte {}, behind its end", out.size(), file_offset(offset)));
  }
  constexpr std::size_t kPages = std::max<std::size_t>(1, kReadBytes / kPageBytes);
  std::uint64_t page = offset / kPagePayload;
  std::size_t skip = offset % kPagePayload;
  const std::size_t all = (skip + out.size() + kPagePayload - 1) / kPagePayload;
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(std::min(all, kPages) * kPageBytes);
  while (!out.empty()) {
    const std::size_t pages = std::min(kPages, (skip + out.size() + kPagePayload - 1) / kPagePayload);
    const std::size_t got = bytes_.read(page * kPageBytes, buffer.get(), pages * kPageBytes);
    if (got < pages * kPageBytes) refuse(fmt::format("ends at byte {}", page * kPageBytes + got));
    for (std::size_t i = 0; i < pages; ++i, ++page) {
      const std::byte* const at = buffer.get() + i * kPageBytes;
      if (!ignore_checksums_ && crc32c(at, kPagePayload) != load_big<std::uint32_t>(at + kPagePayload)) {
        refuse(
            fmt::format("the checksum of the page at byte {} is wrong: the file is damaged; save what is there: lamina "
                        "convert FILE --ignore-checksums -o OTHER",
                        page * kPageBytes));
      }
      const std::size_t n = std::min(kPagePayload - skip, out.size());
      std::memcpy(out.data(), at + skip, n);
      out = out.subspan(n);
      skip = 0;
    }
  }
}

void PagedFile::refuse(const std::string& what) const {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", bytes_.name, what));
}

std::uint64_t payload_offset(std::uint64_t file_offset) {
  return file_offset / kPageBytes * kPagePayload + std::min<std::uint64_t>(file_offset % kPageBytes, kPagePayload);
}

std::uint64_t file_offset(std::uint64_t payload_offset) {
  return payload_offset / kPagePayload * kPageBytes + payload_offset % kPagePayload;
}

std::uint32_t crc32c(const std::byte* data, std::size_t bytes) {
  std::uint64_t crc = 0xFFFFFFFF;
  for (; bytes >= 8; bytes -= 8, data += 8) crc = _mm_crc32_u64(crc, load_little<std::uint64_t>(data));
  auto narrow = static_cast<std::uint32_t>(crc);
  for (; bytes > 0; --bytes, ++data) narrow = _mm_crc32_u8(narrow, std::to_integer<unsigned char>(*data));
  return ~narrow;
}

namespace {

/// The checksum stands with its highest byte first.
void add_checksum(std::byte* page) {
  const std::uint32_t crc = crc32c(page, kPagePayload);
  for (unsigned k = 0; k < 4; ++k) page[kPagePayload + k] = static_cast<std::byte>(crc >> (24 - 8 * k));
}

}  // namespace

int PageWriter::append(int fd, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const std::size_t in_page = filled_ % kPagePayload;
    const std::size_t n = std::min(kPagePayload - in_page, bytes.size());
    std::memcpy(pages_.data() + filled_ / kPagePayload * kPageBytes + in_page, bytes.data(), n);
    filled_ += n;
    payload_ += n;
    bytes = bytes.subspan(n);
    if (filled_ < kPages * kPagePayload) continue;
    if (const int error = write_pages(fd); error != 0) return error;
  }
  return 0;
}

int PageWriter::finish(int fd) {
  constexpr std::array<std::byte, kPagePayload> kZeros{};
  const std::size_t over = payload_ % kPagePayload;
  if (over > 0) {
    if (const int error = append(fd, std::span(kZeros).first(kPagePayload - over)); error != 0) return error;
  }
  return filled_ > 0 ? write_pages(fd) : 0;
}

void PageWriter::put(std::size_t offset, std::span<const std::byte> bytes) {
  // In memory still, or written already.
  if (payload_ == filled_) std::memcpy(pages_.data() + offset, bytes.data(), bytes.size());
  std::memcpy(first_.data() + offset, bytes.data(), bytes.size());
}

std::string PageWriter::first_page() const {
  std::vector<std::byte> page = first_;
  add_checksum(page.data());
  return {reinterpret_cast<const char*>(page.data()), page.size()};
}

int PageWriter::write_pages(int fd) {
  if (payload_ == filled_) std::memcpy(first_.data(), pages_.data(), kPageBytes);
  const std::size_t pages = filled_ / kPagePayload;
  for (std::size_t i = 0; i < pages; ++i) {
    add_checksum(pages_.data() + i * kPageBytes);
    hash_ = (hash_ ^ crc32c(pages_.data() + i * kPageBytes, kPagePayload)) * 0x9E3779B97F4A7C15ULL;
    hash_ ^= hash_ >> 29U;
  }
  filled_ = 0;
  return write_all(fd, pages_.data(), pages * kPageBytes);
}

}  // namespace lamina::e57
