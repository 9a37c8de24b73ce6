// Files that appear under their name only when complete.
#pragma once
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/descriptor.h"

namespace lamina {

/// A file on its way to its name. Has no name at all until it is published, so that nothing is left of it however the
/// program ends; where the file system knows no unnamed files, a hidden one beside its final name (.NAME.partial-PID),
/// which a later run to the same name removes once nobody holds its lock any more.
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
  [[nodiscard]] const std::string& path() const { return path_; }            ///< of the file, links followed

  void publish();  ///< gives a file that does not stream its name; throws Error(budget) when that fails
  /// publish(); of a file that streams, sends its first `bytes` on. Throws Error(budget).
  void complete(std::uint64_t bytes);
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

/// An output written from its beginning to its end. Named by commit(); without commit() nothing is left. "-" is
/// standard output, written to at once; other pipes and devices get everything at commit().
class ResultFile {
 public:
  /// `tmp_dir`: as OutputFile. Throws Error(budget) when the file cannot be made.
  explicit ResultFile(std::string path, const std::string& tmp_dir = {});
  ~ResultFile();
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;
  void write(std::string_view bytes);
  [[nodiscard]] std::string name() const;  ///< for messages
  /// Its place in the file system, links followed; empty where it is a pipe or device.
  [[nodiscard]] std::string path() const;

  /// A further file of the same output, in the same folder; of one that has a path().
  ResultFile& add_companion();
  /// The name (a path in that folder) that the last one appears under when this file does, just before it.
  void name_companion(const std::string& path);
  /// A file that goes when this one has appeared, unless a companion has its name: of an older output.
  void replace_companion(const std::string& path);

  void commit();
  /// The same under another name of the same folder.
  void commit(const std::string& name);

 private:
  struct Companion {
    std::unique_ptr<ResultFile> file;
    std::string path{};
  };
  void close();
  void commit_companions(std::vector<std::string>& fresh);
  [[noreturn]] void fail(const char* what) const;

  std::string path_;
  std::vector<Companion> companions_;
  std::vector<std::string> replaced_;
  std::unique_ptr<OutputFile> staged_;  ///< null for standard output
  std::FILE* file_ = nullptr;
};

// Folders that appear under their name only when complete.

/// A folder on its way to its name: a hidden one beside it (.NAME.partial-PID), which a later run to the same name
/// removes if this one is killed.
class StagedFolder {
 public:
  /// Throws Error(budget) naming `path` and the reason when it is there and not an empty folder, or cannot be made.
  explicit StagedFolder(const std::string& path);
  ~StagedFolder();  ///< without publish(): removes it
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  [[nodiscard]] const std::string& hidden() const { return hidden_; }  ///< where its files are to be made meanwhile
  [[nodiscard]] const std::string& name() const { return name_; }      ///< for messages
  /// A whole file in it; `file` may begin with the name of a folder that was made. Throws Error(budget).
  void write(const std::string& file, const std::string& bytes) const;
  /// A folder in it. Throws Error(budget).
  void make_folder(const std::string& folder) const;
  /// Gives it its name. Throws Error(budget) when that fails.
  void publish();

 private:
  std::string name_, path_, hidden_;
  Descriptor lock_;
};

}  // namespace lamina
