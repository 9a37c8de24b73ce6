// A file on its way to its name.
#pragma once
#include <string>

#include "base/descriptor.h"

namespace lamina {

/// Has no name at all until it is published, so that nothing is left of it however the program ends; where the file
/// system knows no unnamed files, a hidden one beside its final name (.NAME.partial-PID), which a later run to the same
/// name removes once nobody holds its lock any more.
class StagedFile {
 public:
  StagedFile() = default;
  /// Holds nothing when the file cannot be made; errno says why. Removes what killed runs to the same name left behind.
  explicit StagedFile(std::string path);
  ~StagedFile();
  StagedFile(StagedFile&& other) noexcept;
  StagedFile& operator=(StagedFile&& other) noexcept;

  [[nodiscard]] explicit operator bool() const { return static_cast<bool>(file_); }
  [[nodiscard]] int fd() const { return file_.get(); }  ///< open for reading and writing
  /// A name by which this program can open the file once more.
  [[nodiscard]] std::string reopened() const;
  /// Gives it a name in the folder of the one it was made for, replacing what was there, and closes it. 0 or an errno
  /// value; then the name is untouched.
  int publish(const std::string& path);
  /// For other processes to open it by (reopened()), unless it has one. 0 or an errno value.
  int give_hidden_name();

 private:
  std::string path_, hidden_;  ///< hidden_ is empty while the file has no name
  Descriptor file_;
};

}  // namespace lamina
