#include "base/result_file.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "lamina/error.h"

namespace lamina {

ResultFile::ResultFile(std::string path) : path_(std::move(path)) {
  if (path_ == "-") {
    file_ = stdout;
    return;
  }
  staged_ = std::make_unique<OutputFile>(path_, std::string{});
  Descriptor second(::fcntl(staged_->fd(), F_DUPFD_CLOEXEC, 0));
  file_ = second ? ::fdopen(second.get(), "wb") : nullptr;
  if (file_ == nullptr) fail("cannot be written");
  (void)second.release();
}

ResultFile::~ResultFile() {
  if (file_ != nullptr && file_ != stdout) std::fclose(file_);
}

void ResultFile::write(std::string_view bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) fail("cannot be written to its end");
}

void ResultFile::close() {
  // A full disk may show only when the last buffer goes out.
  if (std::fclose(std::exchange(file_, nullptr)) != 0) fail("cannot be completed");
}

void ResultFile::commit(const std::string& name) {
  path_ = name;
  close();
  staged_->publish_as(name);
}

void ResultFile::commit() {
  if (file_ == stdout) {
    if (std::fflush(stdout) != 0) fail("cannot be written to its end");
    return;
  }
  if (!staged_->streams()) {
    close();
    return staged_->publish();
  }
  const long bytes = std::ftell(file_);
  close();
  Descriptor to = staged_->destination();
  const int copied = copy_all(staged_->fd(), static_cast<std::uint64_t>(bytes), to.get());
  const int closed = to.close();
  if (copied != 0 || closed != 0) report_write_error(path_, copied != 0 ? copied : closed);
}

void ResultFile::fail(const char* what) const {
  throw Error(ExitCode::budget,
              fmt::format("{}: {}: {}", path_ == "-" ? "standard output" : path_, what, std::strerror(errno)));
}

}  // namespace lamina
