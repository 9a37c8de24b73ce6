#include "chunks/part_identity.h"

#include <fmt/format.h>

#include "lamina/error.h"
#include "lamina/run.h"
#include "reconstruct/stored_cloud.h"
#include "samples/cleaning.h"

namespace lamina {

std::string mesh_settings(const SurfaceSettings& settings) {
  // Every setting by name: one that is added must be dealt with here, or this does not compile. What follows `chord`
  // does not change the mesh; names of files are not settings of it.
  const auto& [input, more_inputs, open, reading, output, more_outputs, receiver, frame, bad_samples, normals,
               normal_search, align, guess_trade, radius_scale, density, clean, max_radius, blend, refit, steps,
               step_tolerance, fit, diffuse, cell, levels, boundary, cluster, chord, vertex_levels, vertex_curvature,
               vertex_filled, close_holes, watertight, bridge, fill_all, trim, features, prune_triangles, prune_size, local,
               window, dry_run, rejected, simplify, deviation, volume, tiles] = settings;
  // Jobs of several runs refuse these: require_mesh_alone().
  (void)prune_triangles, (void)prune_size, (void)local, (void)tiles, (void)open, (void)receiver, (void)rejected;
  (void)input, (void)more_inputs, (void)output, (void)more_outputs, (void)normals, (void)normal_search,
      (void)guess_trade, (void)window, (void)dry_run;
  (void)simplify;  // is for what joins the parts
  const auto number = [](const std::optional<double>& v) { return v ? fmt::format("{}", *v) : "auto"; };
  const auto word = [](const std::optional<bool>& v) { return v ? (*v ? "yes" : "no") : "auto"; };
  const std::string frame_word = frame             ? fmt::format("{}", static_cast<int>(*frame))
                                 : volume.wanted() ? "grid"
                                                   : "auto";
  return fmt::format(
      "columns {}\nprojected {}\nselect {}\nframe {}\nbad_samples {}\nnormals {}\nalign {}\ncleaning {}\nparticlescale "
      "{}\ndensity "
      "{}\nmax_radius {}\n"
      "blend {}\nrefit {}\nsteps {}\nstep_tolerance {}\nfit {}\ndiffuse {}\ncell {}\nlevels {}\nboundary {}\ncluster "
      "{}\n"
      "chord {}\nlevel {}\ncurvature {}\nfilled {}\nclose_holes {}\nwatertight {}\nbridge {}\nfill_all {}\ntrim {}\nfeatures {}\n"
      "deviation {}\n",
      reading.columns, reading.project_degrees, to_string(reading.select), frame_word, static_cast<int>(bad_samples),
      normals_words(settings), align, cleaning_words(clean), radius_scale, density, to_string(max_radius),
      number(blend), number(refit), steps, step_tolerance, static_cast<int>(fit), diffuse,
      cell ? to_string(*cell) : "auto", levels, boundary, static_cast<int>(cluster), chord, vertex_levels,
      vertex_curvature, vertex_filled, number(close_holes), word(watertight), word(bridge), fill_all, number(trim), word(features),
      number(deviation));
}

std::uint64_t job_hash(const SurfaceSettings& settings, const std::string& input_id, const ReconstructionPlan& plan) {
  const std::string text =
      fmt::format("{}\n{}\n{}\nlattice {} {} radii {} {}\n", version(), input_id, mesh_settings(settings),
                  plan.lattice.cell, plan.lattice.levels, plan.radii.finest_cell, plan.radii.levels);
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  return hash;
}

void require_mesh_alone(const SurfaceSettings& settings, const std::string& option) {
  if (settings.volume.wanted()) {
    throw Error(ExitCode::usage,
                fmt::format("{} makes the mesh alone: leave --vdb and --vdb-points to a run of their own", option));
  }
  if (!settings.tiles.folder.empty()) {
    throw Error(ExitCode::usage,
                fmt::format("{} makes the mesh alone: leave --tiles away, and make them of it: lamina tiles", option));
  }
  if (settings.prune_triangles.value_or(0) > 0 || settings.prune_size.value > 0 || settings.local)
    throw Error(ExitCode::usage,
                fmt::format("{}: --prune, --prune-size and --local want the mesh from one run", option));
  if (!settings.rejected.empty())
    throw Error(ExitCode::usage, fmt::format("{}: --rejected wants the whole cloud in one run", option));
  if (settings.open || settings.receiver)
    throw Error(ExitCode::usage, fmt::format("{} wants files: what is in memory is gone with the run", option));
  if (settings.dry_run) throw Error(ExitCode::usage, fmt::format("{} and --dry-run contradict each other", option));
}

}  // namespace lamina
