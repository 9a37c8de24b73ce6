#include "points/point_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include "lamina/error.h"
#include "points/input_file.h"

namespace lamina {
namespace {

using namespace std::string_view_literals;

constexpr std::array kAliases{std::pair{"r"sv, "red"sv},
                              std::pair{"g"sv, "green"sv},
                              std::pair{"b"sv, "blue"sv},
                              std::pair{"a"sv, "alpha"sv},
                              std::pair{"rf"sv, "red"sv},
                              std::pair{"gf"sv, "green"sv},
                              std::pair{"bf"sv, "blue"sv},
                              std::pair{"diffuse_red"sv, "red"sv},
                              std::pair{"diffuse_green"sv, "green"sv},
                              std::pair{"diffuse_blue"sv, "blue"sv},
                              std::pair{"normal_x"sv, "nx"sv},
                              std::pair{"normal_y"sv, "ny"sv},
                              std::pair{"normal_z"sv, "nz"sv},
                              std::pair{"normalx"sv, "nx"sv},
                              std::pair{"normaly"sv, "ny"sv},
                              std::pair{"normalz"sv, "nz"sv},
                              std::pair{"normals:0"sv, "nx"sv},
                              std::pair{"normals:1"sv, "ny"sv},
                              std::pair{"normals:2"sv, "nz"sv},
                              std::pair{"rgb:0"sv, "red"sv},
                              std::pair{"rgb:1"sv, "green"sv},
                              std::pair{"rgb:2"sv, "blue"sv},
                              std::pair{"n[x]"sv, "nx"sv},
                              std::pair{"n[y]"sv, "ny"sv},
                              std::pair{"n[z]"sv, "nz"sv},
                              std::pair{"n.x"sv, "nx"sv},
                              std::pair{"n.y"sv, "ny"sv},
                              std::pair{"n.z"sv, "nz"sv},
                              std::pair{"i"sv, "intensity"sv},
                              std::pair{"scalar_intensity"sv, "intensity"sv},
                              std::pair{"reflectance"sv, "intensity"sv},
                              std::pair{"remission"sv, "intensity"sv}};

/// What positions are called where nothing is called x, y and z: by surveyors, in tables of Houdini and ParaView.
constexpr std::array kPlaces{
    std::pair{"easting"sv, "x"sv},  std::pair{"northing"sv, "y"sv}, std::pair{"elevation"sv, "z"sv},
    std::pair{"height"sv, "z"sv},   std::pair{"p.x"sv, "x"sv},      std::pair{"p.y"sv, "y"sv},
    std::pair{"p.z"sv, "z"sv},      std::pair{"points:0"sv, "x"sv}, std::pair{"points:1"sv, "y"sv},
    std::pair{"points:2"sv, "z"sv}, std::pair{"p[x]"sv, "x"sv},     std::pair{"p[y]"sv, "y"sv},
    std::pair{"p[z]"sv, "z"sv}};

constexpr std::array kUnits{"m"sv,  "mm"sv, "cm"sv,  "km"sv,  "ft"sv,      "feet"sv, "metre"sv, "metres"sv, "meter"sv,
                            "in"sv, "db"sv, "deg"sv, "rad"sv, "degrees"sv, "s"sv,    "ns"sv,    "us"sv,     "meters"sv};

/// "x" of "x[m]", "x(m)" and "x_(m)".
std::string without_unit(std::string name) {
  const std::size_t open = name.find_last_of("([");
  if (open == std::string::npos || open == 0 || name.back() != (name[open] == '(' ? ')' : ']')) return name;
  const std::string_view unit = std::string_view(name).substr(open + 1, name.size() - open - 2);
  if (std::find(kUnits.begin(), kUnits.end(), unit) == kUnits.end()) return name;
  name.resize(name.find_last_not_of("_ ", open - 1) + 1);
  return name;
}

template <class Names>
std::string renamed(const Names& names, std::string name) {
  const auto known = std::find_if(names.begin(), names.end(), [&](const auto& a) { return a.first == name; });
  return known == names.end() ? name : std::string(known->second);
}

void size_for_rows(const PointSourceInfo& info, RowRange rows, SampleBatch& batch) {
  const std::size_t count = rows.count;
  batch.first = rows.first;
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
}

}  // namespace

std::string usual_name(std::string_view name) {
  while (name.size() >= 2 && (name.front() == '"' || name.front() == '\'') && name.back() == name.front()) {
    name = name.substr(1, name.size() - 2);
  }
  std::string lower;
  for (const char c : name.substr(0, 256)) {
    lower += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c > ' ' && c <= '~' ? c : '_';
  }
  return renamed(kAliases, without_unit(std::move(lower)));
}

std::vector<std::string> names_with_positions(const std::vector<std::string_view>& words) {
  std::vector<std::string> names(words.size());
  std::transform(words.begin(), words.end(), names.begin(), usual_name);
  const auto has = [&](std::string_view name) { return std::find(names.begin(), names.end(), name) != names.end(); };
  const auto has_all = [&] { return has("x") && has("y") && has("z"); };
  if (has_all()) return names;
  for (std::string& name : names) name = renamed(kPlaces, std::move(name));
  return has_all() ? names : std::vector<std::string>{};
}

void use_usual_names(std::vector<PointColumn>& columns) {
  constexpr std::array<std::array<std::string_view, 3>, 3> kTriples{
      {{"x", "y", "z"}, {"nx", "ny", "nz"}, {"red", "green", "blue"}}};
  for (const auto& triple : kTriples) {
    const auto known = [&](std::string_view name) {
      return std::find(triple.begin(), triple.end(), name) != triple.end();
    };
    if (std::any_of(columns.begin(), columns.end(), [&](const PointColumn& c) { return known(c.name); })) continue;
    const auto is_one = [&](std::string_view name) {
      return std::count_if(columns.begin(), columns.end(),
                           [&](const PointColumn& c) { return usual_name(c.name) == name; }) == 1;
    };
    if (!std::all_of(triple.begin(), triple.end(), is_one)) continue;
    for (PointColumn& column : columns) {
      if (known(usual_name(column.name))) column.name = usual_name(column.name);
    }
  }
}

bool has_column(const std::vector<PointColumn>& columns, std::string_view name) {
  return std::any_of(columns.begin(), columns.end(), [&](const PointColumn& c) { return c.name == name; });
}

void give_roles(std::vector<PointColumn>& columns, PointSourceInfo& info, const std::string& file,
                std::string_view noun) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ExitCode::unreadable, fmt::format("{}: {}", file, what));
  };
  std::set<std::string_view> names;
  for (const PointColumn& column : columns) {
    if (column.role != Role::skipped && !names.insert(column.name).second) {
      refuse(fmt::format("{} {} of the points is there twice", noun, quoted_word(column.name)));
    }
  }
  const auto has = [&](std::string_view wanted) { return names.contains(wanted); };
  for (const char* axis : {"x", "y", "z"}) {
    if (!has(axis)) refuse(fmt::format("the points have no {} '{}'; points need x y z", noun, axis));
  }
  const int normals = int{has("nx")} + int{has("ny")} + int{has("nz")};
  if (normals == 1 || normals == 2) {
    refuse("the points' normals are incomplete: nx ny nz are needed, or none of them");
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
  for (PointColumn& column : columns) {
    if (column.role == Role::skipped) continue;
    const auto known =
        std::find_if(roles.begin(), roles.end(), [&](const auto& entry) { return entry.first == column.name; });
    if (known != roles.end()) {
      column.role = known->second;
    } else {
      column.role = Role::attribute;
      column.attribute = info.attributes.size();
      info.attributes.push_back({column.name, column.type});
    }
    if (column.role <= Role::z && column.type == ScalarType::float64) info.double_precision = true;
  }
}

