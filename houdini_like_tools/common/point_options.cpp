#include "common/point_options.h"

#include <fmt/format.h>

#include <vector>

#include "common/option_values.h"

namespace lamina::tools {
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
  app.add_flag("--strays,!--keep-strays", s.strays,
               "Leave out samples that lie on no surface of their neighbours: flying pixels, dust, reflections; "
               "--keep-strays: leave them in")
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
          "Whose normals: the file's; auto: the file's, and found for the samples that have none; estimate: all found")
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

}  // namespace lamina::tools
