#include "base/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "lamina/error.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

/// What all hidden names for an output begin with.
std::string hidden_stem(const fs::path& path) {
  constexpr std::size_t kLongestName = 200;  // leaves room in the 255 bytes file systems allow
  return fmt::format(".{}.partial-", path.filename().string().substr(0, kLongestName));
}

std::string folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path().string() : ".";
}

/// Files that hold no lock belong to runs that were killed.
void remove_abandoned(const fs::path& path) {
  const std::string stem = hidden_stem(path);
  std::error_code error;
  fs::directory_iterator entries(folder_of(path), error);
  for (; !error && entries != fs::directory_iterator(); entries.increment(error)) {
    if (!entries->path().filename().string().starts_with(stem)) continue;
    const Descriptor file(::open(entries->path().c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    if (file && ::flock(file.get(), LOCK_EX | LOCK_NB) == 0) ::unlink(entries->path().c_str());
  }
}

/// Calls attempt(name) with hidden names until it succeeds or fails for another reason than that the name is taken.
/// Returns whether it succeeded.
template <class Attempt>
bool with_hidden_name(const fs::path& path, std::string& name, const Attempt& attempt) {
  constexpr int kTries = 1000;
  const std::string stem = fmt::format("{}{}", hidden_stem(path), ::getpid());
  for (int i = 0; i < kTries; ++i) {
    name = (path.parent_path() / (i == 0 ? stem : fmt::format("{}-{}", stem, i))).string();
    if (attempt(name)) return true;
    if (errno != EEXIST) break;
  }
  name.clear();
  return false;
}

/// A new file with a hidden name, locked.
Descriptor create_hidden(const fs::path& path, std::string& name) {
  Descriptor file;
  with_hidden_name(path, name, [&](const std::string& hidden) {
    file = Descriptor(::open(hidden.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
    if (!file) return false;
    // Before the lock was there another run may have taken the file for an abandoned one.
    struct stat status {};
    (void)::flock(file.get(), LOCK_EX);
    const bool there = ::fstat(file.get(), &status) == 0 && status.st_nlink > 0;
    if (!there) errno = EEXIST;
    return there;
  });
  if (name.empty()) file = {};
  return file;
}

bool is_unsupported(int error) {
  return error == EOPNOTSUPP || error == EISDIR || error == EINVAL || error == ENOENT;
}

std::string link_to(const Descriptor& file) {
  return fmt::format("/proc/self/fd/{}", file.get());
}

namespace fs = std::filesystem;

/// What to do about a full disk.
const char* disk_hint(int error) {
  return error == ENOSPC || error == EDQUOT ? "; free some space or choose another folder" : "";
}

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

StagedFile::StagedFile(std::string path) : path_(std::move(path)) {
  remove_abandoned(path_);
  file_ = Descriptor(::open(folder_of(path_).c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0666));
  // Giving it a name later takes /proc.
  if (file_ && ::access(link_to(file_).c_str(), F_OK) == 0) return;
  if (file_ || is_unsupported(errno)) file_ = create_hidden(path_, hidden_);
}

StagedFile::~StagedFile() {
  if (!hidden_.empty()) ::unlink(hidden_.c_str());
}

StagedFile::StagedFile(StagedFile&& other) noexcept
    : path_(std::move(other.path_)), hidden_(std::exchange(other.hidden_, {})), file_(std::move(other.file_)) {}

StagedFile& StagedFile::operator=(StagedFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(hidden_, other.hidden_);
  std::swap(file_, other.file_);
  return *this;
}

std::string StagedFile::reopened() const {
  return hidden_.empty() ? link_to(file_) : hidden_;
}

int StagedFile::give_hidden_name() {
  if (!hidden_.empty()) return 0;
  (void)::flock(file_.get(), LOCK_EX);
  const auto link = [&](const std::string& hidden) {
    return ::linkat(AT_FDCWD, link_to(file_).c_str(), AT_FDCWD, hidden.c_str(), AT_SYMLINK_FOLLOW) == 0;
  };
  if (with_hidden_name(path_, hidden_, link)) return 0;
  // Unnamed files that can never get a name are rare; the work is not lost for them.
  struct stat status {};
  if (::fstat(file_.get(), &status) != 0) return errno;
  Descriptor named = create_hidden(path_, hidden_);
  if (!named) return errno;
  if (const int error = copy_all(file_.get(), static_cast<std::uint64_t>(status.st_size), named.get()); error != 0)
    return error;
  file_ = std::move(named);
  return 0;
}

int StagedFile::publish(const std::string& path) {
  // No fsync, like cp and mv: it would hold every run for the disk. A failure that a network file system keeps for
  // close() is caught; the lock stays with the other descriptor.
  Descriptor second(::fcntl(file_.get(), F_DUPFD_CLOEXEC, 0));
  if (!second) return errno;
  if (const int error = second.close(); error != 0) return error;
  if (const int error = give_hidden_name(); error != 0) return error;
  if (std::rename(hidden_.c_str(), path.c_str()) != 0) return errno;
  hidden_.clear();
  return file_.close();
}

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

void OutputFile::complete(std::uint64_t bytes) {
  if (!streams_) return publish();
  Descriptor to = destination();
  const int copied = copy_all(fd(), bytes, to.get());
  const int closed = to.close();
  if (copied != 0 || closed != 0) report_write_error(name_, copied != 0 ? copied : closed);
}

Descriptor OutputFile::destination() const {
  Descriptor to(name_ == "standard output" ? ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0)
                                           : ::open(path_.c_str(), O_WRONLY | O_CLOEXEC));
  if (!to) report_write_error(name_, errno);
  return to;
}

void report_write_error(const std::string& name, int error) {
  throw Error(ExitCode::budget,
              fmt::format("{}: cannot be written: {}{}", name, system_message(error), disk_hint(error)));
}

ResultFile::ResultFile(std::string path, const std::string& tmp_dir) : path_(std::move(path)) {
  if (path_ == "-") {
    file_ = stdout;
    return;
  }
  staged_ = std::make_unique<OutputFile>(path_, tmp_dir);
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

std::string ResultFile::name() const {
  return path_ == "-" ? "standard output" : path_;
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
  std::vector<std::string> fresh;
  try {
    const long bytes = std::ftell(file_);
    close();
    commit_companions(fresh);
    staged_->complete(static_cast<std::uint64_t>(bytes));
  } catch (...) {
    for (const std::string& path : fresh) ::unlink(path.c_str());
    throw;
  }
  for (const std::string& path : replaced_) {
    const bool anew =
        std::any_of(companions_.begin(), companions_.end(), [&](const auto& c) { return c.path == path; });
    if (!anew) ::unlink(path.c_str());
  }
}

/// Lists those that were not there before.
void ResultFile::commit_companions(std::vector<std::string>& fresh) {
  for (const Companion& companion : companions_) {
    std::error_code ignored;
    const bool there = fs::exists(companion.path, ignored);
    companion.file->commit(companion.path);
    if (!there) fresh.push_back(companion.path);
  }
}

std::string ResultFile::path() const {
  return staged_ == nullptr || staged_->streams() ? std::string() : staged_->path();
}

ResultFile& ResultFile::add_companion() {
  companions_.push_back({std::make_unique<ResultFile>(path())});
  return *companions_.back().file;
}

void ResultFile::name_companion(const std::string& path) {
  companions_.back().path = path;
}

void ResultFile::replace_companion(const std::string& path) {
  replaced_.push_back(path);
}

void ResultFile::fail(const char* what) const {
  const int error = errno;
  throw Error(ExitCode::budget, fmt::format("{}: {}: {}{}", name(), what, system_message(error), disk_hint(error)));
}

}  // namespace lamina
