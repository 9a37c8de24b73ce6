// Errors a user can act on: one line, naming the file or option, the place and the remedy.
#pragma once
#include <stdexcept>
#include <string>

namespace lamina {

/// Exit codes of the program. Every error of the library carries one of them.
enum class ExitCode : int {
  ok = 0,
  internal = 1,      ///< a defect of the program, or cancelled
  usage = 2,         ///< options or settings out of range, or that contradict each other
  unreadable = 3,    ///< an input that is missing, truncated, of another format or without what the job needs
  budget = 4,        ///< memory or disk does not suffice, or the output cannot be written
  empty = 5,         ///< nothing came out: no usable samples, no surface
  check_failed = 6,  ///< `lamina check --expect`: the mesh is not as expected
};

/// The only exception the library throws on purpose (std::bad_alloc aside). what() is one line for the user.
class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] ExitCode code() const noexcept { return code_; }

 private:
  ExitCode code_;
};

}  // namespace lamina
