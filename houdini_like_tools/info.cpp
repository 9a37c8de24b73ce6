// lamina info: what is in a file.
#include "lamina/info.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/text.h"
#include "lamina/volume_tools.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct InfoOptions {
  std::string input;
  PointSettings reading;
  bool json = false;
  RunOptions run;
};

using Json = nlohmann::ordered_json;

const char* type_word(ScalarType type) {
  switch (type) {
    case ScalarType::int8:
      return "int8";
    case ScalarType::uint8:
      return "uint8";
    case ScalarType::int16:
      return "int16";
    case ScalarType::uint16:
      return "uint16";
    case ScalarType::int32:
      return "int32";
    case ScalarType::uint32:
      return "uint32";
    case ScalarType::float32:
      return "float";
    case ScalarType::float64:
      return "double";
  }
  return "";
}

Json as_json(const std::vector<ColumnRange>& columns) {
  Json list = Json::array();
  for (const ColumnRange& c : columns) {
    list.push_back({{"name", c.name},
                    {"type", type_word(c.type)},
                    {"low", c.low},
                    {"high", c.high},
                    {"mean", c.mean},
                    {"not_finite", c.not_finite}});
  }
  return list;
}

Json as_json(const std::string& path, const PointsInfo& info) {
  Json j{{"file", path},    {"content", "points"}, {"points", info.count}, {"bad_rows", info.bad_rows},
         {"crs", info.crs}, {"low", info.low},     {"high", info.high},    {"attributes", as_json(info.columns)}};
  j["radii"] = Json::array();
  for (const HistogramBin& b : info.radii) j["radii"].push_back({{"low", b.low}, {"high", b.high}, {"count", b.count}});
  return j;
}

Json as_json(const std::string& path, const MeshInfo& info) {
  return {{"file", path},    {"content", "mesh"}, {"vertices", info.vertices},          {"triangles", info.triangles},
          {"low", info.low}, {"high", info.high}, {"attributes", as_json(info.columns)}};
}

void print_box(const std::array<double, 3>& low, const std::array<double, 3>& high) {
  fmt::print("{:<12} {:.9g} {:.9g} {:.9g}  to  {:.9g} {:.9g} {:.9g}\n", "box", low[0], low[1], low[2], high[0], high[1],
             high[2]);
  fmt::print("{:<12} {:.6g} x {:.6g} x {:.6g}\n", "size", high[0] - low[0], high[1] - low[1], high[2] - low[2]);
}

void print_columns(const std::vector<ColumnRange>& columns) {
  fmt::print("{:<16} {:<8} {:>14} {:>14} {:>14}\n", "attribute", "type", "low", "high", "mean");
  for (const ColumnRange& c : columns) {
    fmt::print("{:<16} {:<8} {:>14.9g} {:>14.9g} {:>14.9g}{}\n", c.name, type_word(c.type), c.low, c.high, c.mean,
               c.not_finite > 0 ? fmt::format("  {} not finite", c.not_finite) : "");
  }
}

void print_radii(const std::vector<HistogramBin>& bins) {
  if (bins.empty()) return;
  constexpr std::uint64_t kWidth = 40;
  std::uint64_t most = 1;
  for (const HistogramBin& b : bins) most = std::max(most, b.count);
  fmt::print("radii\n");
  for (const HistogramBin& b : bins) {
    const std::string bar(static_cast<std::size_t>(static_cast<double>(kWidth * b.count) / static_cast<double>(most)),
                          '#');
    fmt::print("  {:>10.4g} .. {:<10.4g} {:>12} {}\n", b.low, b.high, b.count, bar);
  }
}

void print(const std::string& path, const PointsInfo& info) {
  fmt::print("{}: {} points\n", path, info.count);
  if (info.count == 0) return;
  print_box(info.low, info.high);
  if (!info.crs.empty()) fmt::print("{:<12} {}\n", "crs", crs_name(info.crs));
  if (info.bad_rows > 0) fmt::print("{:<12} {} rows are not finite; the tools leave them out\n", "bad", info.bad_rows);
  print_columns(info.columns);
  if (info.normal_length_high > 0)
    fmt::print("{:<12} {:.4g} to {:.4g}\n", "normals", info.normal_length_low, info.normal_length_high);
  print_radii(info.radii);
}

void print(const std::string& path, const MeshInfo& info) {
  fmt::print("{}: mesh of {} vertices, {} triangles\n", path, info.vertices, info.triangles);
  print_box(info.low, info.high);
  print_columns(info.columns);
}

