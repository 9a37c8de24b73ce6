#include "common/stats.h"

namespace lamina::tools {
namespace {

void add_cleaning(nlohmann::ordered_json& j, const SurfaceStats& s, const SurfaceSettings& settings) {
  const CleanCounts& c = s.cleaned;
  j["cleaned"] = {{"clipped", c.clipped},
                  {"skipped", c.skipped},
                  {"merged", c.merged},
                  {"outliers", c.outliers},
                  {"outlier_distance", c.outlier_distance},
                  {"lonely", c.lonely},
                  {"off_surface", c.off_surface},
                  {"thinned", c.thinned}};
  if (settings.prune_triangles.value_or(1) > 0 || settings.prune_size.value > 0) {
    j["pruned"] = {{"kept_parts", s.pruned.kept},
                   {"removed_parts", s.pruned.removed},
                   {"removed_triangles", s.pruned.removed_triangles}};
  }
  if (settings.local) j["shift"] = s.shift;
}

}  // namespace

nlohmann::ordered_json normals_json(const NormalsReport& r) {
  nlohmann::ordered_json j;
  j["samples"] = r.samples;
  j["estimated"] = r.estimated;
  j["flipped"] = r.flipped;
  j["without_normal"] = r.without;
  j["sign_from"] = {{"viewpoint", r.by_viewpoint}, {"given", r.by_given}, {"outside", r.by_outside},
                    {"inside", r.by_inside},       {"up", r.by_up},       {"sight", r.by_sight},
                    {"unsure", r.unsure}};
  j["patches"] = r.patches;
  j["components"] = r.components;
  j["sign_conflicts"] = {
      {"pairs", r.conflicts.pairs}, {"conflicts", r.conflicts.conflicts}, {"share", r.conflicts.share()}};
  j["sign_conflicts"]["worst_slab"] = r.worst_slab();
  auto& slabs = j["sign_conflicts"]["slabs"] = nlohmann::ordered_json::array();
  for (const SignConflicts& slab : r.slabs)
    slabs.push_back({{"pairs", slab.pairs}, {"conflicts", slab.conflicts}, {"share", slab.share()}});
  return j;
}

nlohmann::ordered_json holes_json(const HoleStats& h) {
  nlohmann::ordered_json j{{"closed", h.closed},
                           {"closed_edges", h.closed_edges},
                           {"added_vertices", h.vertices},
                           {"added_triangles", h.triangles},
                           {"invented", h.invented},
                           {"invented_edges", h.invented_edges},
                           {"invented_vertices", h.invented_vertices},
                           {"invented_triangles", h.invented_triangles},
                           {"open", h.open},
                           {"open_edges", h.open_edges},
                           {"open_length", h.open_length}};
  j["longest_open"] = nlohmann::ordered_json::array();
  for (const OpenLoop& loop : h.longest) {
    j["longest_open"].push_back({{"position", loop.position},
                                 {"length", loop.length},
                                 {"radii", loop.radii},
                                 {"edges", loop.edges},
                                 {"why", loop.reason}});
  }
  return j;
}

nlohmann::ordered_json ranks_json(const std::vector<RankStats>& ranks) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const RankStats& s : ranks) {
    list.push_back({{"rows_read", s.rows_read},
                    {"samples", s.samples},
                    {"samples_held", s.samples_held},
                    {"first_slab", s.first_slab},
                    {"slabs", s.slabs},
                    {"overlap_slabs", s.overlap_slabs},
                    {"vertices", s.vertices},
                    {"triangles", s.triangles},
                    {"wall_seconds", s.seconds},
                    {"cpu_seconds", s.cpu},
                    {"sweep_seconds", s.sweeping},
                    {"waited_seconds", s.waited},
                    {"peak_memory_bytes", s.peak_memory},
                    {"sent_bytes", s.sent},
                    {"received_bytes", s.received}});
  }
  return list;
}

