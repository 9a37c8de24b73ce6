#include "chunks/checkpoint_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include "base/output_file.h"
#include "lamina/error.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

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
