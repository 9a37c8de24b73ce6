// Names of files that load as the frames of a sequence.
#pragma once
#include <cstddef>
#include <string>

namespace lamina::volume {

/// out.vdb, 3 -> out.0003.vdb
std::string numbered(const std::string& path, std::size_t number);

}  // namespace lamina::volume
