// Rows of points on their way from a source to a writer: what every streaming tool is made of.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "lamina/points.h"
#include "lamina/points_writer.h"
#include "lamina/run.h"
#include "lamina/sample.h"

namespace lamina {

/// Changes a batch in place: moves, drops or adds to its rows. Called from several threads, each with its own batch.
using EditBatch = std::function<void(SampleBatch&)>;

struct EditReport {
  std::uint64_t read = 0, written = 0;
  std::uint64_t bad_rows = 0;  ///< left out: a position or radius was not finite
  std::optional<std::uint64_t> first_bad_row;
  std::uint64_t replaced_normals = 0;  ///< that were not finite and became 0 0 0
  std::uint64_t replaced_values = 0;   ///< of attributes and qualities, that were not finite and became 0
};

/// Passes all rows of the source through `edit` to the writer, in order; a few batches are in memory at a time. Rows
/// that cannot be written are left out and counted, or refused with Error(unreadable) naming the first. The result does
/// not depend on threads. Does not commit.
EditReport edit_points(PointSource& source, PointsWriter& writer, const EditBatch& edit, BadSamples bad,
                       const RunContext& run = {});

/// Keeps the rows i with keep[i] != 0, in order.
void keep_rows(SampleBatch& batch, const std::vector<std::uint8_t>& keep);

/// Whether row i can be passed on: its position and radius are finite.
bool is_finite_row(const SampleBatch& batch, std::size_t i);

/// The pieces edit_points() is made of. Drops rows that cannot be written and replaces attribute values that are not
/// finite; `written` is left at 0.
EditReport clean_rows(SampleBatch& batch);
/// The same of the rows i with keep[i] != 0; the others are dropped without being counted as bad.
EditReport clean_rows(SampleBatch& batch, std::vector<std::uint8_t> keep);
/// Adds what a later batch came to.
void add(EditReport& total, const EditReport& batch);
/// Throws Error(unreadable) naming the first bad row.
[[noreturn]] void refuse_bad_row(const EditReport& report, const std::string& path);

/// Warns of what was left out or replaced, if anything.
void warn_of_bad_rows(const EditReport& report, const std::string& path, const RunContext& run);

}  // namespace lamina
