#include "meshes/output_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "lamina/error.h"

namespace lamina::meshes {

OutputFile::OutputFile(std::string path) : path_(std::move(path)) {
  if (path_ == "-") {
    file_ = stdout;
    return;
  }
  std::error_code ec;
  if (std::filesystem::is_directory(path_, ec))
    throw Error(ExitCode::budget, fmt::format("{}: is a directory; name a file to write", path_));
  beside_ = fmt::format("{}.part{}", path_, ::getpid());
  file_ = std::fopen(beside_.c_str(), "wbx");
  if (file_ == nullptr) fail("cannot be written");
}

OutputFile::~OutputFile() {
  if (file_ == nullptr || file_ == stdout) return;
  std::fclose(file_);
  std::remove(beside_.c_str());
}

void OutputFile::write(std::string_view bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) fail("cannot be written to its end");
}

void OutputFile::commit(const std::string& name) {
  path_ = name;
  commit();
}

void OutputFile::commit() {
  if (file_ == stdout) {
    if (std::fflush(stdout) != 0) fail("cannot be written to its end");
    return;
  }
  // A full disk may show only when the last buffer goes out.
  std::FILE* file = std::exchange(file_, nullptr);
  if (std::fclose(file) != 0 || std::rename(beside_.c_str(), path_.c_str()) != 0) {
    const int reason = errno;
    std::remove(beside_.c_str());
    errno = reason;
    fail("cannot be completed");
  }
}

void OutputFile::fail(const char* what) const {
  throw Error(ExitCode::budget,
              fmt::format("{}: {}: {}", path_ == "-" ? "standard output" : path_, what, std::strerror(errno)));
}

}  // namespace lamina::meshes
