// Small clouds and meshes for the tools' tests, and reading back what they wrote.
#pragma once
#include <cmath>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/points.h"
#include "render/shapes.h"
#include "support/program.h"

namespace lamina::test {

/// `count` points on the unit sphere with normals, colours, an exact id and confidence, at the given offset.
inline SampleBatch sphere_rows(std::size_t count, unsigned seed = 1, double offset = 0) {
  std::mt19937 random(seed);
  std::normal_distribution<> normal;
  SampleBatch rows;
  rows.attributes.resize(4);
  rows.exact.resize(4);
  for (std::size_t i = 0; i < count; ++i) {
    const double x = normal(random), y = normal(random), z = normal(random), l = std::hypot(x, y, z);
    rows.x.push_back(offset + x / l), rows.y.push_back(offset + y / l), rows.z.push_back(offset + z / l);
    rows.nx.push_back(static_cast<float>(x / l)), rows.ny.push_back(static_cast<float>(y / l));
    rows.nz.push_back(static_cast<float>(z / l));
    rows.quality.push_back(static_cast<float>(random() % 1000) / 1000);
    for (std::size_t a = 0; a < 3; ++a) rows.attributes[a].push_back(static_cast<float>(random() % 256));
    rows.exact[3].push_back(4e9 - static_cast<double>(i));  // no float holds it
    rows.attributes[3].push_back(static_cast<float>(rows.exact[3].back()));
  }
  return rows;
}

inline PointColumns sphere_columns() {
  PointColumns columns;
  columns.double_positions = true;
  columns.normals = true;
  columns.quality = "confidence";
  columns.attributes = {{"red", ScalarType::uint8},
                        {"green", ScalarType::uint8},
                        {"blue", ScalarType::uint8},
                        {"id", ScalarType::uint32}};
  return columns;
}

inline std::string write_points(const std::string& path, const SampleBatch& rows, const PointColumns& columns) {
  const auto writer = open_points_writer(path, columns);
  writer->append(rows);
  writer->commit();
  return path;
}

inline SampleBatch read_points(const std::string& path) {
  const auto source = open_points(path);
  SampleBatch rows;
  source->read(0, source->info().count, rows);
  return rows;
}

/// Everything a row holds, as text: for comparing clouds as sets.
inline std::vector<std::string> row_texts(const SampleBatch& rows) {
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::string text;
    const auto add = [&](const auto& column) {
      if (column.empty()) return;
      const auto value = column[i];
      text.append(reinterpret_cast<const char*>(&value), sizeof value);
    };
    add(rows.x), add(rows.y), add(rows.z), add(rows.nx), add(rows.ny), add(rows.nz), add(rows.radius);
    add(rows.quality);
    for (const auto& values : rows.attributes) add(values);
    for (const auto& values : rows.exact) add(values);
    texts.push_back(std::move(text));
  }
  return texts;
}

inline std::string sphere_mesh(const std::string& path, double radius = 1, std::uint32_t rings = 12) {
  write_mesh(sphere(radius, rings), path);
  return path;
}

}  // namespace lamina::test
