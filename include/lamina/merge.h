// Several clouds or meshes as one.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "lamina/edit_points.h"
#include "lamina/mesh.h"

namespace lamina {

/// What to do about columns that some inputs have and others lack.
enum class MixedAttributes {
  refuse,     ///< Error(unreadable) naming the column and both files
  fill,       ///< keep all columns; what an input lacks is 0, a quality 1
  intersect,  ///< keep only the columns that every input has
};

/// The columns of a file that holds all the inputs. Normals and radii cannot be made up: with `fill` they stay only
/// where every input has them. A column of different types takes a type that holds both, except for colours, which are
/// not rescaled: 8 and 16 bits together are refused. Throws Error(unreadable) for columns that do not go together,
/// naming column and files, and Error(usage) when there is no input.
PointColumns merged_columns(const std::vector<const PointSourceInfo*>& inputs, MixedAttributes mixed);

/// Appends all rows of the source, its columns brought into the writer's order by name. Otherwise as edit_points().
EditReport append_points(PointSource& source, PointsWriter& writer, BadSamples bad, const RunContext& run = {});

/// One mesh of all vertices and triangles, in order and not welded. `names` are those of the meshes, for messages.
/// Throws Error as merged_columns() does, and Error(budget) beyond 2^32 - 1 vertices.
TriangleMesh merge_meshes(std::vector<TriangleMesh> meshes, const std::vector<std::string>& names,
                          MixedAttributes mixed);

}  // namespace lamina
