// Runs the built program as a user would and keeps what it said.
#pragma once
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "base/temporary_folder.h"
#include "support/paths.h"

namespace lamina::test {

struct Outcome {
  int code = -1;  ///< exit code, or 128 + signal
  std::string out, err;
};

inline std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// A word as the shell takes it literally.
inline std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

/// Runs a shell's command line; `lamina` in it is a function that runs the program.
inline Outcome run_shell(const std::string& line) {
  const TemporaryFolder folder;
  const std::string command = "lamina() { " + quoted(LAMINA_PROGRAM) + " \"$@\"; }; { " + line + "\n} </dev/null >" +
                              quoted(folder / "out") + " 2>" + quoted(folder / "err");
  const int status = std::system(command.c_str());
  Outcome outcome;
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  outcome.out = read_text(folder / "out");
  outcome.err = read_text(folder / "err");
  return outcome;
}

/// Runs `lamina` with the arguments; nothing is interpreted by a shell.
inline Outcome run_lamina(const std::vector<std::string>& arguments) {
  std::string command = "exec " + quoted(LAMINA_PROGRAM);
  for (const std::string& argument : arguments) command += " " + quoted(argument);
  return run_shell(command);
}

}  // namespace lamina::test
