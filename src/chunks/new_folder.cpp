#include "chunks/new_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "lamina/error.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void cannot_use(const std::string& name, const std::string& why) {
  throw Error(ExitCode::budget, fmt::format("{}: {}", name, why));
}

/// Locked for as long as the descriptor lives; empty where somebody else holds it, or the file system knows no locks.
Descriptor locked(const fs::path& folder) {
  Descriptor held(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!held || ::flock(held.get(), LOCK_EX | LOCK_NB) != 0) return {};
  return held;
}

/// Folders of killed runs to the same name: those whose lock nobody holds any more.
void remove_abandoned(const fs::path& name) {
  const std::string prefix = fmt::format(".{}.partial-", name.filename().string());
  const fs::path parent = name.has_parent_path() ? name.parent_path() : fs::path(".");
  std::error_code error;
  std::vector<fs::path> abandoned;
  for (const fs::directory_entry& entry : fs::directory_iterator(parent, error)) {
    if (entry.path().filename().string().starts_with(prefix) && locked(entry.path())) abandoned.push_back(entry.path());
  }
  for (const fs::path& folder : abandoned) fs::remove_all(folder, error);
}

}  // namespace

NewFolder::NewFolder(const std::string& name) : name_(name) {
  while (name_.size() > 1 && name_.back() == '/') name_.pop_back();
  std::error_code error;
  if (name_.empty()) cannot_use("the folder", "its name is empty");
  if (fs::exists(name_, error) && !(fs::is_directory(name_, error) && fs::is_empty(name_, error)))
    cannot_use(name_, "is there already; remove it or choose another name");
  const fs::path path(name_);
  path_ = (path.parent_path() / fmt::format(".{}.partial-{}", path.filename().string(), ::getpid())).string();
  remove_abandoned(path);
  if (!fs::create_directory(path_, error))
    cannot_use(name_, fmt::format("cannot be made: {}", error ? error.message() : "it is there already"));
  lock_ = locked(path_);
}

NewFolder::~NewFolder() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

void NewFolder::publish() {
  if (std::rename(path_.c_str(), name_.c_str()) != 0)
    cannot_use(name_, fmt::format("cannot be made: {}", system_message(errno)));
  path_.clear();
}

}  // namespace lamina
