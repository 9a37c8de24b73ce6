// Errors a user can act on: one line, naming the file or option, the place and the remedy.
#pragma once
#include <stdexcept>
#include <string>

namespace lamina {

/// Exit codes of the program; every library error carries one of them.
enum class ExitCode : int {
  ok = 0,
  internal = 1,      ///< a defect of the program, or cancelled
  usage = 2,         ///< options that cannot be meant
  unreadable = 3,    ///< input missing, truncated, of another format, without what the job needs
  budget = 4,        ///< memory or disk: does not fit, or ran out; output cannot be written
  empty = 5,         ///< nothing to reconstruct: no surface came out
  check_failed = 6,  ///< `lamina check --expect`: the mesh is not what was promised
};

/// Thrown by the library; only a tool's main prints it and exits with its code.
class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] ExitCode code() const noexcept { return code_; }

 private:
  ExitCode code_;
};

}  // namespace lamina
