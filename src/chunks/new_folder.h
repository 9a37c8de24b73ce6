// A folder that appears under its name only when complete.
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

}  // namespace lamina
