// Folders that appear under their name only when complete, and the one that a run which can go on keeps its store and
// its finished parts in.
#pragma once
#include <string>

#include "base/descriptor.h"

namespace lamina {

/// Made hidden beside the final name (.NAME.partial-PID) and locked; removed with all that is in it unless published.
/// Those that killed runs to the same name have left are removed first.
class NewFolder {
 public:
  /// Throws Error(budget) when something of that name is there that is no empty folder, or it cannot be made.
  explicit NewFolder(const std::string& name);
  ~NewFolder();
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  [[nodiscard]] const std::string& path() const { return path_; }  ///< where it is for now
  void publish();

 private:
  std::string name_, path_;
  Descriptor lock_;
};

class CheckpointFolder {
 public:
  /// Makes the folder, or enters the one there is. `run`: the settings and inputs it is for, lines of KEY VALUE.
  /// Throws Error(usage) for a folder of another run, of any run unless `resume`, with other files, or in use by
  /// another program; Error(budget) when it cannot be written.
  CheckpointFolder(const std::string& path, const std::string& run, bool resume);
  CheckpointFolder(const CheckpointFolder&) = delete;
  CheckpointFolder& operator=(const CheckpointFolder&) = delete;

  [[nodiscard]] bool resumed() const { return resumed_; }  ///< there was something
  [[nodiscard]] std::string store() const { return path_ + "/store"; }
  [[nodiscard]] std::string part(int number) const;
  [[nodiscard]] const std::string& path() const { return path_; }
  /// Removes all that belongs to it, and the folder unless the user has put something else there.
  void remove();

 private:
  std::string path_;
  Descriptor lock_;
  bool resumed_ = false;
};

}  // namespace lamina
