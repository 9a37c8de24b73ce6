#include "chunks/folders.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include "base/output_file.h"
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

namespace {

constexpr const char* kDescription = "checkpoint";
constexpr const char* kLock = "lock";
constexpr std::string_view kFirstLine = "lamina checkpoint 1\n";

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw Error(ExitCode::usage, fmt::format("{}: {}", path, why));
}

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return std::move(text).str();
}

/// What a killed run was writing.
bool is_unfinished(const std::string& name) {
  return name.starts_with(".") && name.find(".partial-") != std::string::npos;
}

bool is_ours(const std::string& name) {
  return name == kDescription || name == kLock || name == "store" || is_unfinished(name) ||
         (name.starts_with("part_") && name.ends_with(".lmesh"));
}

std::vector<std::string> names_in(const std::string& path) {
  std::vector<std::string> names;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(path, error))
    names.push_back(entry.path().filename().string());
  return names;
}

std::string first_difference(const std::string& a, const std::string& b) {
  std::istringstream left(a), right(b);
  for (std::string l, r; std::getline(left, l);) {
    if (!std::getline(right, r) || l != r) return l;
  }
  return "the number of inputs";
}

}  // namespace

CheckpointFolder::CheckpointFolder(const std::string& path, const std::string& run, bool resume) : path_(path) {
  while (path_.size() > 1 && path_.back() == '/') path_.pop_back();
  std::error_code error;
  if (path_.empty()) refuse("--checkpoint", "names no folder");
  if (fs::exists(path_, error) && !fs::is_directory(path_, error)) refuse(path_, "is no folder");
  if (!fs::exists(path_, error) && !fs::create_directories(path_, error))
    throw Error(ExitCode::budget, fmt::format("{}: cannot be made: {}", path_, error.message()));
  for (const std::string& name : names_in(path_)) {
    if (!is_ours(name))
      refuse(path_, fmt::format("holds other files ({}); give --checkpoint a folder of its own", name));
  }
  lock_ = Descriptor(::open((path_ + "/" + kLock).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
  if (!lock_) throw Error(ExitCode::budget, fmt::format("{}: cannot be written: {}", path_, system_message(errno)));
  if (::flock(lock_.get(), LOCK_EX | LOCK_NB) != 0) refuse(path_, "another run is using this checkpoint");

  const std::string description = path_ + "/" + kDescription;
  const std::string text = std::string(kFirstLine) + run;
  resumed_ = fs::exists(description, error);
  if (resumed_) {
    const std::string found = read_text(description);
    if (!found.starts_with(kFirstLine))
      refuse(path_, "is the checkpoint of another version of lamina; remove it to begin anew");
    if (found != text) {
      refuse(path_, fmt::format("is the checkpoint of another run (there: {}); give the inputs and settings it was "
                                "made with, or remove it to begin anew",
                                first_difference(found, text)));
    }
    if (!resume)
      refuse(path_, "is the checkpoint of a run that did not end; add --resume to go on, or remove it to begin anew");
  }
  for (const std::string& name : names_in(path_)) {
    // Without a description nothing else counts.
    if (is_unfinished(name) || (!resumed_ && name != kLock)) fs::remove_all(path_ + "/" + name, error);
  }
  if (resumed_) return;
  OutputFile file(description, {});
  if (const int failed = write_all(file.fd(), text.data(), text.size()); failed != 0)
    report_write_error(file.name(), failed);
  file.publish();
}

std::string CheckpointFolder::part(int number) const {
  return fmt::format("{}/part_{:04}.lmesh", path_, number);
}

void CheckpointFolder::remove() {
  std::error_code ignored;
  // The description goes first: what is left, should the program be killed here, is then no checkpoint any more.
  fs::remove(path_ + "/" + kDescription, ignored);
  for (const std::string& name : names_in(path_)) {
    if (is_ours(name)) fs::remove_all(path_ + "/" + name, ignored);
  }
  fs::remove(path_, ignored);
}

}  // namespace lamina
