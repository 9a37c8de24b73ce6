// What tests of readers ask again and again: all rows of a file, its refusal, its attribute names.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
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

inline std::vector<std::string> attribute_names(const PointSourceInfo& info) {
  std::vector<std::string> names;
  for (const AttributeSpec& spec : info.attributes) names.push_back(spec.name);
  return names;
}

}  // namespace lamina::test
