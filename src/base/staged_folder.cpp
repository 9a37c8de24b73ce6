#include "base/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "lamina/error.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse_folder(const std::string& name, const std::string& why) {
  throw Error(ExitCode::budget, fmt::format("{}: {}", name, why));
}

/// What a link stands for, without a slash at the end.
fs::path folder_path(const std::string& name) {
  std::error_code error;
  // Absolute first: of a name that is not there yet the rest stays as it is, and its folder would have no name.
  fs::path path = fs::weakly_canonical(fs::absolute(name, error), error);
  if (error || path.empty()) path = fs::path(name).lexically_normal();
  return path.has_filename() ? path : path.parent_path();
}

void require_free(const fs::path& path, const std::string& name) {
  std::error_code error;
  if (!fs::exists(path, error)) return;
  if (!fs::is_directory(path, error)) refuse_folder(name, "is a file, where a folder is to be; give another name");
  const bool empty = fs::is_empty(path, error);
  if (error) refuse_folder(name, "cannot be looked into: " + error.message());
  if (!empty) refuse_folder(name, "is there and not empty; give another name, or remove it first");
}

/// Folders that hold no lock belong to runs that were killed.
void remove_abandoned_folders(const fs::path& parent, const std::string& stem) {
  std::error_code error;
  fs::directory_iterator entries(parent, error);
  for (; !error && entries != fs::directory_iterator(); entries.increment(error)) {
    if (!entries->path().filename().string().starts_with(stem)) continue;
    const Descriptor folder(::open(entries->path().c_str(), O_RDONLY | O_NOFOLLOW | O_DIRECTORY | O_CLOEXEC));
    std::error_code ignored;
    if (folder && ::flock(folder.get(), LOCK_EX | LOCK_NB) == 0) fs::remove_all(entries->path(), ignored);
  }
}

}  // namespace

StagedFolder::StagedFolder(const std::string& path) : name_(path) {
  if (path.empty() || path == "-") throw Error(ExitCode::usage, fmt::format("\"{}\": is no name of a folder", path));
  const fs::path wanted = folder_path(path);
  require_free(wanted, name_);
  path_ = wanted.string();
  const fs::path parent = wanted.parent_path();
  constexpr std::size_t kLongestName = 200;  // leaves room in the 255 bytes file systems allow
  const std::string stem = fmt::format(".{}.partial-", wanted.filename().string().substr(0, kLongestName));
  remove_abandoned_folders(parent, stem);
  constexpr int kTries = 1000;
  for (int i = 0; i < kTries; ++i) {
    const std::string hidden = (parent / fmt::format("{}{}-{}", stem, ::getpid(), i)).string();
    if (::mkdir(hidden.c_str(), 0777) == 0) {
      hidden_ = hidden;
      break;
    }
    if (errno != EEXIST) break;
  }
  if (hidden_.empty()) refuse_folder(name_, "cannot be made: " + system_message(errno));
  lock_ = Descriptor(::open(hidden_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (lock_) (void)::flock(lock_.get(), LOCK_EX | LOCK_NB);
}

StagedFolder::~StagedFolder() {
  if (hidden_.empty()) return;
  std::error_code ignored;
  fs::remove_all(hidden_, ignored);
}

void StagedFolder::write(const std::string& file, const std::string& bytes) const {
  const std::string path = hidden_ + "/" + file;
  Descriptor to(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
  if (!to) report_write_error(name_ + "/" + file, errno);
  int error = write_all(to.get(), bytes.data(), bytes.size());
  if (error == 0) error = to.close();
  if (error != 0) report_write_error(name_ + "/" + file, error);
}

void StagedFolder::make_folder(const std::string& folder) const {
  if (::mkdir((hidden_ + "/" + folder).c_str(), 0777) != 0) report_write_error(name_ + "/" + folder, errno);
}

void StagedFolder::publish() {
  if (::rename(hidden_.c_str(), path_.c_str()) != 0) {
    const int error = errno;
    if (error == ENOTEMPTY || error == EEXIST)
      refuse_folder(name_, "is no longer empty: something else was written there meanwhile");
    report_write_error(name_, error);
  }
  hidden_.clear();
  lock_ = {};
}

}  // namespace lamina
