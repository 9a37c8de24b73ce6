// Tells what a file is from its first bytes.
#pragma once
#include <string>
#include <string_view>

namespace lamina {

/// Returns when `start` (the first bytes of a file, a few hundred suffice) begins a PLY. Otherwise throws
/// Error(unreadable) saying what the file looks like instead and what to do about it.
void require_ply(std::string_view start, const std::string& name);

}  // namespace lamina
