#include "edit/batch_pipe.h"

#include <fmt/format.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>

#include "base/run.h"
#include "lamina/edit.h"
#include "lamina/error.h"

namespace lamina::edit {
namespace {

constexpr std::size_t kRows = 1u << 15;
constexpr std::size_t kInFlight = 8;

}  // namespace

void for_each_batch(PointSource& source, std::string_view stage, const RunContext& run,
                    const std::function<void(SampleBatch&)>& work, const std::function<void(SampleBatch&)>& take) {
  const PointSourceInfo& info = source.info();
  using Piece = std::shared_ptr<SampleBatch>;
  std::uint64_t next = 0;
  const auto begin = [&](tbb::flow_control& flow) -> Piece {
    if (next >= info.count || run.cancelled()) {
      flow.stop();
      return nullptr;
    }
    auto piece = std::make_shared<SampleBatch>();
    piece->first = next;
    if (!info.random_access) source.read(next, kRows, *piece);
    next += kRows;
    return piece;
  };
  const auto middle = [&](const Piece& piece) {
    if (info.random_access) source.read(piece->first, kRows, *piece);
    work(*piece);
    return piece;
  };
  const auto end = [&](const Piece& piece) {
    const std::uint64_t done = std::min(piece->first + kRows, info.count);
    take(*piece);
    if (run.progress) run.progress({stage, done, info.count, 0, 0});
  };
  with_threads(run.threads, [&] {
    tbb::parallel_pipeline(kInFlight, tbb::make_filter<void, Piece>(tbb::filter_mode::serial_in_order, begin) &
                                          tbb::make_filter<Piece, Piece>(tbb::filter_mode::parallel, middle) &
                                          tbb::make_filter<Piece, void>(tbb::filter_mode::serial_in_order, end));
  });
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
}

}  // namespace lamina::edit

namespace lamina {
namespace {

template <class T>
std::uint64_t replace_non_finite(std::vector<T>& values) {
  std::uint64_t replaced = 0;
  for (T& value : values) {
    if (std::isfinite(value)) continue;
    value = 0;
    ++replaced;
  }
  return replaced;
}

/// A point without a normal is still a point: PCL, for one, writes NaN where a point has too few neighbours.
std::uint64_t replace_normals(SampleBatch& b) {
  std::uint64_t replaced = 0;
  for (std::size_t i = 0; i < b.nx.size(); ++i) {
    if (std::isfinite(b.nx[i]) && std::isfinite(b.ny[i]) && std::isfinite(b.nz[i])) continue;
    b.nx[i] = b.ny[i] = b.nz[i] = 0;
    ++replaced;
  }
  return replaced;
}

template <class T>
void keep_values(std::vector<T>& values, const std::vector<std::uint8_t>& keep) {
  if (values.empty()) return;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < keep.size(); ++i) {
    if (keep[i] != 0) values[kept++] = values[i];
  }
  values.resize(kept);
}

}  // namespace

bool is_finite_row(const SampleBatch& b, std::size_t i) {
  const bool radius = b.radius.empty() || std::isfinite(b.radius[i]);
  return radius && std::isfinite(b.x[i]) && std::isfinite(b.y[i]) && std::isfinite(b.z[i]);
}

EditReport clean_rows(SampleBatch& batch) {
  return clean_rows(batch, std::vector<std::uint8_t>(batch.size(), 1));
}

EditReport clean_rows(SampleBatch& batch, std::vector<std::uint8_t> keep) {
  EditReport report;
  report.read = batch.size();
  for (std::size_t i = 0; i < batch.size(); ++i) {
    if (keep[i] == 0 || is_finite_row(batch, i)) continue;
    keep[i] = 0;
    if (report.bad_rows++ == 0) report.first_bad_row = batch.first + i;
  }
  if (std::find(keep.begin(), keep.end(), 0) != keep.end()) keep_rows(batch, keep);
  report.replaced_normals = replace_normals(batch);
  report.replaced_values = replace_non_finite(batch.quality);
  for (std::size_t a = 0; a < batch.attributes.size(); ++a) {
    // A double may be finite where the float beside it is not.
    const bool exact = a < batch.exact.size() && !batch.exact[a].empty();
    const std::uint64_t floats = replace_non_finite(batch.attributes[a]);
    report.replaced_values += exact ? replace_non_finite(batch.exact[a]) : floats;
  }
  return report;
}

void add(EditReport& total, const EditReport& batch) {
  total.read += batch.read;
  total.bad_rows += batch.bad_rows;
  total.replaced_normals += batch.replaced_normals;
  total.replaced_values += batch.replaced_values;
  if (batch.first_bad_row) total.first_bad_row = std::min(*batch.first_bad_row, total.first_bad_row.value_or(~0ULL));
}

void refuse_bad_row(const EditReport& report, const std::string& path) {
  throw Error(ExitCode::unreadable, fmt::format("{}: row {} (counted from 0) is not finite; clean the file or use "
                                                "--bad-samples drop",
                                                path, report.first_bad_row.value_or(0)));
}

void keep_rows(SampleBatch& batch, const std::vector<std::uint8_t>& keep) {
  for (auto* axis : {&batch.x, &batch.y, &batch.z}) keep_values(*axis, keep);
  for (auto* column : {&batch.nx, &batch.ny, &batch.nz, &batch.radius, &batch.quality}) keep_values(*column, keep);
  for (auto& values : batch.attributes) keep_values(values, keep);
  for (auto& values : batch.exact) keep_values(values, keep);
}

EditReport edit_points(PointSource& source, PointsWriter& writer, const EditBatch& edit, BadSamples bad,
                       const RunContext& run) {
  EditReport total;
  std::mutex mutex;
  const auto work = [&](SampleBatch& batch) {
    const EditReport part = clean_rows(batch);
    if (part.bad_rows > 0 && bad == BadSamples::refuse) refuse_bad_row(part, source.info().path);
    if (edit) edit(batch);
    const std::lock_guard lock(mutex);
    add(total, part);
  };
  edit::for_each_batch(source, "write", run, work, [&](SampleBatch& batch) { writer.append(batch); });
  total.written = writer.rows();
  return total;
}

void warn_of_bad_rows(const EditReport& report, const std::string& path, const RunContext& run) {
  if (report.bad_rows > 0) {
    run.warn(fmt::format("{}: {} of {} rows are not finite, the first is row {} (counted from 0); dropped", path,
                         report.bad_rows, report.read, *report.first_bad_row));
  }
  if (report.replaced_normals > 0) {
    run.warn(fmt::format("{}: {} of {} normals are not finite; they become 0 0 0", path, report.replaced_normals,
                         report.read));
  }
  if (report.replaced_values > 0) {
    run.warn(fmt::format("{}: {} attribute values are not finite; they become 0", path, report.replaced_values));
  }
}

}  // namespace lamina
