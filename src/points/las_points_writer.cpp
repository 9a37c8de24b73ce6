#include "points/las_points_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <limits>
#include <memory>

#include "base/record_writer.h"
#include "lamina/error.h"
#include "points/las_writer_layout.h"
#include "points/row_codec.h"
#include "points/staged_rows.h"

namespace lamina {
namespace {

PointColumns as_doubles(PointColumns columns) {
  columns.double_positions = true;
  return columns;
}

class LasPointsWriter final : public PointsWriter {
 public:
  LasPointsWriter(const std::string& path, const PointColumns& columns, const PointsWriterSettings& settings)
      : PointsWriter(columns),
        settings_(settings),
        layout_(columns),
        codec_(as_doubles(columns)),
        rows_out_(path, settings.tmp_dir, false),
        waiting_(open_unlinked(settings.tmp_dir.empty() ? system_tmp_dir() : settings.tmp_dir)),
        writer_(codec_.row_bytes()) {}

  void append(const SampleBatch& batch) override {
    if (committed_) throw Error(ExitCode::internal, rows_out_.name() + ": is committed, nothing can be added");
    codec_.require_writable(batch, rows_, rows_out_.name());
    const std::array<const std::vector<double>*, 3> position{&batch.x, &batch.y, &batch.z};
    for (std::size_t k = 0; k < 3 && batch.size() > 0; ++k) {
      const auto [low, high] = std::minmax_element(position[k]->begin(), position[k]->end());
      low_[k] = std::min(low_[k], *low);
      high_[k] = std::max(high_[k], *high);
    }
    rows_out_.check(writer_.append(waiting_.get(), batch.size(), [&](std::byte* to, std::size_t first, std::size_t n) {
      codec_.encode(batch, first, n, to);
    }));
    rows_ += batch.size();
  }

  void commit() override {
    if (committed_) throw Error(ExitCode::internal, rows_out_.name() + ": is committed already");
    require_count(rows_out_.name(), settings_, rows_);
    rows_out_.check(writer_.flush(waiting_.get()));
    committed_ = true;
    std::array<LasAxis, 3> axes{};
    for (std::size_t k = 0; k < 3; ++k) axes[k] = rows_ == 0 ? LasAxis{} : choose_steps(low_[k], high_[k]);
    const std::string header = layout_.header(axes, rows_);
    rows_out_.check(write_all(rows_out_.fd(), header.data(), header.size()));
    SoleRecordWriter records(layout_.record_bytes());
    write_rows(axes, records);
    rows_out_.publish(header, header.size() + records.written());
  }

 private:
  void write_rows(const std::array<LasAxis, 3>& axes, SoleRecordWriter& records) const {
    constexpr std::size_t kBlock = 4096;
    const auto buffer = std::make_unique_for_overwrite<std::byte[]>(kBlock * codec_.row_bytes());
    SampleBatch batch;
    for (std::uint64_t first = 0; first < rows_; first += kBlock) {
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, rows_ - first));
      const ReadResult got =
          pread_all(waiting_.get(), buffer.get(), n * codec_.row_bytes(), first * codec_.row_bytes());
      rows_out_.check(got.error != 0 ? got.error : got.bytes < n * codec_.row_bytes() ? EIO : 0);
      codec_.decode(buffer.get(), codec_.row_bytes(), n, batch);
      rows_out_.check(records.append(rows_out_.fd(), n, [&](std::byte* to, std::size_t at, std::size_t count) {
        layout_.encode(batch, axes, at, count, to);
      }));
    }
    rows_out_.check(records.flush(rows_out_.fd()));
  }

  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  PointsWriterSettings settings_;
  LasLayout layout_;
  RowCodec codec_;
  StagedRows rows_out_;
  Descriptor waiting_;  ///< rows as they came
  SoleRecordWriter writer_;
  std::array<double, 3> low_{kInfinity, kInfinity, kInfinity}, high_{-kInfinity, -kInfinity, -kInfinity};
  bool committed_ = false;
};

}  // namespace

std::unique_ptr<PointsWriter> open_las_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings) {
  return std::make_unique<LasPointsWriter>(path, columns, settings);
}

}  // namespace lamina
