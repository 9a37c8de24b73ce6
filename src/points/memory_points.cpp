#include "lamina/memory_points.h"

#include <algorithm>
#include <span>
#include <utility>

#include "base/descriptor.h"
#include "base/number.h"
#include "base/spill_file.h"
#include "lamina/error.h"
#include "points/point_columns.h"

namespace lamina {
namespace {

template <class Out>
void gather(const ArrayColumn& column, RowRange rows, Out* out) {
  with_scalar_type(column.type, [&](auto zero) {
    using T = decltype(zero);
    const auto* from =
        static_cast<const std::byte*>(column.data) + static_cast<std::ptrdiff_t>(rows.first) * column.stride;
    for (std::size_t i = 0; i < rows.count; ++i, from += column.stride) out[i] = static_cast<Out>(load_little<T>(from));
  });
}

class ViewedPoints final : public PointSource {
 public:
  ViewedPoints(const std::string& name, std::uint64_t count, std::vector<ArrayColumn> arrays)
      : arrays_(std::move(arrays)) {
    for (const ArrayColumn& array : arrays_) columns_.push_back({array.name, array.type});
    give_roles(columns_, info_, name, "column");
    info_.path = name;
    info_.count = count;
    info_.random_access = true;
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    const std::vector<ColumnTarget> targets = prepare_batch(info_, columns_, rows, out);
    for (std::size_t c = 0; c < arrays_.size(); ++c) {
      if (targets[c].wide != nullptr) gather(arrays_[c], rows, targets[c].wide);
      if (targets[c].narrow != nullptr) gather(arrays_[c], rows, targets[c].narrow);
    }
    round_exact_attributes(out);
  }

 private:
  std::vector<ArrayColumn> arrays_;
  std::vector<PointColumn> columns_;
};

PointSourceInfo info_of(const std::string& name, const PointColumns& columns, std::uint64_t count) {
  PointSourceInfo info;
  info.path = name;
  info.count = count;
  info.has_normals = columns.normals;
  info.has_radius = !columns.radius.empty();
  info.has_quality = !columns.quality.empty();
  info.radius_name = columns.radius;
  info.quality_name = columns.quality;
  info.random_access = true;
  info.double_precision = columns.double_positions;
  info.attributes = columns.attributes;
  return info;
}

class SpooledPoints final : public PointSource {
 public:
  SpooledPoints(PointSourceInfo info, RowCodec codec, SpillFile file)
      : codec_(std::move(codec)), file_(std::move(file)) {
    info_ = std::move(info);
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    const std::size_t bytes = codec_.row_bytes();
    const auto buffer = std::make_unique_for_overwrite<std::byte[]>(rows.count * bytes);
    if (rows.count > 0) file_.read(rows.first * bytes, std::span(buffer.get(), rows.count * bytes));
    codec_.decode(buffer.get(), bytes, rows.count, out);
    out.first = rows.first;
  }

 private:
  RowCodec codec_;
  SpillFile file_;
};

/// The columns' arrays are all there.
void require_announced(const SampleBatch& batch, const PointColumns& columns, const std::string& name) {
  const std::size_t n = batch.size();
  bool even = batch.y.size() == n && batch.z.size() == n;
  if (columns.normals) even = even && batch.nx.size() == n && batch.ny.size() == n && batch.nz.size() == n;
  if (!columns.radius.empty()) even = even && batch.radius.size() == n;
  if (!columns.quality.empty()) even = even && batch.quality.size() == n;
  even = even && batch.attributes.size() == columns.attributes.size();
  for (const auto& attribute : batch.attributes) even = even && attribute.size() == n;
  if (!even) throw Error(ExitCode::internal, name + ": a batch lacks an array that was announced");
}

}  // namespace

std::unique_ptr<PointSource> view_points(const std::string& name, std::uint64_t count,
                                         std::vector<ArrayColumn> columns) {
  return std::make_unique<ViewedPoints>(name, count, std::move(columns));
}

struct PointSpool::Impl {
  std::string name;
  PointColumns columns;
  RowCodec codec;
  SpillFile file;
  std::uint64_t rows = 0;
  bool finished = false;
};

PointSpool::PointSpool(std::string name, PointColumns columns, const std::string& tmp_dir) {
  RowCodec codec(columns);
  impl_ = std::make_unique<Impl>(Impl{std::move(name), std::move(columns), std::move(codec),
                                      SpillFile(tmp_dir.empty() ? system_tmp_dir() : tmp_dir)});
}
PointSpool::~PointSpool() = default;

void PointSpool::append(const SampleBatch& batch) {
  Impl& s = *impl_;
  if (s.finished) throw Error(ExitCode::internal, s.name + ": is complete, nothing can be added");
  require_announced(batch, s.columns, s.name);
  constexpr std::size_t kRows = 1024;
  const std::size_t bytes = s.codec.row_bytes();
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(kRows * bytes);
  for (std::size_t done = 0; done < batch.size(); done += kRows) {
    const std::size_t n = std::min(kRows, batch.size() - done);
    s.codec.encode(batch, done, n, buffer.get());
    s.file.append(std::span<const std::byte>(buffer.get(), n * bytes));
  }
  s.rows += batch.size();
}

std::uint64_t PointSpool::rows() const {
  return impl_->rows;
}

std::unique_ptr<PointSource> PointSpool::finish() {
  Impl& s = *impl_;
  if (s.finished) throw Error(ExitCode::internal, s.name + ": is complete already");
  s.finished = true;
  s.file.flush();
  return std::make_unique<SpooledPoints>(info_of(s.name, s.columns, s.rows), std::move(s.codec), std::move(s.file));
}

}  // namespace lamina
