#include "common/options.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <optional>
#include <vector>

#include "common/text.h"
#include "lamina/error.h"

namespace lamina::tools {
namespace {

std::vector<double> numbers_or_usage(const std::string& name, const std::string& text, const NumbersForm& form) {
  auto values = read_numbers(text, form.separator, form.count);
  if (!values) throw CLI::ValidationError(name, fmt::format("'{}' is not of the form {}", text, form.shown));
  return *values;
}

}  // namespace

std::optional<std::vector<double>> read_numbers(std::string_view text, char separator, std::size_t count) {
  std::vector<double> values(count);
  const char* at = text.data();
  const char* const end = at + text.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0 && (at == end || *at++ != separator)) return std::nullopt;
    const auto [rest, error] = std::from_chars(at, end, values[i]);
    if (error != std::errc{} || !std::isfinite(values[i])) return std::nullopt;
    at = rest;
  }
  if (at != end) return std::nullopt;
  return values;
}

CLI::Option* add_numbers(CLI::App& app, const std::string& name, const NumbersForm& form,
                         const std::string& description, const std::function<void(const std::vector<double>&)>& take) {
  return app
      .add_option_function<std::string>(
          name, [=](const std::string& text) { take(numbers_or_usage(name, text, form)); }, description)
      ->type_name(form.shown);
}

CLI::Option* add_repeated_numbers(CLI::App& app, const std::string& name, const NumbersForm& form,
                                  const std::string& description,
                                  const std::function<void(const std::vector<double>&)>& take) {
  return app
      .add_option_function<std::vector<std::string>>(
          name,
          [=](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) take(numbers_or_usage(name, text, form));
          },
          description)
      ->type_name(form.shown)
      ->allow_extra_args(false);
}

CLI::Option* add_number_or_auto(CLI::App& app, const std::string& name, const std::string& usual,
                                const std::string& description,
                                const std::function<void(const std::optional<double>&)>& take) {
  const auto read = [=](const std::string& text) {
    if (text == "auto") return take(std::nullopt);
    const auto number = read_numbers(text, ',', 1);
    if (!number) throw CLI::ValidationError(name, text + ": is neither a number nor auto");
    take(number->front());
  };
  return app.add_option_function<std::string>(name, read, description)->option_text("FLOAT|auto [" + usual + "]");
}

Length length_of(const std::string& option, const std::string& text) {
  try {
    return parse_length(text);
  } catch (const Error& e) {
    throw CLI::ValidationError(option, e.what());
  }
}

CLI::Option* add_length(CLI::App& app, const std::string& names, Length& value, const std::string& description) {
  const std::string shown = names.substr(names.find_last_of(',') + 1);
  return app
      .add_option_function<std::string>(
          names, [&value, shown](const std::string& text) { value = length_of(shown, text); }, description)
      ->type_name("LENGTH|Kr|KR")
      ->default_str(to_string(value));
}

CLI::Option* add_yes_no_or_auto(CLI::App& app, const std::string& name, std::optional<bool>& value,
                                const std::string& description) {
  return app
      .add_option_function<std::string>(
          name,
          [&value](const std::string& word) { value = word == "auto" ? std::nullopt : std::optional(word == "yes"); },
          description)
      ->check(CLI::IsMember({"auto", "yes", "no"}).description(""))
      ->type_name("auto|yes|no")
      ->default_str("auto");
}

std::string refuse_below_zero(const std::string& text) {
  return text.starts_with('-') ? text + ": is below 0" : "";
}

namespace {

void take_viewpoint(NormalsSettings& settings, const std::string& text) {
  if (text == "pose") {
    settings.pose_origins = true;
  } else if (text == "none") {
    settings.scanners = false;
  } else if (const auto at = read_numbers(text, ',', 3)) {
    settings.viewpoints.push_back({{(*at)[0], (*at)[1], (*at)[2]}, false});
  } else {
    throw CLI::ValidationError("--viewpoint", fmt::format("'{}' is not of the form X,Y,Z, nor pose or none", text));
  }
}

}  // namespace

