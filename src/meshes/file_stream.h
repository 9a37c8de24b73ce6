// Seekable reading of plain and gzip-compressed files through one stream buffer.
#pragma once
#include <zlib.h>

#include <istream>
#include <streambuf>
#include <string>
#include <vector>

namespace lamina::meshes {

/// zlib passes plain files through unchanged, so a reader never asks which kind it has.
class FileBuffer : public std::streambuf {
 public:
  /// "-" is standard input, which must be a file read from its beginning: a pipe cannot be read twice.
  /// Throws Error(unreadable) when `path` is missing, a directory or not permitted.
  explicit FileBuffer(const std::string& path);
  ~FileBuffer() override;
  FileBuffer(const FileBuffer&) = delete;
  FileBuffer& operator=(const FileBuffer&) = delete;

  /// Throws Error(unreadable) when decompression or the disk failed so far: a plain end of file does not look different
  /// to the formats' readers, so they must ask once they are through.
  void require_sound() const;
  /// Bytes on disk (compressed size for .gz).
  [[nodiscard]] std::uint64_t disk_bytes() const { return disk_bytes_; }
  [[nodiscard]] bool compressed() const { return compressed_; }

 protected:
  int_type underflow() override;
  pos_type seekoff(off_type offset, std::ios_base::seekdir way, std::ios_base::openmode which) override;
  pos_type seekpos(pos_type position, std::ios_base::openmode which) override;

 private:
  std::string path_;
  gzFile file_ = nullptr;
  std::vector<char> buffer_;
  std::uint64_t disk_bytes_ = 0;
  bool compressed_ = false;
  std::string failure_;
};

}  // namespace lamina::meshes
