#include "keywords.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/text.h"

namespace lamina::python {
namespace {

std::string keyword_of(std::string option) {
  std::replace(option.begin(), option.end(), '-', '_');
  return option;
}

bool is_sequence(const py::handle& value) {
  const bool array = py::hasattr(value, "__array__") && py::hasattr(value, "__len__");  // and no number of NumPy's
  return py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value) || array;
}

bool is_number(const py::handle& value) {
  return PyNumber_Check(value.ptr()) != 0 && !py::isinstance<py::str>(value);
}

/// As it would be typed. A number in as many digits as it needs.
std::string word_of(const py::handle& value) {
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "yes" : "no";
  if (py::isinstance<py::str>(value)) return value.cast<std::string>();
  if (py::hasattr(value, "__fspath__")) return py::module_::import("os").attr("fspath")(value).cast<std::string>();
  if (PyIndex_Check(value.ptr()) != 0) return py::str(py::int_(py::reinterpret_borrow<py::object>(value)));
  if (is_number(value)) return py::repr(py::float_(py::reinterpret_borrow<py::object>(value)));
  throw py::type_error(fmt::format("{} is no value for an option", std::string(py::repr(value))));
}

/// Numbers with the separator between them.
std::string joined(const py::sequence& values, char separator) {
  std::string text;
  for (const py::handle value : values)
    text += (text.empty() ? std::string() : std::string(1, separator)) + word_of(value);
  return text;
}

std::vector<std::string> words_of(const py::handle& value, const CLI::Option& option) {
  if (!is_sequence(value)) return {word_of(value)};
  const char separator = option.get_type_name() == "WxH" ? 'x' : ',';
  const py::list values(py::reinterpret_borrow<py::object>(value));
  if (std::all_of(values.begin(), values.end(), [](const py::handle& v) { return is_number(v) && !is_sequence(v); }))
    return {joined(values, separator)};
  std::vector<std::string> words;
  for (const py::handle item : values)
    words.push_back(is_sequence(item) ? joined(py::list(py::reinterpret_borrow<py::object>(item)), separator)
                                      : word_of(item));
  return words;
}

}  // namespace

Keywords::Keywords(std::string function) : function_(std::move(function)), app_("", function_) {
  app_.set_help_flag();
}

void Keywords::leave_out(const std::vector<std::string>& names) {
  left_out_.insert(left_out_.end(), names.begin(), names.end());
}

bool Keywords::is_keyword(const CLI::Option& option) const {
  const std::vector<std::string>& names = option.get_lnames();
  return !names.empty() && std::none_of(names.begin(), names.end(), [this](const std::string& name) {
    return std::find(left_out_.begin(), left_out_.end(), name) != left_out_.end();
  });
}

void Keywords::parse(const py::kwargs& keywords) {
  std::vector<std::string> known;
  for (const CLI::Option* option : app_.get_options()) {
    if (!is_keyword(*option)) continue;
    for (const std::string& name : option->get_lnames()) known.push_back(keyword_of(name));
  }
  std::vector<std::string> arguments;
  for (const auto& [key, value] : keywords) {
    const auto keyword = key.cast<std::string>();
    if (std::find(known.begin(), known.end(), keyword) == known.end()) {
      const std::string near = tools::nearest_word(keyword, known);
      throw py::type_error(fmt::format("{}() got an unexpected keyword argument '{}'{}", function_, keyword,
                                       near.empty() ? "" : fmt::format("; did you mean '{}'?", near)));
    }
    if (value.is_none()) continue;
    std::string name = "--" + keyword;
    std::replace(name.begin(), name.end(), '_', '-');
    const CLI::Option* option = app_.get_option(name);
    if (option->get_expected_min() == 0) {
      if (!py::isinstance<py::bool_>(value))
        throw py::type_error(fmt::format("{}: {} must be True or False", function_, keyword));
      if (value.cast<bool>()) arguments.push_back(name);
      continue;
    }
    for (const std::string& word : words_of(value, *option)) arguments.push_back(fmt::format("{}={}", name, word));
  }
  std::reverse(arguments.begin(), arguments.end());  // as CLI11 wants them
  app_.parse(arguments);
}

void Keywords::list_in(py::module_& module) const {
  if (!py::hasattr(module, "_keywords")) module.attr("_keywords") = py::dict();
  py::list all;
  for (const CLI::Option* option : app_.get_options()) {
    if (!is_keyword(*option)) continue;
    for (const std::string& name : option->get_lnames())
      all.append(py::make_tuple(keyword_of(name), option->get_expected_min() == 0));
  }
  module.attr("_keywords")[py::str(function_)] = all;
}

std::string Keywords::describe() const {
  std::string text;
  for (const CLI::Option* option : app_.get_options()) {
    if (!is_keyword(*option)) continue;
    const bool flag = option->get_expected_min() == 0;
    const std::string type = flag ? "True or False" : option->get_type_name();
    text += fmt::format("{} : {}\n    {}\n", keyword_of(option->get_lnames().front()), type.empty() ? "value" : type,
                        option->get_description());
  }
  return text;
}

}  // namespace lamina::python
