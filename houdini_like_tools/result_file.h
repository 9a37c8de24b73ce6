// A small text result, such as statistics: known to be writable before the work begins, there only when complete.
#pragma once
#include <cstdio>
#include <string>

namespace lamina::tools {

/// Written beside its name and renamed, all of it by write(), so that a run that is killed before leaves nothing; an
/// older file stays as it was until then.
/// "-" is standard output; pipes and devices are written to directly.
class ResultFile {
 public:
  /// Throws Error(budget) naming the path and the reason when it cannot be written.
  explicit ResultFile(std::string path);
  ~ResultFile();
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;
  /// Writes the whole text, once.
  void write(const std::string& text);

 private:
  void open();
  void discard();
  [[noreturn]] void refuse(int error) const;
  std::string path_;
  bool staged_ = false;  ///< a regular file
  std::string beside_;   ///< empty where nothing has to be removed
  std::FILE* file_ = nullptr;
};

}  // namespace lamina::tools
