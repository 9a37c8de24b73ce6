#include "common/surface_options.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "common/option_values.h"
#include "common/text.h"

namespace lamina::tools {
namespace {

/// 0 stands for as many as needed.
int steps_of(const std::optional<double>& number) {
  if (!number) return 0;
  if (!(*number >= 1 && *number <= 16) || *number != std::floor(*number))
    throw CLI::ValidationError("--steps", fmt::format("{:g}: is neither a whole number in 1..16 nor auto", *number));
  return static_cast<int>(*number);
}

}  // namespace

void add_fit_options(CLI::App& tool, SurfaceSettings& s) {
  const std::string fit = "Fit";
  add_number_or_auto(
      tool, "--blend", "auto",
      "The influence radius R is H times a sample's radius r, H up to 64; noise wants 2 to 3. auto: H, and --cell and "
      "--refit where these are not given, by the cloud's noise and the evenness of its sampling",
      [&s](const std::optional<double>& number) { s.blend = number; })
      ->option_text("H|auto [auto]")
      ->group(fit);
  add_number_or_auto(
      tool, "--refit", "auto",
      "First replace normals by those fitted to the samples within so many radii r, up to 8; 0: keep them; auto: keep "
      "them unless --blend auto finds noise",
      [&s](const std::optional<double>& number) { s.refit = number; })
      ->option_text("RADII|auto [auto; 0 where H is given]")
      ->group(fit);
  add_number_or_auto(tool, "--steps", "1", "Projection steps, 1 to 16; auto: as many as each corner needs, at most 16",
                     [&s](const std::optional<double>& number) { s.steps = steps_of(number); })
      ->option_text("N|auto [1]")
      ->group(fit);
  tool.add_option("--step-tolerance", s.step_tolerance,
                  "With --steps auto: a corner is done when a step moves it no more than T radii r; up to 1")
      ->type_name("T")
      ->capture_default_str()
      ->group(fit);
  tool.add_option("--fit", s.fit, "Surface fitted to the samples around a corner")
      ->transform(words<FitMode>({{"plane", FitMode::plane}, {"sphere", FitMode::sphere}}))
      ->option_text("plane|sphere [sphere]")
      ->group(fit);
  tool.add_flag("--diffuse", s.diffuse, "Project cell centres and average them at the corners: smoother")->group(fit);

  add_yes_no_or_auto(tool, "--features", s.features,
                     "Sharp edges and corners where the samples' normals show them; of clean clouds normals that were "
                     "interpolated over edges are found again; auto: where --blend is auto and finds a clean cloud")
      ->group("Fit");
  const std::string lattice = "Octree";
  tool.add_option_function<std::string>(
          "--cell", [&s](const std::string& text) { s.cell = length_of("--cell", text); },
          "Largest leaf cell: a length, or a multiple of the smallest r or R around")
      ->option_text("LENGTH|Kr|KR [0.9R; chosen with --blend auto]")
      ->group(lattice);
  tool.add_option("--levels", s.levels, "Octree levels, 1 to 12; 0: as the radii ask, at least 4")
      ->type_name("N")
      ->capture_default_str()
      ->group(lattice);
}

void add_hole_options(CLI::App& tool, SurfaceSettings& settings, const std::string& group) {
  settings.close_holes = std::nullopt;
  add_number_or_auto(tool, "--close-holes", "auto",
                     "Close holes with a rim shorter than so many influence radii R where the surface around shows how "
                     "it continues; 0: none; auto: 300, or 8 with --raw. Grids keep their holes",
                     [&settings](const std::optional<double>& radii) { settings.close_holes = radii; })
      ->option_text("RADII|auto [auto]")
      ->group(group);
  add_yes_no_or_auto(
      tool, "--bridge", settings.bridge,
      "Bridge gaps of that length whose rims are too bent to show it, where the surface leads into them from all "
      "around; auto: where --blend is auto and the cloud is of several scans or came without normals, since gaps "
      "in it are what nobody saw")
      ->group(group);
  tool.add_flag("--filled", settings.vertex_filled,
                "Give vertices a property filled: 1 where one was added to close a hole, else 0: 'lamina render "
                "mesh.ply --paint filled'")
      ->group(group);
  tool.add_option_function<std::string>(
          "--fill", [&settings](const std::string& word) { settings.fill_all = word == "all"; },
          "all: close everything, for printing and simulation; what nothing in the data tells how to close is invented "
          "from its rim, and a property invented is 1 at such vertices, else 0; auto: what the data tell")
      ->check(CLI::IsMember({"auto", "all"}).description(""))
      ->type_name("auto|all")
      ->default_str("auto")
      ->group(group);
  add_yes_no_or_auto(
      tool, "--watertight", settings.watertight,
      "Close all holes, whatever lies around, unless a rim longer than 24 influence radii shows that the surface "
      "is an open one, since the surface does not lead into it; auto: where --blend auto finds a clean, even "
      "cloud, with rims longer than that only if its normals had to be found")
      ->group(group);
}

void add_volume_options(CLI::App& tool, VolumeExport& v) {
  const std::string volume = "Volume";
  tool.add_option("--vdb", v.path, "Also write the signed distance as an OpenVDB level set, grid surface")
      ->type_name("OUT.vdb")
      ->group(volume);
  tool.add_option(
          "--vdb-grids", v.grids,
          "Further grids over the same voxels: N, Cd, weight, curvature, any attribute; auto: Cd where the points have "
          "colours")
      ->delimiter(',')
      ->expected(1, -1)
      ->option_text("NAME,... [auto]")
      ->group(volume);
  tool.add_option("--vdb-precision", v.half, "Numbers of 16 or 32 bits")
      ->transform(words<bool>({{"half", true}, {"float", false}}))
      ->option_text("half|float [half]")
      ->group(volume);
  tool.add_option("--vdb-band", v.band, "Half width of the band in voxels, 1 to 8")
      ->type_name("N")
      ->capture_default_str()
      ->group(volume);
  tool.add_option(
          "--vdb-voxelsize", v.voxel,
          "Edge of a voxel: the octree's nearest cell size is taken, and a length more than twice beyond all of them "
          "refused; 0: the size of most cells")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group(volume);
  tool.add_flag("--vdb-levels", v.levels, "One grid per level of the octree, surface_L0 the finest, for inspection")
      ->group(volume);
  tool.add_option_function<std::string>(
          "--vdb-split", [&v](const std::string& text) { v.split = parse_bytes(text); },
          "Begin a new file (OUT.0001.vdb ..., which load as frames) after so many bytes of voxels in memory")
      ->type_name("SIZE")
      ->group(volume);
  tool.add_option(
          "--vdb-points", v.points,
          "Write the projected corners near the surface as an OpenVDB points grid: P, N, Cd, pscale, attributes")
      ->type_name("OUT.vdb")
      ->group(volume);
}

}  // namespace lamina::tools
