// Points to binary little-endian PLY.
#include <fmt/format.h>

#include <limits>
#include <string_view>
#include <vector>

#include "base/background_writer.h"
#include "base/descriptor.h"
#include "base/scalar_type.h"
#include "lamina/run.h"
#include "points/binary_rows.h"
#include "points/ply_header.h"
#include "points/writers.h"

namespace lamina {
namespace {

void require_names(const PointColumns& columns) {
  std::vector<std::string_view> names;
  if (!columns.radius.empty()) names.push_back(columns.radius);
  if (!columns.quality.empty()) names.push_back(columns.quality);
  for (const AttributeSpec& spec : columns.attributes) names.push_back(spec.name);
  require_ply_names("column", names);
}

PointColumns checked(const PointColumns& columns) {
  require_names(columns);
  return columns;
}

class PlyPointsWriter final : public PointsWriter {
 public:
  PlyPointsWriter(const std::string& path, const PointColumns& columns, const PointsWriterSettings& settings)
      : PointsWriter(checked(columns)),
        settings_(settings),
        codec_(columns),
        rows_out_(path, settings, settings.count.has_value()),
        writer_(codec_.row_bytes()) {
    if (!settings_.crs.empty()) settings_.comments.push_back("crs " + settings_.crs);
    const std::string header = ply_points_header(columns_, settings_.comments, settings_.count.value_or(0));
    rows_out_.check(write_all(rows_out_.fd(), header.data(), header.size()));
  }

  void append(const SampleBatch& batch) override {
    rows_out_.require_open();
    codec_.require_writable(batch, rows_, rows_out_.name());
    rows_out_.check(writer_.append(rows_out_.fd(), batch.size(), [&](std::byte* to, std::size_t first, std::size_t n) {
      codec_.encode(batch, first, n, to);
    }));
    rows_ += batch.size();
  }

  void commit() override {
    rows_out_.require_all(rows_);
    rows_out_.check(writer_.flush(rows_out_.fd()));
    const std::string header = ply_points_header(columns_, settings_.comments, rows_);
    rows_out_.publish(header, header.size() + writer_.written());
  }

 private:
  PointsWriterSettings settings_;
  RowCodec codec_;
  StagedRows rows_out_;
  SoleRecordWriter writer_;
};

}  // namespace

std::string ply_points_header(const PointColumns& columns, const std::vector<std::string>& comments,
                              std::uint64_t count) {
  std::string text = fmt::format("ply\nformat binary_little_endian 1.0\ncomment made by lamina {}\n", version());
  for (const std::string& comment : comments) text += fmt::format("comment {}\n", one_line(comment));
  const std::string digits = fmt::format("{}", count);
  // A number that is known only at the end must not move the rows.
  const std::size_t most = std::numeric_limits<std::uint64_t>::digits10 + 1;
  text += fmt::format("comment {}\nelement vertex {}\n", std::string(most - digits.size(), '-'), digits);
  const auto property = [&](ScalarType type, std::string_view name) {
    text += fmt::format("property {} {}\n", ply_name(type), name);
  };
  for (const char* axis : {"x", "y", "z"})
    property(columns.double_positions ? ScalarType::float64 : ScalarType::float32, axis);
  if (columns.normals)
    for (const char* axis : {"nx", "ny", "nz"}) property(ScalarType::float32, axis);
  if (!columns.radius.empty()) property(ScalarType::float32, columns.radius);
  if (!columns.quality.empty()) property(ScalarType::float32, columns.quality);
  for (const AttributeSpec& spec : columns.attributes) property(spec.type, spec.name);
  return text + "end_header\n";
}

std::unique_ptr<PointsWriter> open_ply_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings) {
  return std::make_unique<PlyPointsWriter>(path, columns, settings);
}

}  // namespace lamina
