#include "points/line_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string_view>

#include "base/read_bytes.h"
#include "lamina/error.h"

namespace lamina {
namespace {

constexpr std::size_t kLongestLine = 64 << 20;

bool is_blank(std::string_view line) {
  return line.find_first_not_of(" \t\r\v\f") == std::string_view::npos;
}

}  // namespace

LineReader::LineReader(const InputFile& file, std::uint64_t offset, std::uint64_t lines, char line_end)
    : file_(&file),
      offset_(offset),
      line_(lines),
      line_end_(line_end),
      buffer_(static_cast<std::size_t>(std::min<std::uint64_t>(kReadBytes, file.bytes + 1))) {}

bool LineReader::next(std::string_view& line) {
  while (next_of_any_kind(line)) {
    if (!is_blank(line)) return true;
  }
  return false;
}

bool LineReader::next_of_any_kind(std::string_view& line) {
  std::size_t searched = 0;
  for (;;) {
    const std::size_t size = end_ - begin_;
    const char* start = buffer_.data() + begin_;
    const void* found = std::memchr(start + searched, line_end_, size - searched);
    if (found != nullptr) {
      const auto length = static_cast<std::size_t>(static_cast<const char*>(found) - start);
      line = {start, length};
      line_offset_ = offset_ - size;
      begin_ += length + 1;
      ++line_;
      return true;
    }
    searched = size;
    if (refill()) continue;
    if (size == 0) return false;
    line = {buffer_.data() + begin_, size};  // the last line, unended
    line_offset_ = offset_ - size;
    begin_ = end_;
    ++line_;
    return true;
  }
}

/// Appends bytes of the file to the unread ones, which move to the front; false at the end of the file.
bool LineReader::refill() {
  std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
  end_ -= begin_;
  begin_ = 0;
  if (end_ == buffer_.size()) {
    if (buffer_.size() >= kLongestLine) {
      throw Error(ExitCode::unreadable, fmt::format("{}, line {}: longer than {} bytes; is this a text file?",
                                                    file_->name, line_ + 1, kLongestLine));
    }
    buffer_.resize(buffer_.size() * 2);
  }
  const std::size_t got = file_->read(offset_, buffer_.data() + end_, buffer_.size() - end_);
  if (offset_ == 0 && std::string_view(buffer_.data(), got).starts_with(kByteOrderMark)) begin_ = kByteOrderMark.size();
  offset_ += got;
  end_ += got;
  return got > 0;
}

}  // namespace lamina