RowRange rows_there(const PointSourceInfo& info, std::uint64_t first, std::size_t count) {
  first = std::min(first, info.count);
  return {first, static_cast<std::size_t>(std::min<std::uint64_t>(count, info.count - first))};
}

std::vector<ColumnTarget> prepare_batch(const PointSourceInfo& info, const std::vector<PointColumn>& columns,
                                        RowRange rows, SampleBatch& batch) {
  size_for_rows(info, rows, batch);
  std::vector<ColumnTarget> targets;
  targets.reserve(columns.size());
  for (const PointColumn& column : columns) {
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
        if (fits_float(info.attributes[column.attribute].type)) {
          targets.push_back({.narrow = batch.attributes[column.attribute].data()});
        } else {
          targets.push_back({.wide = batch.exact[column.attribute].data()});
        }
        break;
      case Role::skipped:
        targets.push_back({});
        break;
    }
  }
  return targets;
}

void keep_rows(SampleBatch& batch, const std::vector<std::uint8_t>& keep) {
  for_columns(batch, batch, [&](auto& values, auto&) {
    if (values.empty()) return;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < keep.size(); ++i) {
      if (keep[i] != 0) values[kept++] = values[i];
    }
    values.resize(kept);
  });
}

void round_exact_attributes(SampleBatch& batch) {
  for (std::size_t a = 0; a < batch.exact.size(); ++a) {
    std::transform(batch.exact[a].begin(), batch.exact[a].end(), batch.attributes[a].begin(),
                   [](double value) { return static_cast<float>(value); });
  }
}

}  // namespace lamina
