// The folder that a run which can go on keeps its store and its finished parts in.
#pragma once
#include <string>

#include "base/descriptor.h"

namespace lamina {

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
