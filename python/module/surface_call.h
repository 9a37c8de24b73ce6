// What the functions that reconstruct have in common: the options of `lamina surface`, and points.
#pragma once
#include <string>
#include <vector>

#include "arrays.h"
#include "keywords.h"
#include "lamina/chunk.h"
#include "lamina/run.h"
#include "lamina/surface.h"
#include "surface.h"

namespace lamina::python {

class SurfaceCall {
 public:
  /// Parses the keywords; `without`: options that the function does not have.
  SurfaceCall(const std::string& function, const std::vector<std::string>& without, const py::kwargs& keywords);
  /// The options that a mesh in memory does not have.
  static std::vector<std::string> in_memory();
  [[nodiscard]] const tools::RunOptions& run_options() const { return options_.run; }
  [[nodiscard]] const Checkpoint& checkpoint() const { return options_.parts.checkpoint; }
  /// The settings for this input, which must outlive the run; once. Needs no lock of the interpreter.
  SurfaceSettings settings(const PointArguments& input, const RunContext& context);
  /// The same for points that have no files.
  SurfaceSettings settings(const RunContext& context);
  /// Keywords::describe().
  [[nodiscard]] std::string describe() const { return words_.describe(); }
  void list_in(py::module_& module) const { words_.list_in(module); }

 private:
  Keywords words_;
  tools::SurfaceOptions options_;
};

}  // namespace lamina::python
