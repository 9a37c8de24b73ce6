// Options that take one of a few words.
#pragma once
#include <CLI/CLI.hpp>
#include <map>
#include <string>

namespace lamina::tools {

/// Takes the words of `map`, whatever their case, for its values.
template <typename T>
CLI::CheckedTransformer words(const std::map<std::string, T>& map) {
  return CLI::CheckedTransformer(map, CLI::ignore_case);
}

}  // namespace lamina::tools
