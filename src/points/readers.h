// The readers of points, one for each format; all but VDB and ascii PLY read any rows from any thread.
#pragma once
#include <memory>
#include <string>

#include "lamina/points.h"
#include "points/input_file.h"

namespace lamina {

/// PLY of any encoding. Throws Error(unreadable).
std::unique_ptr<PointSource> open_ply(InputFile file, const std::string& path);

/// The vertices of an OBJ file: `v x y z [w | r g b | r g b a]`, and `vn` where there are as many of them and the
/// faces, if any, give every vertex its own. Throws Error(unreadable).
std::unique_ptr<PointSource> open_obj(InputFile file, const std::string& path);

/// PCD: ascii, binary, and binary_compressed, which is unpacked to a temporary file first. Packed colours (rgb, rgba)
/// become red green blue [alpha] of 8 bits. Fields of several values and integers of 64 bits are left out. Throws
/// Error(unreadable), and Error(budget) when `tmp_dir` has no room.
std::unique_ptr<PointSource> open_pcd(InputFile file, const std::string& path, const std::string& tmp_dir);

/// LAS, and LAZ of point formats 0 to 3 and 6 to 8, whose chunks are decoded as they are wanted. Attributes: intensity,
/// red green blue and nir where any point has them other than 0, and extra bytes of one value. Colours that never
/// exceed 255 are 8-bit ones in 16 bits, which some programs write, and come as such. With PointSettings::all_fields
/// also what else a record has (las_fields()), where any point has it other than 0. Of the selection it sees to the
/// octree's nodes of a COPC file.
std::unique_ptr<PointSource> open_las(InputFile file, const std::string& path, const PointSettings& settings = {});

/// PTX (Leica Cyclone's text format), organised scans with their poses. Points of all scans in the common frame; places
/// of the grid without a return (0 0 0) are left out. Values after x y z: intensity, and red green blue of 8 bits.
/// Throws Error(unreadable).
std::unique_ptr<PointSource> open_ptx(InputFile file, const std::string& path);

/// E57: the scans of the file, each in its pose. Points marked as invalid are left out, images too. Throws
/// Error(unreadable), also for a page whose checksum is wrong unless these are ignored.
std::unique_ptr<PointSource> open_e57(InputFile file, const std::string& path, bool ignore_checksums);

/// Throws Error(usage) for PointSettings::columns that cannot be meant.
void require_columns(const std::string& columns);

/// XYZ, PTS, ASC, CSV, PWN and whatever else has a point's numbers on a line. Counts the rows; `columns` as in
/// PointSettings. Throws Error(unreadable) or Error(usage).
std::unique_ptr<PointSource> open_text(InputFile file, const std::string& path, const std::string& columns);

/// OpenVDB: the file's first points grid, whole in memory: OpenVDB reads no parts of one. Attributes of types without
/// numbers are named in a remark. Throws Error(unreadable).
std::unique_ptr<PointSource> open_vdb(const std::string& path);

}  // namespace lamina