nlohmann::ordered_json stats_json(const SurfaceStats& s, const SurfaceSettings& settings) {
  nlohmann::ordered_json j;
  j["input"] = settings.input;
  if (!settings.more_inputs.empty()) j["more_inputs"] = settings.more_inputs;
  j["output"] = settings.output;
  if (!settings.more_outputs.empty()) j["more_outputs"] = settings.more_outputs;
  j["dry_run"] = settings.dry_run;
  j["crs"] = s.crs;
  j["samples"] = s.samples_read;
  j["samples_used"] = s.plan.samples;
  j["vertices"] = s.vertices;
  j["triangles"] = s.triangles;
  j["levels"] = s.plan.levels;
  j["leaf_cells_by_level"] = s.leaf_cells;
  j["noise"] = s.plan.noise;
  j["noise_p90"] = s.plan.high_noise;
  j["noisiest"] = {{"noise", s.plan.worst_noise}, {"position", s.plan.noisiest}};
  j["normal_noise"] = s.plan.normal_noise;
  j["scans"] = {{"count", s.plan.scans},       {"overlap", s.plan.overlap},    {"places", s.alignment.places},
                {"apart", s.alignment.before}, {"aligned", s.alignment.after}, {"moved", s.alignment.farthest}};
  j["blend"] = s.plan.blend;
  j["blend_range"] = {s.plan.least_blend, s.plan.most_blend};
  j["refit"] = s.plan.refit;
  j["cell"] = to_string(s.plan.cell);
  j["sheet_refinement"] = s.plan.refine_sheets;
  j["watertight"] = s.plan.watertight;
  j["bridge"] = s.plan.bridge;
  j["trim"] = s.plan.trim;
  j["features"] = s.plan.features;
  j["deviation"] = s.plan.deviation;
  j["lines"] = s.plan.lines;
  j["blurred_normals"] = s.plan.blurred_normals;
  j["close_holes"] = s.plan.longest_rim;
  j["finest_cell"] = s.plan.finest_cell;
  j["slab_height"] = s.plan.slab_height;
  j["slabs"] = s.plan.slabs;
  j["radius"] = {{"p01", s.plan.radius_low}, {"median", s.plan.radius_median}, {"p99", s.plan.radius_high}};
  j["wall_seconds"] = s.wall;
  j["cpu_seconds"] = s.cpu;
  j["threads"] = s.threads;
  j["partly_idle_seconds"] = s.partly_idle;
  j["peak_memory_bytes"] = s.peak_memory;
  j["expected_memory_bytes"] = s.plan.memory_bytes;
  j["temporary_disk_bytes"] = s.disk_bytes;
  j["expected_disk_bytes"] = s.plan.disk_bytes;
  j["expected_seconds"] = s.plan.seconds;
  j["stages"] = nlohmann::ordered_json::array();
  for (const StageTime& t : s.stages)
    j["stages"].push_back({{"stage", t.stage}, {"wall", t.wall}, {"cpu", t.cpu}, {"partly_idle", t.partly_idle}});
  j["rejected"] = nlohmann::ordered_json::array();
  for (const Rejected& r : s.rejected) {
    nlohmann::ordered_json entry{{"reason", r.reason}, {"count", r.count}};
    if (r.first_row) entry["first_row"] = *r.first_row;
    j["rejected"].push_back(entry);
  }
  add_cleaning(j, s, settings);
  j["replaced_attribute_values"] = s.replaced_attributes;
  j["corners"] = {
      {"projected", s.corners}, {"seen", s.corners_seen}, {"trusted", s.corners_trusted}, {"sums", s.corner_sums}};
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
  if (!settings.tiles.folder.empty()) {
    j["tiles"] = {{"folder", settings.tiles.folder}, {"tiles", s.tiles.tiles},         {"leaves", s.tiles.leaves},
                  {"levels", s.tiles.levels},        {"triangles", s.tiles.triangles}, {"bytes", s.tiles.bytes},
                  {"error", s.tiles.error},          {"on_earth", s.tiles.on_earth}};
  }
  j["clusters"] = {{"seen", s.clusters.corners},
                   {"collapsed", s.clusters.collapsed},
                   {"patches", s.clusters.patches},
                   {"kept_isovertices", s.clusters.kept_isovertices},
                   {"resolved", s.clusters.resolved}};
  j["holes"] = holes_json(s.holes);
  if (s.simplified.triangles_before > 0) {
    j["simplified"] = {{"triangles_before", s.simplified.triangles_before},
                       {"triangles_after", s.simplified.triangles_after},
                       {"reached", s.simplified.reached},
                       {"largest_deviation", s.simplified.deviation}};
  }
  return j;
}

}  // namespace lamina::tools
