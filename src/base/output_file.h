// A file that appears under its name only when complete.
#pragma once
#include <string>

#include "base/descriptor.h"
#include "base/staged_file.h"

namespace lamina {

/// Stages an output: a regular one in its own folder, named at the end (StagedFile); standard output ("-"), pipes and
/// devices in an unlinked file, streamed at the end.
class OutputFile {
 public:
  /// Throws Error(budget) naming `path` and the reason, Error(usage) when "-" is a terminal.
  OutputFile(const std::string& path, const std::string& tmp_dir);
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// The staged file, open for reading and writing.
  [[nodiscard]] int fd() const { return streams_ ? unnamed_.get() : staged_.fd(); }
  [[nodiscard]] bool streams() const { return streams_; }          ///< goes to a pipe or device at the end
  [[nodiscard]] const std::string& name() const { return name_; }  ///< for messages
  /// A hidden name by which other processes can open the staged file; empty when it streams. Throws Error(budget).
  [[nodiscard]] std::string staged();
  [[nodiscard]] const std::string& directory() const { return directory_; }  ///< where the staged file lies

  void publish();  ///< gives a file that does not stream its name; throws Error(budget) when that fails
  void publish_as(const std::string& path);      ///< the same under another name of the same folder
  [[nodiscard]] Descriptor destination() const;  ///< where a streaming one goes

 private:
  std::string name_, path_, directory_;
  StagedFile staged_;
  Descriptor unnamed_;
  bool streams_ = false;
};

/// Throws Error(budget) "NAME: cannot be written: REASON" with a hint on a full disk.
[[noreturn]] void report_write_error(const std::string& name, int error);

}  // namespace lamina
