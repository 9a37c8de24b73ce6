#include "points/ply_points_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <limits>
#include <optional>
#include <set>
#include <string_view>

#include "base/descriptor.h"
#include "base/output_file.h"
#include "base/ply_type.h"
#include "base/record_writer.h"
#include "lamina/error.h"
#include "lamina/run.h"
#include "points/row_codec.h"

namespace lamina {
namespace {

std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
  return text;
}

void require_ply_names(const PointColumns& columns) {
  std::set<std::string_view> taken{"x", "y", "z", "nx", "ny", "nz"};
  const auto take = [&](const std::string& name) {
    const bool plain = !name.empty() && std::all_of(name.begin(), name.end(),
                                                    [](unsigned char c) { return std::iscntrl(c) == 0 && c != ' '; });
    if (!plain || !taken.insert(name).second) {
      throw Error(ExitCode::internal, fmt::format("column '{}' cannot be written to a PLY: its name is empty, has "
                                                  "blanks, or is there twice",
                                                  one_line(name)));
    }
  };
  if (!columns.radius.empty()) take(columns.radius);
  if (!columns.quality.empty()) take(columns.quality);
  for (const AttributeSpec& spec : columns.attributes) take(spec.name);
}

PointColumns checked(const PointColumns& columns) {
  require_ply_names(columns);
  return columns;
}

class PlyPointsWriter final : public PointsWriter {
 public:
  PlyPointsWriter(const std::string& path, const PointColumns& columns, const PointsWriterSettings& settings)
      : PointsWriter(checked(columns)),
        settings_(settings),
        output_(path, settings.tmp_dir),
        codec_(columns),
        writer_(codec_.row_bytes()) {
    if (output_.streams() && settings.count) pipe_.emplace(output_.destination());
    const std::string header = ply_points_header(columns_, settings_.comments, settings_.count.value_or(0));
    check(write_all(target(), header.data(), header.size()));
  }

  void append(const SampleBatch& batch) override {
    if (committed_) throw Error(ExitCode::internal, output_.name() + ": is committed, nothing can be added");
    codec_.require_writable(batch, rows_, output_.name());
    check(writer_.append(target(), batch.size(),
                         [&](std::byte* to, std::size_t first, std::size_t n) { codec_.encode(batch, first, n, to); }));
    rows_ += batch.size();
  }

  void commit() override {
    if (committed_) throw Error(ExitCode::internal, output_.name() + ": is committed already");
    if (settings_.count && *settings_.count != rows_) {
      throw Error(ExitCode::internal,
                  fmt::format("{}: {} rows came, {} were announced", output_.name(), rows_, *settings_.count));
    }
    check(writer_.flush(target()));
    committed_ = true;
    if (pipe_) return check(pipe_->close());
    const std::string header = ply_points_header(columns_, settings_.comments, rows_);
    check(pwrite_all(output_.fd(), header.data(), header.size(), 0));
    if (!output_.streams()) return output_.publish();
    Descriptor to = output_.destination();
    check(copy_all(output_.fd(), header.size() + writer_.written(), to.get()));
    check(to.close());
  }

 private:
  [[nodiscard]] int target() const { return pipe_ ? pipe_->get() : output_.fd(); }
  void check(int error) const {
    if (error != 0) report_write_error(output_.name(), error);
  }

  PointsWriterSettings settings_;
  OutputFile output_;
  std::optional<Descriptor> pipe_;  ///< rows go there at once
  RowCodec codec_;
  SoleRecordWriter writer_;
  bool committed_ = false;
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
