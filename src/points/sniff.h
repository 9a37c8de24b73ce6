// Tells what a file is from its first bytes.
#pragma once
#include <string>
#include <string_view>

namespace lamina {

enum class PointFormat { ply, obj, pcd, las, ptx, e57, vdb, text };

/// The format of a file that begins with `start` (a few kilobytes suffice, unless a long comment comes first); `name`
/// decides by its ending where the content does not. Throws Error(unreadable) for what is none of them, saying what it
/// looks like instead and what to do about it.
PointFormat detect_format(std::string_view start, const std::string& name);

/// A list of scans with their poses, as Stanford's come (camera, mesh and bmesh lines).
bool is_scan_list(std::string_view start);

/// Endings of the files that a folder is searched for, lower case with the dot; ".gz" may follow.
bool has_point_ending(std::string_view name);

}  // namespace lamina
