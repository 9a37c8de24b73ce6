#include "meshes/file_stream.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "base/descriptor.h"
#include "lamina/error.h"

namespace lamina::meshes {

FileBuffer::FileBuffer(const std::string& path) : path_(path), buffer_(kReadBytes) {
  std::error_code ec;
  if (std::filesystem::is_directory(path, ec))
    throw Error(ExitCode::unreadable, fmt::format("{}: is a directory, not a mesh file", path));
  const std::string opened = path == "-" ? "/dev/stdin" : path;
  file_ = gzopen(opened.c_str(), "rb");
  if (file_ == nullptr)
    throw Error(ExitCode::unreadable, fmt::format("{}: cannot be opened: {}", path, std::strerror(errno)));
  gzbuffer(file_, kReadBytes);
  compressed_ = gzdirect(file_) == 0;
  const auto size = std::filesystem::file_size(opened, ec);
  disk_bytes_ = ec ? 0 : size;
}

FileBuffer::~FileBuffer() {
  gzclose_r(file_);
}

void FileBuffer::require_sound() const {
  if (!failure_.empty())
    throw Error(ExitCode::unreadable,
                fmt::format("{}: cannot be read to its end ({}); copy or make it again", path_, failure_));
}

FileBuffer::int_type FileBuffer::underflow() {
  if (gptr() < egptr()) return traits_type::to_int_type(*gptr());
  const int got = gzread(file_, buffer_.data(), kReadBytes);
  int code = Z_OK;
  const char* message = gzerror(file_, &code);
  if (got < 0 || code == Z_BUF_ERROR || code == Z_DATA_ERROR)
    failure_ = code == Z_ERRNO ? std::strerror(errno) : message;
  if (got <= 0) return traits_type::eof();
  setg(buffer_.data(), buffer_.data(), buffer_.data() + got);
  return traits_type::to_int_type(*gptr());
}

FileBuffer::pos_type FileBuffer::seekoff(off_type offset, std::ios_base::seekdir way, std::ios_base::openmode which) {
  const off_type here = static_cast<off_type>(gztell(file_)) - (egptr() - gptr());
  if (way == std::ios_base::end) return pos_type(off_type(-1));
  const off_type target = way == std::ios_base::cur ? here + offset : offset;
  return target == here ? pos_type(here) : seekpos(pos_type(target), which);
}

FileBuffer::pos_type FileBuffer::seekpos(pos_type position, std::ios_base::openmode) {
  setg(nullptr, nullptr, nullptr);
  gzclearerr(file_);
  const auto at = gzseek(file_, static_cast<z_off_t>(off_type(position)), SEEK_SET);
  return at < 0 ? pos_type(off_type(-1)) : pos_type(off_type(at));
}

}  // namespace lamina::meshes
