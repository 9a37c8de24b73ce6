// Points to LAS 1.4, and to LAZ.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/descriptor.h"
#include "base/number.h"
#include "base/spill_file.h"
#include "laz/chunks.h"
#include "points/formats.h"
#include "points/las.h"
#include "points/point_columns.h"

namespace lamina {
namespace {

/// Point records into the chunks of a LAZ file. Chunks are compressed in parallel, a few at once; all the sink holds is
/// these.
class LazRecordSink {
 public:
  explicit LazRecordSink(const LasLayout& layout);

  /// The record of the header that says how points are compressed.
  [[nodiscard]] static std::string packing(const LasLayout& layout);
  /// What stands before the first chunk: where the chunk table is, once that is known.
  [[nodiscard]] std::string lead() const;
  /// The offset of the first chunk.
  void begin(std::uint64_t offset) { begin_ = offset; }

  /// Adds `count` records: fill(to, at, n) writes n of them from the at-th on. Returns an errno value.
  template <class Fill>
  int append(int fd, std::size_t count, const Fill& fill) {
    for (std::size_t done = 0; done < count;) {
      const std::size_t n = std::min(count - done, room());
      if (waiting_.size() < (records_ + n) * layout_.bytes) waiting_.resize((records_ + n) * layout_.bytes);
      fill(waiting_.data() + records_ * layout_.bytes, done, n);
      records_ += n;
      done += n;
      if (room() > 0) continue;
      if (const int error = compress(fd); error != 0) return error;
    }
    return 0;
  }
  /// The last chunk and the table. Returns an errno value.
  int finish(int fd);
  [[nodiscard]] std::uint64_t written() const { return written_; }  ///< bytes behind lead()

 private:
  static constexpr std::size_t kChunkPoints = 50'000;  ///< as LASzip's own
  static constexpr std::size_t kChunksAtOnce = 8;

  [[nodiscard]] std::size_t room() const { return kChunkPoints * kChunksAtOnce - records_; }
  int compress(int fd);
  int put(int fd, const std::vector<std::byte>& bytes);

  laz::RecordLayout layout_;
  std::vector<std::byte> waiting_;
  std::size_t records_ = 0;  ///< waiting
  std::vector<std::uint32_t> chunk_bytes_;
  std::uint64_t begin_ = 0, written_ = 0;
  std::uint64_t table_ = 0;  ///< offset, 0: not written yet
};

LazRecordSink::LazRecordSink(const LasLayout& layout)
    : layout_{.bytes = layout.record_bytes(),
              .extra_bytes = layout.record_bytes() - las_record_bytes(layout.point_format()),
              .colours = layout.has_colours()} {}

std::string LazRecordSink::packing(const LasLayout& layout) {
  return laz_packing_record(layout.point_format(), layout.record_bytes(), kChunkPoints);
}

std::string LazRecordSink::lead() const {
  std::string bytes;
  append_little(bytes, table_);
  return bytes;
}

int LazRecordSink::put(int fd, const std::vector<std::byte>& bytes) {
  written_ += bytes.size();
  return write_all(fd, bytes.data(), bytes.size());
}

int LazRecordSink::compress(int fd) {
  const std::size_t chunks = (records_ + kChunkPoints - 1) / kChunkPoints;
  std::array<std::vector<std::byte>, kChunksAtOnce> code;
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t i) {
    const std::size_t first = i * kChunkPoints;
    code.at(i) =
        laz::encode_layered(layout_, waiting_.data() + first * layout_.bytes, std::min(kChunkPoints, records_ - first));
  });
  records_ = 0;
  for (std::size_t i = 0; i < chunks; ++i) {
    chunk_bytes_.push_back(static_cast<std::uint32_t>(code.at(i).size()));
    if (const int error = put(fd, code.at(i)); error != 0) return error;
  }
  return 0;
}

int LazRecordSink::finish(int fd) {
  if (const int error = compress(fd); error != 0) return error;
  table_ = begin_ + written_;
  std::string head;
  append_little(head, std::uint32_t{0});  // version of the table
  append_little(head, static_cast<std::uint32_t>(chunk_bytes_.size()));
  std::vector<std::byte> table(head.size());
  std::transform(head.begin(), head.end(), table.begin(), [](char c) { return static_cast<std::byte>(c); });
  if (!chunk_bytes_.empty()) {
    const std::vector<std::byte> code = laz::encode_chunk_table(chunk_bytes_);
    table.insert(table.end(), code.begin(), code.end());
  }
  return put(fd, table);
}

constexpr double kMostSteps = 2147483647;

PointColumns as_doubles(PointColumns columns) {
  columns.double_positions = true;
  return columns;
}

/// Records as they are.
class PlainRecordSink {
 public:
  explicit PlainRecordSink(const LasLayout& layout) : records_(layout.record_bytes()) {}

  [[nodiscard]] static std::string packing(const LasLayout&) { return {}; }
  [[nodiscard]] static std::string lead() { return {}; }
  void begin(std::uint64_t) {}
  template <class Fill>
  int append(int fd, std::size_t count, const Fill& fill) {
    return records_.append(fd, count, fill);
  }
  int finish(int fd) { return records_.flush(fd); }
  [[nodiscard]] std::uint64_t written() const { return records_.written(); }

