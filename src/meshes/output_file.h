// A file that appears under its name only when complete.
#pragma once
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

namespace lamina::meshes {

/// Written beside the final name and renamed by commit(); without commit() nothing is left. "-" is standard output.
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
  [[noreturn]] void fail(const char* what) const;
  std::string path_, beside_;
  std::FILE* file_ = nullptr;
};

}  // namespace lamina::meshes
