#include "result_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "lamina/error.h"

namespace lamina::tools {

ResultFile::ResultFile(std::string path) : path_(std::move(path)) {
  if (path_ == "-") return;
  std::error_code ignored;
  const auto kind = std::filesystem::status(path_, ignored).type();
  if (kind == std::filesystem::file_type::directory) refuse(EISDIR);
  if (kind == std::filesystem::file_type::regular && ::access(path_.c_str(), W_OK) != 0) refuse(errno);
  const bool staged = kind == std::filesystem::file_type::regular || kind == std::filesystem::file_type::not_found;
  const std::string opened = staged ? fmt::format("{}.partial-{}", path_, ::getpid()) : path_;
  file_ = std::fopen(opened.c_str(), "w");
  if (file_ == nullptr) refuse(errno);
  if (staged) staged_ = opened;
}

ResultFile::~ResultFile() {
  if (file_ != nullptr) std::fclose(file_);
  if (!staged_.empty()) ::unlink(staged_.c_str());
}

void ResultFile::write(const std::string& text) {
  std::FILE* out = file_ == nullptr ? stdout : file_;
  const bool written = std::fwrite(text.data(), 1, text.size(), out) == text.size() && std::fflush(out) == 0;
  if (!written) refuse(errno);
  if (file_ == nullptr) return;
  if (std::fclose(std::exchange(file_, nullptr)) != 0) refuse(errno);
  if (staged_.empty()) return;
  if (std::rename(staged_.c_str(), path_.c_str()) != 0) refuse(errno);
  staged_.clear();
}

void ResultFile::refuse(int error) const {
  throw Error(ExitCode::budget, fmt::format("{}: cannot be written: {}", path_ == "-" ? "standard output" : path_,
                                            std::generic_category().message(error)));
}

}  // namespace lamina::tools
