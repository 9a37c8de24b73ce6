// Folders that appear under their name only when complete.
#pragma once
#include <string>

#include "base/descriptor.h"

namespace lamina {

/// A folder on its way to its name: a hidden one beside it (.NAME.partial-PID), which a later run to the same name
/// removes if this one is killed.
class StagedFolder {
 public:
  /// Throws Error(budget) naming `path` and the reason when it is there and not an empty folder, or cannot be made.
  explicit StagedFolder(const std::string& path);
  ~StagedFolder();  ///< without publish(): removes it
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  [[nodiscard]] const std::string& hidden() const { return hidden_; }  ///< where its files are to be made meanwhile
  [[nodiscard]] const std::string& name() const { return name_; }      ///< for messages
  /// A whole file in it; `file` may begin with the name of a folder that was made. Throws Error(budget).
  void write(const std::string& file, const std::string& bytes) const;
  /// A folder in it. Throws Error(budget).
  void make_folder(const std::string& folder) const;
  /// Gives it its name. Throws Error(budget) when that fails.
  void publish();

 private:
  std::string name_, path_, hidden_;
  Descriptor lock_;
};

}  // namespace lamina
