#include "e57/page_writer.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "base/descriptor.h"
#include "e57/crc32c.h"

namespace lamina::e57 {
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
