// A file that appears under its name only when complete.
#pragma once
#include <string>

#include "files/descriptor.h"

namespace lamina {

/// Stages an output: in a hidden file beside a regular one, renamed at the end; in an unlinked file for standard output
/// ("-"), pipes and devices, streamed at the end.
class OutputFile {
 public:
  /// Throws Error(budget) naming `path` and the reason, Error(usage) when "-" is a terminal.
  OutputFile(const std::string& path, const std::string& tmp_dir);
  ~OutputFile();  ///< removes the hidden file unless published
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  [[nodiscard]] int fd() const { return file_.get(); }             ///< the staged file, open for reading and writing
  [[nodiscard]] bool streams() const { return streams_; }          ///< goes to a pipe or device at the end
  [[nodiscard]] const std::string& name() const { return name_; }  ///< for messages
  [[nodiscard]] const std::string& staged() const { return partial_; }       ///< the hidden file; empty when it streams
  [[nodiscard]] const std::string& directory() const { return directory_; }  ///< where the staged file lies

  void publish();                                ///< closes and renames; of a file that does not stream
  [[nodiscard]] Descriptor destination() const;  ///< where a streaming one goes

 private:
  std::string name_, path_, directory_, partial_;
  Descriptor file_;
  bool streams_ = false;
};

/// Throws Error(budget) "NAME: cannot be written: REASON" with a hint on a full disk.
[[noreturn]] void report_write_error(const std::string& name, int error);

}  // namespace lamina
