// Rows of points on their way from a source to a writer, a few batches in memory at a time: edited, or sorted where
// they are more than memory holds.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "lamina/points.h"
#include "lamina/points_writer.h"
#include "lamina/run.h"
#include "lamina/sample.h"

namespace lamina {

/// Changes a batch in place: its rows may move, disappear or gain columns. Called from several threads, each with its
/// own batch.
using EditBatch = std::function<void(SampleBatch&)>;

/// What passed through.
struct EditReport {
  std::uint64_t read = 0, written = 0;
  std::uint64_t bad_rows = 0;                  ///< left out because a position or radius was not finite
  std::optional<std::uint64_t> first_bad_row;  ///< of the input, counted from 0
  std::uint64_t replaced_normals = 0;          ///< that were not finite and became 0 0 0
  std::uint64_t replaced_values = 0;           ///< of attributes and qualities, that were not finite and became 0
};

/// Passes all rows of the source through `edit` (may be empty) to the writer, in order. Rows that cannot be written are
/// left out and counted, or refused with Error(unreadable) naming the first. Does not commit the writer. The result
/// does not depend on threads. Throws what source, edit and writer throw, and Error(internal) when cancelled.
EditReport edit_points(PointSource& source, PointsWriter& writer, const EditBatch& edit, BadSamples bad,
                       const RunContext& run = {});

/// Keeps the rows i with keep[i] != 0, in order. `keep` has one entry for each row.
void keep_rows(SampleBatch& batch, const std::vector<std::uint8_t>& keep);

/// True when row i can be written: its position and radius are finite.
bool is_finite_row(const SampleBatch& batch, std::size_t i);

/// Drops rows that cannot be written, and replaces normals, qualities and attribute values that are not finite by 0.
/// `written` stays 0. What edit_points() does to each batch, for those who read batches themselves.
EditReport clean_rows(SampleBatch& batch);
/// The same for the rows i with keep[i] != 0; the others are dropped and not counted as bad.
EditReport clean_rows(SampleBatch& batch, std::vector<std::uint8_t> keep);
/// Adds the report of another batch.
void add(EditReport& total, const EditReport& batch);
/// Throws Error(unreadable) naming `path` and the first bad row.
[[noreturn]] void refuse_bad_row(const EditReport& report, const std::string& path);

/// Warns through run.warn() of what was left out or replaced, if anything; `path` names the input.
void warn_of_bad_rows(const EditReport& report, const std::string& path, const RunContext& run);

/// What rows are sorted by.
enum class SortKey {
  x,
  y,
  z,
  sweep,      ///< along the dominant axis of the cloud, the one a reconstruction sweeps along
  spatial,    ///< along a Morton curve of 2^21 cells a side: neighbours in the file are neighbours in space
  attribute,  ///< by the values of a column
};

struct SortSettings {
  SortKey key = SortKey::spatial;
  std::string attribute;  ///< SortKey::attribute: its name
  bool reverse = false;   ///< descending
  BadSamples bad_samples = BadSamples::drop;
  std::size_t memory = std::size_t{256} << 20;  ///< for rows being sorted; at most a quarter of run.max_memory
};

/// Writes the source's rows in ascending order of their keys; equal keys keep their order, -0 and 0 are equal. Values
/// keep their bits. Does not commit the writer. Reads the input once, by `sweep` and `spatial` twice; a cloud larger
/// than settings.memory takes a temporary file of its own size in run.tmp_dir (empty: the system's). The result does
/// not depend on threads. Throws Error(usage) for an attribute that is not there, naming those that are, Error(budget)
/// when the disk is full or run.max_memory too small, and as edit_points() does.
EditReport sort_points(PointSource& source, PointsWriter& writer, const SortSettings& settings,
                       const RunContext& run = {});

}  // namespace lamina
