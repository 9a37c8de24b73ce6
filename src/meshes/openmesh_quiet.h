// Keeps OpenMesh's own messages off the terminal.
#pragma once
#include <mutex>

namespace lamina::meshes {

/// OpenMesh reports on streams of its own; what went wrong reaches the user as our one line instead. Its readers and
/// writers keep their state in singletons, so this also lets one thread in at a time.
class QuietOpenMesh {
 public:
  QuietOpenMesh();
  ~QuietOpenMesh();
  QuietOpenMesh(const QuietOpenMesh&) = delete;
  QuietOpenMesh& operator=(const QuietOpenMesh&) = delete;

 private:
  std::lock_guard<std::mutex> lock_;
};

}  // namespace lamina::meshes