Json as_json(const GridInfo& g) {
  Json j{{"name", g.name},
         {"type", g.type},
         {"class", g.grid_class},
         {"half", g.half},
         {"active_voxels", g.active_voxels},
         {"active_tiles", g.active_tiles},
         {"leaf_nodes", g.leaf_nodes},
         {"internal_nodes", g.internal_nodes},
         {"leaf_fill", g.leaf_fill},
         {"memory_bytes", g.memory_bytes},
         {"index_low", g.index_low},
         {"index_high", g.index_high},
         {"low", g.world_low},
         {"high", g.world_high},
         {"voxel", g.voxel},
         {"transform_type", g.transform_type},
         {"index_to_world", g.index_to_world},
         {"value_low", g.value_low},
         {"value_high", g.value_high},
         {"points", g.point_count}};
  j["attributes"] = Json::object();
  for (const auto& [name, type] : g.attributes) j["attributes"][name] = type;
  j["metadata"] = Json::object();
  for (const auto& [name, value] : g.metadata) j["metadata"][name] = value;
  return j;
}

Json as_json(const std::string& path, const VolumeInfo& info) {
  Json j{{"file", path}, {"content", "volume"}, {"version", info.version}, {"bytes", info.bytes}};
  j["grids"] = Json::array();
  for (const GridInfo& g : info.grids) j["grids"].push_back(as_json(g));
  return j;
}

void print(const GridInfo& g) {
  const auto row = [](const char* label, const std::string& value) { fmt::print("  {:<12} {}\n", label, value); };
  fmt::print("grid '{}': {}, {}{}{}\n", g.name, g.type, g.grid_class, g.half ? ", 16-bit" : "",
             g.open ? ", open: a band only near data" : "");
  if (g.points) row("points", fmt::format("{}", g.point_count));
  row("voxels", fmt::format("{} active, {} active tiles", g.active_voxels, g.active_tiles));
  row("tree", fmt::format("{} leaves {:.0f} % full, {} inner nodes, {}", g.leaf_nodes, 100 * g.leaf_fill,
                          g.internal_nodes, bytes_text(g.memory_bytes)));
  row("transform",
      fmt::format("{}, voxel {:.6g} x {:.6g} x {:.6g}", g.transform_type, g.voxel[0], g.voxel[1], g.voxel[2]));
  row("box", fmt::format("{:.9g} {:.9g} {:.9g}  to  {:.9g} {:.9g} {:.9g}", g.world_low[0], g.world_low[1],
                         g.world_low[2], g.world_high[0], g.world_high[1], g.world_high[2]));
  if (!g.points) row("values", fmt::format("{:.6g} to {:.6g}, background {}", g.value_low, g.value_high, g.background));
  for (const auto& [name, type] : g.attributes) row("attribute", fmt::format("{} {}", name, type));
  for (const auto& [name, value] : g.metadata) row("metadata", fmt::format("{} = {}", name, value));
}

void print(const std::string& path, const VolumeInfo& info) {
  fmt::print("{}: {} {}, format {}, {}\n", path, info.grids.size(), info.grids.size() == 1 ? "grid" : "grids",
             info.version, bytes_text(info.bytes));
  for (const GridInfo& g : info.grids) print(g);
}

template <class Info>
void show(const InfoOptions& o, const Info& info) {
  const std::string name = shown_name(o.input);
  if (o.json) {
    fmt::print("{}\n", as_json(name, info).dump(2));
  } else {
    print(name, info);
  }
}

void run_info(const InfoOptions& o) {
  const RunContext context = make_context(o.run);
  switch (content_of(o.input, o.run.tmp_dir)) {
    case FileContent::points:
      return show(o, describe_points(*open_point_input(o.input, o.reading, context), context));
    case FileContent::mesh:
      return show(o, describe_mesh(read_mesh_input(o.input, context, NonFinite::keep)));
    case FileContent::volume:
      return show(o, describe_volume(o.input));
  }
}

}  // namespace

void add_info(CLI::App& app) {
  auto* tool = app.add_subcommand("info", "Tell what is in a file: counts, box, attributes and their ranges");
  auto o = std::make_shared<InfoOptions>();
  tool->add_option_function<std::string>(
          "INPUT", [o](const std::string& name) { o->input = pipe_name(name); },
          "Points, mesh or volume (.vdb); - for PLY on standard input")
      ->required()
      ->type_name("");
  tool->add_flag("--json", o->json, "Print JSON");
  add_point_options(*tool, o->reading);
  add_run_options(*tool, o->run);
  add_notes(*tool,
            "Tells the number of points, vertices or voxels, the box, every attribute with its type and range, and a "
            "histogram of the radii; of a .vdb every grid with its tree, transform and metadata. Points are read in "
            "batches, meshes are held.");
  add_examples(*tool, "  lamina info scan.ply\n  lamina info mesh.ply --json");
  tool->callback([o] { run_info(*o); });
}

}  // namespace lamina::tools
