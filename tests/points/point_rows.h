// What tests of readers ask again and again: all rows of a file, its refusal, its attribute names.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "lamina/error.h"
#include "lamina/points.h"

namespace lamina::test {

/// Every row, read in pieces of `piece`.
inline SampleBatch all_rows(PointSource& source, std::size_t piece = 1 << 16) {
  SampleBatch all;
  SampleBatch batch;
  const PointSourceInfo& info = source.info();
  all.attributes.resize(info.attributes.size());
  all.exact.resize(info.attributes.size());
  for (std::uint64_t first = 0; first < info.count; first += batch.size()) {
    source.read(first, piece, batch);
    EXPECT_EQ(batch.first, first);
    EXPECT_EQ(batch.size(), std::min<std::uint64_t>(piece, info.count - first));
    if (batch.size() == 0) break;
    const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    append(all.x, batch.x);
    append(all.y, batch.y);
    append(all.z, batch.z);
    append(all.nx, batch.nx);
    append(all.ny, batch.ny);
    append(all.nz, batch.nz);
    append(all.radius, batch.radius);
    append(all.quality, batch.quality);
    for (std::size_t a = 0; a < info.attributes.size(); ++a) {
      append(all.attributes[a], batch.attributes[a]);
      append(all.exact[a], batch.exact[a]);
    }
  }
  return all;
}

inline SampleBatch all_rows(const std::string& path, const PointSettings& settings = {}) {
  return all_rows(*open_points(path, settings));
}

/// The message of the Error that opening and reading end with; empty when they do not.
inline std::string refusal(const std::string& path, const PointSettings& settings = {}) {
  try {
    all_rows(path, settings);
  } catch (const Error& e) {
    EXPECT_TRUE(e.code() == ExitCode::unreadable || e.code() == ExitCode::usage) << e.what();
    EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    return e.what();
  }
  return "";
}

/// `n` rows of the columns: colours and other integers over their type's range, normals of unit length.
inline SampleBatch random_rows(const PointColumns& columns, std::size_t n, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<> normal(0, 20);
  SampleBatch rows;
  rows.attributes.resize(columns.attributes.size());
  rows.exact.resize(columns.attributes.size());
  for (std::size_t i = 0; i < n; ++i) {
    for (auto* axis : {&rows.x, &rows.y, &rows.z}) {
      const double value = 400'000 + normal(random);
      axis->push_back(columns.double_positions ? value : static_cast<float>(value));
    }
    const double v[3] = {normal(random), normal(random), normal(random)};
    const double length = std::hypot(v[0], v[1], v[2]);
    if (columns.normals) {
      rows.nx.push_back(static_cast<float>(v[0] / length));
      rows.ny.push_back(static_cast<float>(v[1] / length));
      rows.nz.push_back(static_cast<float>(v[2] / length));
    }
    if (!columns.radius.empty()) rows.radius.push_back(static_cast<float>(std::abs(v[0])));
    if (!columns.quality.empty()) rows.quality.push_back(static_cast<float>(std::abs(v[1])));
    for (std::size_t a = 0; a < columns.attributes.size(); ++a) {
      const ScalarType type = columns.attributes[a].type;
      const bool floating = type == ScalarType::float32 || type == ScalarType::float64;
      const bool is_signed = type == ScalarType::int8 || type == ScalarType::int16 || type == ScalarType::int32;
      const double span = std::exp2(8 * byte_size(type));
      const double whole =
          std::floor(std::uniform_real_distribution<>(0, 1)(random) * span) - (is_signed ? span / 2 : 0);
      const double value = type == ScalarType::float64 ? v[2] : floating ? static_cast<float>(v[2]) : whole;
      rows.attributes[a].push_back(static_cast<float>(value));
      if (!fits_float(type)) rows.exact[a].push_back(value);
    }
  }
  return rows;
}

/// Writes the rows in one piece or, with `count` known, after an empty one.
inline void write_rows(const std::string& path, const PointColumns& columns, const SampleBatch& rows,
                       const PointsWriterSettings& settings = {}) {
  const auto writer = open_points_writer(path, columns, settings);
  if (settings.count) writer->append(random_rows(columns, 0, 1));
  writer->append(rows);
  writer->commit();
}

inline std::vector<std::string> attribute_names(const PointSourceInfo& info) {
  std::vector<std::string> names;
  for (const AttributeSpec& spec : info.attributes) names.push_back(spec.name);
  return names;
}

}  // namespace lamina::test
