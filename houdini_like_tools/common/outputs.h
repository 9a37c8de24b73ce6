// The files that the tools write: options, names that promise another format, and small text results.
#pragma once
#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>
#include <string_view>

#include "lamina/points.h"
#include "lamina/tiles.h"
#include "lamina/volume_tools.h"

namespace lamina::tools {

/// INPUT and -o, --output, both required; `formats` says what they can be.
void add_files(CLI::App& app, std::string& input, const std::string& input_formats, std::string& output,
               const std::string& output_formats);

/// How positions are written.
enum class Precision { automatic, single_precision, double_precision };

/// --precision auto|float|double, in the group "Output".
void add_precision(CLI::App& app, Precision& precision);
/// The columns with their positions in the precision asked for.
PointColumns with_precision(PointColumns columns, Precision precision);

/// "kept 2 grids of 1.2 M voxels and 300 points, 4.5 MB".
std::string volume_text(std::string_view verb, const VolumeEditStats& stats);

/// "1 234 tiles of 4 levels, 130 M triangles at the finest, 12.3 MB".
std::string tiles_text(const TileStats& stats);

// Each throws Error(usage) for a name such as "mesh.usd" that promises another format, with the way to what was meant.
// Names that promise nothing ("-", "out", "mesh.tmp") will do.

/// Reconstructed meshes: PLY, OBJ, OFF, STL, GLB.
void require_mesh_name(const std::string& output);
/// OpenVDB files.
void require_volume_name(const std::string& output);
/// PNG.
void require_picture_name(const std::string& output);

/// A small text result, such as statistics: known to be writable before the work begins, there only when complete.
/// Written beside its name and renamed, all of it by write(), so that a run that is killed before leaves nothing; an
/// older file stays as it was until then.
/// "-" is standard output; pipes and devices are written to directly.
class ResultFile {
 public:
  /// Throws Error(budget) naming the path and the reason when it cannot be written.
  explicit ResultFile(std::string path);
  ~ResultFile();
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;
  /// Writes the whole text, once.
  void write(const std::string& text);

 private:
  void open();
  void discard();
  [[noreturn]] void refuse(int error) const;
  std::string path_;
  bool staged_ = false;  ///< a regular file
  std::string beside_;   ///< empty where nothing has to be removed
  std::FILE* file_ = nullptr;
};

}  // namespace lamina::tools
