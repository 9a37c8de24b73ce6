#include "base/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>

#include "lamina/error.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const std::string& name, const std::string& why) {
  throw Error(ExitCode::budget, fmt::format("{}: cannot be written: {}", name, why));
}

/// The file a link stands for (it need not exist yet), so that the link stays and its file is replaced.
std::string follow_links(const std::string& path) {
  constexpr int kMostLinks = 40;  // the kernel's limit
  fs::path target = path;
  std::error_code error;
  for (int i = 0; i < kMostLinks && fs::is_symlink(target, error); ++i) {
    const fs::path next = fs::read_symlink(target, error);
    if (error) return path;
    target = next.is_absolute() ? next : target.parent_path() / next;
  }
  return target.string();
}

}  // namespace

OutputFile::OutputFile(const std::string& path, const std::string& tmp_dir) : name_(path), path_(follow_links(path)) {
  struct stat status {};
  const bool exists = path != "-" && ::stat(path_.c_str(), &status) == 0;
  streams_ = path == "-" || (exists && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode));
  if (path == "-") {
    name_ = "standard output";
    if (::isatty(STDOUT_FILENO) == 1) {
      throw Error(ExitCode::usage, "standard output is a terminal; name an output file or pipe it on");
    }
  }
  if (streams_) {
    directory_ = tmp_dir.empty() ? system_tmp_dir() : tmp_dir;
    unnamed_ = open_unlinked(directory_);
    return;
  }
  if (path.empty()) refuse("the output", "its name is empty");
  const fs::path final_path(path_);
  if ((exists && S_ISDIR(status.st_mode)) || !final_path.has_filename()) refuse(name_, "it is a directory");
  // Renaming would replace a write-protected file all the same.
  if (exists && ::faccessat(AT_FDCWD, path_.c_str(), W_OK, AT_EACCESS) != 0) refuse(name_, system_message(errno));
  directory_ = final_path.has_parent_path() ? final_path.parent_path().string() : ".";
  staged_ = StagedFile(path_);
  if (!staged_) {
    const int error = errno;
    std::error_code ignored;
    if (!fs::exists(directory_, ignored)) refuse(name_, fmt::format("the folder {} does not exist", directory_));
    refuse(name_, system_message(error));
  }
}

std::string OutputFile::staged() {
  if (streams_) return {};
  if (const int error = staged_.give_hidden_name(); error != 0) report_write_error(name_, error);
  return staged_.reopened();
}

void OutputFile::publish() {
  publish_as(path_);
}

void OutputFile::publish_as(const std::string& path) {
  if (const int error = staged_.publish(path); error != 0) report_write_error(name_, error);
}

Descriptor OutputFile::destination() const {
  Descriptor to(name_ == "standard output" ? ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0)
                                           : ::open(path_.c_str(), O_WRONLY | O_CLOEXEC));
  if (!to) report_write_error(name_, errno);
  return to;
}

void report_write_error(const std::string& name, int error) {
  const bool full = error == ENOSPC || error == EDQUOT;
  throw Error(ExitCode::budget, fmt::format("{}: cannot be written: {}{}", name, system_message(error),
                                            full ? "; free some space or choose another folder" : ""));
}

}  // namespace lamina
