#include "chunk/new_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>

#include "files/descriptor.h"
#include "lamina/error.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const std::string& name, const std::string& why) {
  throw Error(ExitCode::budget, fmt::format("{}: {}", name, why));
}

}  // namespace

NewFolder::NewFolder(const std::string& name) : name_(name) {
  while (name_.size() > 1 && name_.back() == '/') name_.pop_back();
  std::error_code error;
  if (name_.empty()) refuse("the folder", "its name is empty");
  if (fs::exists(name_, error) && !(fs::is_directory(name_, error) && fs::is_empty(name_, error)))
    refuse(name_, "is there already; remove it or choose another name");
  const fs::path path(name_);
  path_ = (path.parent_path() / fmt::format(".{}.partial-{}", path.filename().string(), ::getpid())).string();
  fs::remove_all(path_, error);  // of a run that was killed and had the same number
  if (!fs::create_directory(path_, error))
    refuse(name_, fmt::format("cannot be made: {}", error ? error.message() : "it is there already"));
}

NewFolder::~NewFolder() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

void NewFolder::publish() {
  if (std::rename(path_.c_str(), name_.c_str()) != 0)
    refuse(name_, fmt::format("cannot be made: {}", system_message(errno)));
  path_.clear();
}

}  // namespace lamina
