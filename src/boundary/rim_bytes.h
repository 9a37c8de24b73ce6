// Pieces of rims as bytes, for parts of a mesh and for other processes of the same program.
#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "boundary/rim.h"

namespace lamina::holes {

/// Appends a piece.
void pack(const RimPiece& piece, std::vector<std::byte>& out);

/// Reads all that was packed into one piece. Throws Error(unreadable) where bytes are missing.
RimPiece unpack(std::span<const std::byte> bytes);

}  // namespace lamina::holes
