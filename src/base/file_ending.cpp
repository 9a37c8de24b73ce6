#include "lamina/file_ending.h"

#include <algorithm>
#include <filesystem>

namespace lamina {
namespace {

// Not of the locale: a Turkish one has other small letters.
char small(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

}  // namespace

std::string file_ending(std::string_view path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), small);
  return ending;
}

std::string packed_ending(std::string_view path) {
  std::string ending = file_ending(path);
  return ending == ".gz" ? file_ending(path.substr(0, path.size() - ending.size())) : ending;
}

}  // namespace lamina