 private:
  SoleRecordWriter records_;
};

template <class RecordSink>
class LasPointsWriter final : public PointsWriter {
 public:
  LasPointsWriter(const std::string& path, const PointColumns& columns, const PointsWriterSettings& settings)
      : PointsWriter(columns),
        settings_(settings),
        layout_(columns),
        codec_(as_doubles(columns)),
        rows_out_(path, settings, false),
        waiting_(settings.tmp_dir.empty() ? system_tmp_dir() : settings.tmp_dir),
        block_(kBlock * codec_.row_bytes()) {
    layout_.name_system(settings.crs, settings.geographic);
  }

  void append(const SampleBatch& batch) override {
    rows_out_.require_open();
    codec_.require_writable(batch, rows_, rows_out_.name());
    const std::array<const std::vector<double>*, 3> position{&batch.x, &batch.y, &batch.z};
    for (std::size_t k = 0; k < 3 && batch.size() > 0; ++k) {
      const auto [low, high] = std::minmax_element(position[k]->begin(), position[k]->end());
      low_[k] = std::min(low_[k], *low);
      high_[k] = std::max(high_[k], *high);
      for (const double v : *position[k]) decimals_[k].add(v);
    }
    for (std::size_t first = 0; first < batch.size(); first += kBlock) {
      const std::size_t n = std::min(kBlock, batch.size() - first);
      codec_.encode(batch, first, n, block_.data());
      waiting_.append(std::span(block_).first(n * codec_.row_bytes()), disk_);
    }
    layout_.count(batch, rows_out_.name(), totals_);
    rows_ += batch.size();
  }

  void commit() override {
    rows_out_.require_all(rows_);
    waiting_.flush(disk_);
    waiting_.check(disk_.drain());
    for (std::size_t k = 0; k < 3; ++k)
      totals_.axes[k] = rows_ == 0 ? LasAxis{} : choose_steps(low_[k], high_[k], decimals_[k].most());
    RecordSink records(layout_);
    const std::string header = layout_.header(totals_, RecordSink::packing(layout_));
    const std::string start = header + records.lead();
    rows_out_.check(write_all(rows_out_.fd(), start.data(), start.size()));
    records.begin(start.size());
    write_rows(totals_.axes, records);
    rows_out_.publish(header + records.lead(), start.size() + records.written());
  }

 private:
  void write_rows(const std::array<LasAxis, 3>& axes, RecordSink& records) const {
    SampleBatch batch;
    waiting_.read_through(block_.size(), [&](std::span<const std::byte> rows) {
      const std::size_t n = rows.size() / codec_.row_bytes();
      codec_.decode(rows.data(), codec_.row_bytes(), n, batch);
      rows_out_.check(records.append(rows_out_.fd(), n, [&](std::byte* to, std::size_t at, std::size_t count) {
        layout_.encode(batch, axes, at, count, to);
      }));
    });
    rows_out_.check(records.finish(rows_out_.fd()));
  }

  static constexpr std::size_t kBlock = 4096;  ///< rows encoded or decoded at once
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  PointsWriterSettings settings_;
  LasLayout layout_;
  LasTotals totals_;
  RowCodec codec_;
  StagedRows rows_out_;
  SpillFile waiting_;                                  ///< rows as they came
  BackgroundWriter disk_{SpillFile::kBufferBytes, 4};  // ends before the file does
  std::vector<std::byte> block_;
  std::array<Decimals, 3> decimals_{};  ///< of each axis
  std::array<double, 3> low_{kInfinity, kInfinity, kInfinity}, high_{-kInfinity, -kInfinity, -kInfinity};
};

}  // namespace

void Decimals::add(double value) {
  for (; most_ < kMost; ++most_, tenth_ *= 10) {
    const double steps = value * tenth_;
    // As near to a whole number as products of doubles are.
    if (std::abs(steps - std::round(steps)) <= 4 * std::numeric_limits<double>::epsilon() * std::abs(steps)) return;
  }
}

LasAxis choose_steps(double low, double high, int decimals) {
  LasAxis axis{low, high};
  // Whole offsets keep coordinates readable; any within the span will do.
  axis.offset = std::floor(low + (high - low) / 2);
  const double reach = std::max(high - axis.offset, axis.offset - low);
  const double finest = std::max({std::abs(low), std::abs(high), reach}) * 0x1p-52;
  const double step = std::max(reach / kMostSteps, finest);
  axis.scale = step > 0 ? std::pow(10, std::ceil(std::log10(step))) : 0.001;
  if (decimals < Decimals::kMost) axis.scale = std::max(axis.scale, std::pow(10, -decimals));
  return axis;
}

std::unique_ptr<PointsWriter> open_las_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings) {
  return std::make_unique<LasPointsWriter<PlainRecordSink>>(path, columns, settings);
}

std::unique_ptr<PointsWriter> open_laz_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings) {
  return std::make_unique<LasPointsWriter<LazRecordSink>>(path, columns, settings);
}

}  // namespace lamina
