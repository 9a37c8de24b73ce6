#include <fmt/compile.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <string_view>

#include "base/descriptor.h"
#include "base/scalar_type.h"
#include "lamina/error.h"
#include "points/binary_rows.h"
#include "points/writers.h"

namespace lamina {
namespace {

constexpr std::size_t kFlushBytes = 256 << 10;

/// Names in the order of a row. Throws when one of them would not come back from a line of names.
std::vector<std::string> names_of(const PointColumns& columns) {
  std::vector<std::string> names{"x", "y", "z"};
  if (columns.normals) names.insert(names.end(), {"nx", "ny", "nz"});
  if (!columns.radius.empty()) names.push_back(columns.radius);
  if (!columns.quality.empty()) names.push_back(columns.quality);
  for (const AttributeSpec& spec : columns.attributes) names.push_back(spec.name);
  std::set<std::string_view> seen;
  for (const std::string& name : names) {
    const bool plain = !name.empty() && name.find_first_of(" \t\r\n\v\f,;\"'") == std::string::npos;
    if (!plain || !seen.insert(name).second) {
      throw Error(ExitCode::internal,
                  fmt::format("column '{}' cannot be written as text: its name is empty, has blanks or "
                              "commas, or is there twice",
                              name));
    }
  }
  return names;
}

/// Integers print as such, rounded and clamped to their type.
double in_type(double value, ScalarType type) {
  if (!is_integer_type(type)) return value;
  const ScalarRange range = scalar_range(type);
  return std::clamp(std::nearbyint(value), range.low, range.high);
}

class TextPointsWriter final : public PointsWriter {
 public:
  TextPointsWriter(const std::string& path, const PointColumns& columns, const PointsWriterSettings& settings,
                   char separator)
      : PointsWriter(columns),
        settings_(settings),
        codec_(columns),
        separator_(separator),
        header_(header_line(names_of(columns))),
        rows_out_(path, settings, true) {
    rows_out_.check(write_all(rows_out_.fd(), header_.data(), header_.size()));
    written_ = header_.size();
  }

  void append(const SampleBatch& batch) override {
    rows_out_.require_open();
    codec_.require_writable(batch, rows_, rows_out_.name());
    for (std::size_t i = 0; i < batch.size(); ++i) {
      put_row(batch, i);
      if (text_.size() >= kFlushBytes) flush();
    }
    rows_ += batch.size();
  }

  void commit() override {
    rows_out_.require_all(rows_);
    flush();
    rows_out_.publish(header_, written_);
  }

 private:
  [[nodiscard]] std::string header_line(const std::vector<std::string>& names) const {
    std::string line = separator_ == ',' ? "" : "# ";
    for (std::size_t i = 0; i < names.size(); ++i) line += (i == 0 ? "" : std::string(1, separator_)) + names[i];
    return line + "\n";
  }

  template <class Number>
  void put(Number value) {
    fmt::format_to(std::back_inserter(text_), FMT_COMPILE("{}{}"), value, separator_);
  }

  void put_row(const SampleBatch& b, std::size_t i) {
    for (const double v : {b.x[i], b.y[i], b.z[i]}) {
      columns_.double_positions ? put(v) : put(static_cast<float>(v));
    }
    if (columns_.normals) {
      for (const float v : {b.nx[i], b.ny[i], b.nz[i]}) put(v);
    }
    if (!columns_.radius.empty()) put(b.radius[i]);
    if (!columns_.quality.empty()) put(b.quality[i]);
    for (std::size_t a = 0; a < columns_.attributes.size(); ++a) {
      const ScalarType type = columns_.attributes[a].type;
      const bool exact = a < b.exact.size() && !b.exact[a].empty();
      const double value = in_type(exact ? b.exact[a][i] : double{b.attributes[a][i]}, type);
      type == ScalarType::float32 ? put(static_cast<float>(value)) : put(value);
    }
    text_[text_.size() - 1] = '\n';
  }

  void flush() {
    rows_out_.check(write_all(rows_out_.fd(), text_.data(), text_.size()));
    written_ += text_.size();
    text_.clear();
  }

  PointsWriterSettings settings_;
  RowCodec codec_;
  char separator_;
  std::string header_;
  StagedRows rows_out_;
  fmt::memory_buffer text_;
  std::uint64_t written_ = 0;
};

}  // namespace

std::unique_ptr<PointsWriter> open_xyz_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings) {
  return std::make_unique<TextPointsWriter>(path, columns, settings, ' ');
}

std::unique_ptr<PointsWriter> open_csv_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings) {
  return std::make_unique<TextPointsWriter>(path, columns, settings, ',');
}

}  // namespace lamina