void add_clean_options(CLI::App& app, CleanSettings& s, const std::string& group) {
  add_numbers(app, "--clip", {"X0,Y0,Z0,X1,Y1,Z1", 6}, "Take only samples in this box, given by two corners",
              [&s](const std::vector<double>& v) {
                s.pick.clip = Box{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
              })
      ->group(group);
  app.add_option("--every", s.pick.every, "Take the first of every N samples")
      ->type_name("N")
      ->capture_default_str()
      ->group(group);
  app.add_option_function<double>(
         "--merge", [&s](double length) { s.merge = length; },
         "Leave out samples within LENGTH of another that face the same way; 0: at the same place [none]")
      ->type_name("LENGTH")
      ->group(group);
  app.add_option(
         "--outliers", s.sigma,
         "Leave out samples whose mean distance to their neighbours lies more than T standard deviations above the "
         "mean; 0: none. 3 takes stray points and next to nothing else")
      ->type_name("T")
      ->capture_default_str()
      ->group(group);
  app.add_option("--neighbours,--neighbors", s.neighbours, "Neighbours that --outliers looks at, 1 to 256")
      ->type_name("N")
      ->capture_default_str()
      ->group(group);
  app.add_flag(
         "--strays,!--keep-strays", s.strays,
         "Leave out samples that lie on no surface of their neighbours: flying pixels, dust, reflections; and, where "
         "there are many, those at the place of another; --keep-strays: leave them in")
      ->group(group);
  app.add_option("--spacing", s.spacing, "Thin out: no two samples nearer than LENGTH; 0: keep all")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group(group);
}

void add_align(CLI::App& tool, bool& align, const std::string& group) {
  tool.add_flag("--align,!--keep-poses", align,
                "Move scans that disagree a little, each as a whole, until they agree: files, the scans of a PTX or "
                "E57, values of an attribute scan; --keep-poses: leave them where they are")
      ->group(group);
}

void add_normals_choice(CLI::App& tool, std::optional<NormalsChoice>& normals, const std::string& group) {
  tool.add_option(
          "--normals", normals,
          "Whose normals: the file's; auto: the file's, turned where they contradict each other, and found for the "
          "samples that have none; estimate: all found")
      ->transform(words<NormalsChoice>(
          {{"file", NormalsChoice::file}, {"auto", NormalsChoice::automatic}, {"estimate", NormalsChoice::estimate}}))
      ->option_text("file|auto|estimate [auto]")
      ->group(group);
}

void add_normals_options(CLI::App& tool, NormalsSettings& s, const std::string& group) {
  tool.add_option("--k", s.k, "Nearest samples that a normal's plane is fitted to, 3 to 64")
      ->type_name("N")
      ->capture_default_str()
      ->group(group);
  tool.add_option("--radius", s.radius, "Fit to all samples within this distance instead; 0: to the nearest")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group(group);
  tool.add_option_function<std::vector<std::string>>(
          "--viewpoint",
          [&s](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) take_viewpoint(s, text);
          },
          "Normals face this scanner position. May be repeated: a sample faces the nearest of several, or its own "
          "scan's "
          "where there are as many as files (or scans of a PTX). pose: where each input's pose puts its origin; none: "
          "ignore the scanners that the files name")
      ->type_name("X,Y,Z|pose|none")
      ->allow_extra_args(false)
      ->group(group);
  add_numbers(tool, "--up", {"X,Y,Z", 3}, "Normals face this direction: 0,0,1 for scans from the air",
              [&s](const std::vector<double>& v) {
                s.viewpoints.push_back({{v[0], v[1], v[2]}, true});
              })
      ->group(group);
  tool.add_flag("--flip", s.flip, "Turn all normals that were found or turned to the other side at the end")
      ->group(group);
}

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
      "--refit where these are not given, by the cloud's noise, from place to place, and the evenness of its sampling",
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
      "around, and narrow slits; auto: where --blend is auto and the cloud is noisy, of several scans or came without "
      "normals, since gaps in it are what nobody saw")
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
