#include "surface_stats.h"

#include "normal_options.h"
#include "surface_holes.h"

namespace lamina::tools {
namespace {

void add_cleaning(nlohmann::ordered_json& j, const SurfaceStats& s, const SurfaceSettings& settings) {
  const CleanCounts& c = s.cleaned;
  j["cleaned"] = {{"clipped", c.clipped},
                  {"skipped", c.skipped},
                  {"merged", c.merged},
                  {"outliers", c.outliers},
                  {"outlier_distance", c.outlier_distance},
                  {"thinned", c.thinned}};
  if (settings.prune_triangles > 0 || settings.prune_size.value > 0) {
    j["pruned"] = {{"kept_parts", s.pruned.kept},
                   {"removed_parts", s.pruned.removed},
                   {"removed_triangles", s.pruned.removed_triangles}};
  }
  if (settings.local) j["shift"] = s.shift;
}

}  // namespace

nlohmann::ordered_json stats_json(const SurfaceStats& s, const SurfaceSettings& settings) {
  nlohmann::ordered_json j;
  j["input"] = settings.input;
  if (!settings.more_inputs.empty()) j["more_inputs"] = settings.more_inputs;
  j["output"] = settings.output;
  j["dry_run"] = settings.dry_run;
  j["samples"] = s.samples_read;
  j["samples_used"] = s.plan.samples;
  j["vertices"] = s.vertices;
  j["triangles"] = s.triangles;
  j["levels"] = s.plan.levels;
  j["leaf_cells_by_level"] = s.leaf_cells;
  j["noise"] = s.plan.noise;
  j["blend"] = s.plan.blend;
  j["refit"] = s.plan.refit;
  j["cell"] = to_string(s.plan.cell);
  j["thin_cells"] = s.plan.thin_cells;
  j["watertight"] = s.plan.watertight;
  j["finest_cell"] = s.plan.finest_cell;
  j["slab_height"] = s.plan.slab_height;
  j["slabs"] = s.plan.slabs;
  j["radius"] = {{"p01", s.plan.radius_low}, {"median", s.plan.radius_median}, {"p99", s.plan.radius_high}};
  j["wall_seconds"] = s.wall;
  j["cpu_seconds"] = s.cpu;
  j["peak_memory_bytes"] = s.peak_memory;
  j["expected_memory_bytes"] = s.plan.memory_bytes;
  j["temporary_disk_bytes"] = s.disk_bytes;
  j["expected_disk_bytes"] = s.plan.disk_bytes;
  j["expected_seconds"] = s.plan.seconds;
  j["stages"] = nlohmann::ordered_json::array();
  for (const StageTime& t : s.stages) j["stages"].push_back({{"stage", t.stage}, {"wall", t.wall}, {"cpu", t.cpu}});
  j["rejected"] = nlohmann::ordered_json::array();
  for (const Rejected& r : s.rejected) {
    nlohmann::ordered_json entry{{"reason", r.reason}, {"count", r.count}};
    if (r.first_row) entry["first_row"] = *r.first_row;
    j["rejected"].push_back(entry);
  }
  add_cleaning(j, s, settings);
  j["replaced_attribute_values"] = s.replaced_attributes;
  j["corners"] = {
      {"projected", s.corners}, {"seen", s.corners_seen}, {"trusted", s.corners_good}, {"sums", s.corner_sums}};
  j["contradicting_normals"] = {
      {"corners", s.corners_torn}, {"worst_slab", s.torn_slab}, {"worst_share", s.torn_share}};
  j["isosurface"] = {{"vertices", s.isovertices},
                     {"triangles", s.isotriangles},
                     {"crossing_cells", s.crossing_cells},
                     {"general_cells", s.general_cells},
                     {"rejected_loops", s.rejected_loops}};
  if (s.normals) j["normals"] = normals_json(*s.normals);
  if (settings.volume.wanted()) {
    j["volume"] = {{"files", s.volume.files},
                   {"voxelsize", s.volume.voxel},
                   {"voxels", s.volume.voxels},
                   {"points", s.volume.points},
                   {"bytes", s.volume.bytes}};
  }
  j["clusters"] = {{"seen", s.clusters.corners},
                   {"collapsed", s.clusters.collapsed},
                   {"patches", s.clusters.patches},
                   {"kept_isovertices", s.clusters.kept_isovertices},
                   {"hard", s.clusters.hard}};
  j["holes"] = holes_json(s.holes);
  return j;
}

}  // namespace lamina::tools
