#include "common/option_values.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "lamina/error.h"

namespace lamina::tools {
namespace {

std::vector<double> numbers_or_usage(const std::string& name, const std::string& text, const NumbersForm& form) {
  auto values = read_numbers(text, form.separator, form.count);
  if (!values) throw CLI::ValidationError(name, fmt::format("'{}' is not of the form {}", text, form.shown));
  return *values;
}

}  // namespace

std::optional<std::vector<double>> read_numbers(std::string_view text, char separator, std::size_t count) {
  std::vector<double> values(count);
  const char* at = text.data();
  const char* const end = at + text.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0 && (at == end || *at++ != separator)) return std::nullopt;
    const auto [rest, error] = std::from_chars(at, end, values[i]);
    if (error != std::errc{} || !std::isfinite(values[i])) return std::nullopt;
    at = rest;
  }
  if (at != end) return std::nullopt;
  return values;
}

CLI::Option* add_numbers(CLI::App& app, const std::string& name, const NumbersForm& form,
                         const std::string& description, const std::function<void(const std::vector<double>&)>& take) {
  return app
      .add_option_function<std::string>(
          name, [=](const std::string& text) { take(numbers_or_usage(name, text, form)); }, description)
      ->type_name(form.shown);
}

CLI::Option* add_repeated_numbers(CLI::App& app, const std::string& name, const NumbersForm& form,
                                  const std::string& description,
                                  const std::function<void(const std::vector<double>&)>& take) {
  return app
      .add_option_function<std::vector<std::string>>(
          name,
          [=](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) take(numbers_or_usage(name, text, form));
          },
          description)
      ->type_name(form.shown)
      ->allow_extra_args(false);
}

CLI::Option* add_number_or_auto(CLI::App& app, const std::string& name, const std::string& usual,
                                const std::string& description,
                                const std::function<void(const std::optional<double>&)>& take) {
  const auto read = [=](const std::string& text) {
    if (text == "auto") return take(std::nullopt);
    const auto number = read_numbers(text, ',', 1);
    if (!number) throw CLI::ValidationError(name, text + ": is neither a number nor auto");
    take(number->front());
  };
  return app.add_option_function<std::string>(name, read, description)->option_text("FLOAT|auto [" + usual + "]");
}

Length length_of(const std::string& option, const std::string& text) {
  try {
    return parse_length(text);
  } catch (const Error& e) {
    throw CLI::ValidationError(option, e.what());
  }
}

CLI::Option* add_length(CLI::App& app, const std::string& names, Length& value, const std::string& description) {
  const std::string shown = names.substr(names.find_last_of(',') + 1);
  return app
      .add_option_function<std::string>(
          names, [&value, shown](const std::string& text) { value = length_of(shown, text); }, description)
      ->type_name("LENGTH|Kr|KR")
      ->default_str(to_string(value));
}

CLI::Option* add_yes_no_or_auto(CLI::App& app, const std::string& name, std::optional<bool>& value,
                                const std::string& description) {
  return app
      .add_option_function<std::string>(
          name,
          [&value](const std::string& word) { value = word == "auto" ? std::nullopt : std::optional(word == "yes"); },
          description)
      ->check(CLI::IsMember({"auto", "yes", "no"}).description(""))
      ->type_name("auto|yes|no")
      ->default_str("auto");
}

std::string refuse_below_zero(const std::string& text) {
  return text.starts_with('-') ? text + ": is below 0" : "";
}

}  // namespace lamina::tools
