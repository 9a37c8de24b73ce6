// A file that appears under its name only when complete.
#pragma once
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "base/output_file.h"

namespace lamina {

/// Named by commit(); without commit() nothing is left. "-" is standard output, written to at once; other pipes and
/// devices get everything at commit().
class ResultFile {
 public:
  /// Throws Error(budget) when the file cannot be made.
  explicit ResultFile(std::string path);
  ~ResultFile();
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;
  void write(std::string_view bytes);
  void commit();
  /// The same under another name of the same folder.
  void commit(const std::string& name);

 private:
  void close();
  [[noreturn]] void fail(const char* what) const;
  std::string path_;
  std::unique_ptr<OutputFile> staged_;  ///< null for standard output
  std::FILE* file_ = nullptr;
};

}  // namespace lamina
