// Several clouds or meshes in one file.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "lamina/edit_points.h"
#include "lamina/mesh.h"

namespace lamina {

/// What to do about columns that some inputs have and others do not.
enum class MixedAttributes {
  refuse,     ///< Error(unreadable) naming the column and both files
  fill,       ///< keep all columns; what an input lacks is 0, a quality 1
  intersect,  ///< keep only the columns that every input has
};

/// Normals and radii cannot be made up: under `fill` they are kept only where every input has them. A column of
/// different types takes one that holds both (colours are not rescaled: 8 and 16 bits together are refused).
/// Throws Error(unreadable) as described, Error(usage) when there is no input.
PointColumns merged_columns(const std::vector<const PointSourceInfo*>& inputs, MixedAttributes mixed);

/// Appends all rows of the source, its columns brought into the writer's order by name.
EditReport append_points(PointSource& source, PointsWriter& writer, BadSamples bad, const RunContext& run = {});

/// The meshes behind one another, not welded. `names` are theirs, for messages.
/// Throws Error(unreadable) as merged_columns() does, Error(budget) beyond 2^32 - 1 vertices.
TriangleMesh merge_meshes(std::vector<TriangleMesh> meshes, const std::vector<std::string>& names,
                          MixedAttributes mixed);

}  // namespace lamina
