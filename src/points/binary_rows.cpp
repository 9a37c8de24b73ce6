#include "points/point_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string_view>

#include "base/descriptor.h"
#include "base/number.h"
#include "lamina/error.h"

namespace lamina {
namespace {

/// Bytes converted column by column at once: they stay in the first-level cache across the columns.
constexpr std::size_t kConvertBytes = 12 << 10;

/// Rows encoded column by column at once: they stay in the first-level cache across the columns.
constexpr std::size_t kEncodedRows = 256;

template <class In>
bool fits(ScalarType type, In value) {
  const bool narrow = type == ScalarType::float32;
  return narrow ? std::isfinite(static_cast<float>(value)) : std::isfinite(value);
}

/// Calls visit(name, type, values) for every column in the order of the rows.
template <class Batch, class Visit>
void for_each_column(const PointColumns& columns, Batch& batch, const Visit& visit) {
  const ScalarType position = columns.double_positions ? ScalarType::float64 : ScalarType::float32;
  visit("x", position, batch.x);
  visit("y", position, batch.y);
  visit("z", position, batch.z);
  if (columns.normals) {
    visit("nx", ScalarType::float32, batch.nx);
    visit("ny", ScalarType::float32, batch.ny);
    visit("nz", ScalarType::float32, batch.nz);
  }
  if (!columns.radius.empty()) visit(columns.radius, ScalarType::float32, batch.radius);
  if (!columns.quality.empty()) visit(columns.quality, ScalarType::float32, batch.quality);
  for (std::size_t a = 0; a < columns.attributes.size(); ++a) {
    const AttributeSpec& spec = columns.attributes[a];
    if (a < batch.exact.size() && !batch.exact[a].empty()) {
      visit(spec.name, spec.type, batch.exact[a]);
    } else {
      visit(spec.name, spec.type, batch.attributes[a]);
    }
  }
}

}  // namespace

template <class Out>
void convert_column(ScalarType type, bool swapped, const std::byte* row, std::size_t stride, std::size_t count,
                    Out* out) {
  with_scalar_type(type, [=](auto zero) {
    using T = decltype(zero);
    const auto loop = [=](const auto& load) {
      const std::byte* from = row;
      for (std::size_t i = 0; i < count; ++i, from += stride) out[i] = static_cast<Out>(load(from));
    };
    swapped ? loop([](const std::byte* at) { return load_big<T>(at); })
            : loop([](const std::byte* at) { return load_little<T>(at); });
  });
}

template void convert_column(ScalarType, bool, const std::byte*, std::size_t, std::size_t, float*);
template void convert_column(ScalarType, bool, const std::byte*, std::size_t, std::size_t, double*);

void convert_rows(const BinaryRows& layout, const std::vector<PointColumn>& columns, const std::byte* bytes,
                  std::size_t at, std::size_t count, const std::vector<ColumnTarget>& targets) {
  const std::size_t block = std::max<std::size_t>(1, kConvertBytes / layout.stride);
  for (std::size_t done = 0; done < count; done += block) {
    const std::size_t rows = std::min(block, count - done);
    for (std::size_t c = 0; c < targets.size(); ++c) {
      const std::byte* from = bytes + done * layout.stride + columns[c].offset;
      if (targets[c].wide != nullptr) {
        convert_column(columns[c].type, layout.swapped, from, layout.stride, rows, targets[c].wide + at + done);
      } else if (targets[c].narrow != nullptr) {
        convert_column(columns[c].type, layout.swapped, from, layout.stride, rows, targets[c].narrow + at + done);
      }
    }
  }
}

void read_row_blocks(const InputFile& file, const BinaryRows& rows, RowRange range, const TakeRows& take) {
  // Read, not mapped: mapped bytes count as resident memory afterwards.
  const std::size_t block = std::max<std::size_t>(1, kReadBytes / rows.stride);
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(std::min(block, range.count) * rows.stride);
  for (std::size_t done = 0; done < range.count; done += block) {
    const std::size_t n = std::min(block, range.count - done);
    const std::uint64_t offset = rows.data + (range.first + done) * rows.stride;
    if (const std::size_t got = file.read(offset, buffer.get(), n * rows.stride); got < n * rows.stride) {
      throw Error(ExitCode::unreadable, fmt::format("{}: ends at row {}, it was complete when it was opened: is it "
                                                    "being written?",
                                                    file.name, range.first + done + got / rows.stride));
    }
    take(buffer.get(), done, n);
  }
}

void read_binary_rows(const InputFile& file, const BinaryRows& rows, const std::vector<PointColumn>& columns,
                      RowRange range, const std::vector<ColumnTarget>& targets) {
  read_row_blocks(file, rows, range, [&](const std::byte* bytes, std::size_t at, std::size_t count) {
    convert_rows(rows, columns, bytes, at, count, targets);
  });
}

RowCodec::RowCodec(const PointColumns& columns) : columns_(columns) {
  row_bytes_ = 3 * (columns.double_positions ? sizeof(double) : sizeof(float));
  if (columns.normals) row_bytes_ += 3 * sizeof(float);
  if (!columns.radius.empty()) row_bytes_ += sizeof(float);
  if (!columns.quality.empty()) row_bytes_ += sizeof(float);
  for (const AttributeSpec& spec : columns.attributes) row_bytes_ += static_cast<std::size_t>(byte_size(spec.type));
}

void RowCodec::require_writable(const SampleBatch& batch, std::uint64_t first, const std::string& name) const {
  if (batch.attributes.size() != columns_.attributes.size()) {
    throw Error(ExitCode::internal, fmt::format("{}: rows of {} attributes came, {} were announced", name,
                                                batch.attributes.size(), columns_.attributes.size()));
  }
  for_each_column(columns_, batch, [&](std::string_view column, ScalarType type, const auto& values) {
    if (values.size() != batch.size()) {
      throw Error(ExitCode::internal, fmt::format("{}: {} of {} rows have a value '{}' from row {} on", name,
                                                  values.size(), batch.size(), column, first));
    }
    const auto bad = std::find_if(values.begin(), values.end(), [&](auto v) { return !fits(type, v); });
    if (bad != values.end()) {
      throw Error(ExitCode::internal,
                  fmt::format("{}: row {} would get {} = {}, which must not be written", name,
                              first + static_cast<std::uint64_t>(bad - values.begin()), column, *bad));
    }
  });
}

void RowCodec::encode(const SampleBatch& batch, std::size_t first, std::size_t count, std::byte* out) const {
  for (std::size_t done = 0; done < count; done += kEncodedRows) {
    const std::size_t n = std::min(kEncodedRows, count - done);
    std::byte* column_start = out + done * row_bytes_;
    for_each_column(columns_, batch, [&](std::string_view, ScalarType type, const auto& values) {
      with_scalar_type(type, [&](auto zero) {
        using T = decltype(zero);
        std::byte* to = column_start;
        for (std::size_t i = first + done; i < first + done + n; ++i, to += row_bytes_) {
          store_little(to, to_scalar<T>(values[i]));
        }
        column_start += sizeof(T);
      });
    });
  }
}

void RowCodec::decode(const std::byte* rows, std::size_t stride, std::size_t count, SampleBatch& out) const {
  const AttributeLayout& layout = columns_.attributes;
  out.attributes.resize(layout.size());
  out.exact.resize(layout.size());
  for (std::size_t a = 0; a < layout.size(); ++a) out.exact[a].resize(fits_float(layout[a].type) ? 0 : count);
  const std::byte* from = rows;
  for_each_column(columns_, out, [&](std::string_view, ScalarType type, auto& values) {
    values.resize(count);
    convert_column(type, false, from, stride, count, values.data());
    from += byte_size(type);
  });
  if (!columns_.normals) out.nx.clear(), out.ny.clear(), out.nz.clear();
  if (columns_.radius.empty()) out.radius.clear();
  if (columns_.quality.empty()) out.quality.clear();
  for (std::size_t a = 0; a < layout.size(); ++a) {
    if (fits_float(layout[a].type)) continue;
    out.attributes[a].assign(out.exact[a].begin(), out.exact[a].end());
  }
}

}  // namespace lamina
