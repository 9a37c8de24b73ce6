// A file that appears under its name only when complete.
#pragma once
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "files/output_file.h"

namespace lamina::meshes {

/// Named by commit(); without commit() nothing is left. "-" is standard output, written to at once; other pipes and
/// devices get everything at commit().
class OutputFile {
 public:
  /// Throws Error(budget) when the file cannot be made.
  explicit OutputFile(std::string path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  void write(std::string_view bytes);
  void commit();
  /// The same under another name of the same folder.
  void commit(const std::string& name);

 private:
  void close();
  [[noreturn]] void fail(const char* what) const;
  std::string path_;
  std::unique_ptr<lamina::OutputFile> staged_;  ///< null for standard output
  std::FILE* file_ = nullptr;
};

}  // namespace lamina::meshes
