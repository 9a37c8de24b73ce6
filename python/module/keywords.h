// Keywords of a Python function: the options of the program's tool, by their names, from its own tables.
#pragma once
#include <pybind11/pybind11.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace lamina::python {

namespace py = pybind11;

class Keywords {
 public:
  /// `function`: its name, for messages.
  explicit Keywords(std::string function);

  /// Where the options are to be added. Those that are nothing in Python are left out: --help, --quiet, --json,
  /// --print-job.
  CLI::App& app() { return app_; }
  /// So are these.
  void leave_out(const std::vector<std::string>& names);

  /// Gives the options their values: numbers, words, lengths and paths as on the command line, True for a flag, a
  /// sequence of numbers where the command line has them with separators, a sequence of others for an option given
  /// several times. None is as if not given. Throws TypeError for a keyword that is no option's, CLI::ParseError for a
  /// value that it does not take.
  void parse(const py::kwargs& keywords);

  /// A paragraph for each keyword, for a docstring.
  [[nodiscard]] std::string describe() const;
  /// Their names, with whether they are flags, into the module's dict `_keywords`, from which its stubs are made.
  void list_in(py::module_& module) const;

 private:
  [[nodiscard]] bool is_keyword(const CLI::Option& option) const;

  std::string function_;
  std::vector<std::string> left_out_{"help", "quiet", "json", "print-job"};
  CLI::App app_;
};

}  // namespace lamina::python
