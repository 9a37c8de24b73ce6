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
  staged_ = kind == std::filesystem::file_type::regular || kind == std::filesystem::file_type::not_found;
  open();
  if (staged_) discard();
}

ResultFile::~ResultFile() {
  discard();
}

void ResultFile::open() {
  if (staged_) beside_ = fmt::format("{}.partial-{}", path_, ::getpid());
  file_ = std::fopen(staged_ ? beside_.c_str() : path_.c_str(), "w");
  if (file_ == nullptr) refuse(errno);
}

void ResultFile::discard() {
  if (file_ != nullptr) std::fclose(std::exchange(file_, nullptr));
  if (!beside_.empty()) ::unlink(std::exchange(beside_, {}).c_str());
}

void ResultFile::write(const std::string& text) {
  if (staged_) open();
  std::FILE* out = file_ == nullptr ? stdout : file_;
  const bool written = std::fwrite(text.data(), 1, text.size(), out) == text.size() && std::fflush(out) == 0;
  if (!written) refuse(errno);
  if (file_ == nullptr) return;
  if (std::fclose(std::exchange(file_, nullptr)) != 0) refuse(errno);
  if (!staged_) return;
  if (std::rename(beside_.c_str(), path_.c_str()) != 0) refuse(errno);
  beside_.clear();
}

void ResultFile::refuse(int error) const {
  throw Error(ExitCode::budget, fmt::format("{}: cannot be written: {}", path_ == "-" ? "standard output" : path_,
                                            std::generic_category().message(error)));
}

}  // namespace lamina::tools
