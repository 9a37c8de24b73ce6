// A cloud that has been read once and is kept: its store, and beside it what else a sweep must know.
#pragma once
#include <string>

#include "reconstruct/stored_cloud.h"

namespace lamina {

/// Whether a folder holds a kept input.
bool is_kept_input(const std::string& directory);

/// Completes the folder that read_cloud() kept the store in. Throws Error(budget) when it cannot be written.
void save_input(const StoredCloud& input, const SurfaceSettings& settings, const std::string& directory);

/// Opens it. Throws Error(unreadable) naming the file that is damaged or of another version, Error(usage) where the
/// settings ask for another frame, other samples or other radii than the input was read with.
StoredCloud open_kept_input(const std::string& directory, const SurfaceSettings& settings);

/// A name of the kept input's contents: other samples, another frame, another name.
std::string kept_input_id(const std::string& directory);

}  // namespace lamina
