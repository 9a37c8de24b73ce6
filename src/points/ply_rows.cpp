#include "points/ply_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>
#include <string_view>

#include "lamina/error.h"

namespace lamina {
namespace {

[[noreturn]] void refuse(const std::string& name, const std::string& what) {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", name, what));
}

std::size_t vertex_element(const PlyHeader& header, const std::string& name) {
  std::size_t found = header.elements.size();
  std::string others;
  for (std::size_t i = 0; i < header.elements.size(); ++i) {
    if (header.elements[i].name == "vertex") {
      if (found != header.elements.size()) refuse(name, "the header has two elements 'vertex'");
      found = i;
    } else if (i < 8) {
      others += (others.empty() ? "" : ", ") + quoted(header.elements[i].name);
    }
  }
  if (found == header.elements.size()) {
    refuse(name,
           fmt::format("the header has no element 'vertex'; its elements are: {}", others.empty() ? "none" : others));
  }
  return found;
}

void require_scalars_named_once(const PlyElement& vertices, const std::string& name) {
  std::set<std::string_view> seen;
  for (const PlyProperty& property : vertices.properties) {
    if (property.list_count) {
      refuse(name, fmt::format("property {} of the vertices is a list; points with lists are not read: remove it",
                               quoted(property.name)));
    }
    if (!seen.insert(property.name).second) {
      refuse(name, fmt::format("property {} of the vertices is there twice", quoted(property.name)));
    }
  }
}

}  // namespace

PlyRows understand_vertices(const PlyHeader& header, const std::string& path, const std::string& name) {
  PlyRows rows;
  rows.element = vertex_element(header, name);
  const PlyElement& vertices = header.elements[rows.element];
  require_scalars_named_once(vertices, name);
  const auto has = [&](std::string_view wanted) {
    return std::any_of(vertices.properties.begin(), vertices.properties.end(),
                       [&](const PlyProperty& p) { return p.name == wanted; });
  };
  for (const char* axis : {"x", "y", "z"}) {
    if (!has(axis)) refuse(name, fmt::format("the vertices have no property '{}'; points need x y z", axis));
  }
  PointSourceInfo& info = rows.info;
  info.path = path;
  info.count = vertices.count;
  const int normals = int{has("nx")} + int{has("ny")} + int{has("nz")};
  if (normals == 1 || normals == 2) {
    refuse(name, "the vertices' normals are incomplete: nx ny nz are needed, or none of them");
  }
  info.has_normals = normals == 3;
  info.has_radius = has("radius") || has("pscale");
  info.has_quality = has("quality") || has("confidence");

  if (info.has_radius) info.radius_name = has("radius") ? "radius" : "pscale";
  if (info.has_quality) info.quality_name = has("quality") ? "quality" : "confidence";

  const std::array<std::pair<std::string_view, Role>, 8> roles{{{"x", Role::x},
                                                                {"y", Role::y},
                                                                {"z", Role::z},
                                                                {"nx", Role::nx},
                                                                {"ny", Role::ny},
                                                                {"nz", Role::nz},
                                                                {info.radius_name, Role::radius},
                                                                {info.quality_name, Role::quality}}};
  for (const PlyProperty& property : vertices.properties) {
    PlyColumn column{property.name, property.type, rows.stride};
    const auto known =
        std::find_if(roles.begin(), roles.end(), [&](const auto& entry) { return entry.first == property.name; });
    if (known != roles.end()) {
      column.role = known->second;
    } else {
      column.attribute = info.attributes.size();
      info.attributes.push_back({property.name, property.type});
    }
    if (column.role <= Role::z && property.type == ScalarType::float64) info.double_precision = true;
    rows.stride += static_cast<std::size_t>(byte_size(property.type));
    rows.columns.push_back(std::move(column));
  }
  return rows;
}

std::vector<ColumnTarget> prepare_batch(const PlyRows& rows, std::uint64_t first, std::size_t count,
                                        SampleBatch& batch) {
  const PointSourceInfo& info = rows.info;
  batch.first = first;
  for (auto* axis : {&batch.x, &batch.y, &batch.z}) axis->resize(count);
  for (auto* normal : {&batch.nx, &batch.ny, &batch.nz}) normal->resize(info.has_normals ? count : 0);
  batch.radius.resize(info.has_radius ? count : 0);
  batch.quality.resize(info.has_quality ? count : 0);
  batch.attributes.resize(info.attributes.size());
  for (auto& attribute : batch.attributes) attribute.resize(count);
  batch.exact.resize(info.attributes.size());
  for (std::size_t a = 0; a < info.attributes.size(); ++a) {
    batch.exact[a].resize(fits_float(info.attributes[a].type) ? 0 : count);
  }

  std::vector<ColumnTarget> targets;
  targets.reserve(rows.columns.size());
  for (const PlyColumn& column : rows.columns) {
    switch (column.role) {
      case Role::x:
        targets.push_back({.wide = batch.x.data()});
        break;
      case Role::y:
        targets.push_back({.wide = batch.y.data()});
        break;
      case Role::z:
        targets.push_back({.wide = batch.z.data()});
        break;
      case Role::nx:
        targets.push_back({.narrow = batch.nx.data()});
        break;
      case Role::ny:
        targets.push_back({.narrow = batch.ny.data()});
        break;
      case Role::nz:
        targets.push_back({.narrow = batch.nz.data()});
        break;
      case Role::radius:
        targets.push_back({.narrow = batch.radius.data()});
        break;
      case Role::quality:
        targets.push_back({.narrow = batch.quality.data()});
        break;
      case Role::attribute:
        if (fits_float(column.type)) {
          targets.push_back({.narrow = batch.attributes[column.attribute].data()});
        } else {
          targets.push_back({.wide = batch.exact[column.attribute].data()});
        }
        break;
    }
  }
  return targets;
}

void round_exact_attributes(SampleBatch& batch) {
  for (std::size_t a = 0; a < batch.exact.size(); ++a) {
    std::transform(batch.exact[a].begin(), batch.exact[a].end(), batch.attributes[a].begin(),
                   [](double value) { return static_cast<float>(value); });
  }
}

void report_short_file(const std::string& name, const std::string& element, std::uint64_t promised,
                       const std::string& held) {
  throw Error(ExitCode::unreadable,
              fmt::format("{}: the header promises {} rows of element {}, the file holds {}: it was cut short or the "
                          "header's count is wrong",
                          name, promised, quoted(element), held));
}

}  // namespace lamina
