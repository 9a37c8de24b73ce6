// What a file's name says it is.
#pragma once
#include <string>
#include <string_view>

namespace lamina {

/// The ending of a path's file name with its dot, A-Z in lower case: ".ply" of "scans/Lion.PLY"; empty where there is
/// none.
std::string file_ending(std::string_view path);

/// The same, but the ending before ".gz" where there is one: ".ply" of "lion.ply.gz".
std::string packed_ending(std::string_view path);

}  // namespace lamina
