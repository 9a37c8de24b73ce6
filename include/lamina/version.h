// The version of the library, as written into the files it makes.
#pragma once
#include <string_view>

namespace lamina {

/// "major.minor.patch"; the view ends with a null character.
std::string_view version();

}  // namespace lamina
