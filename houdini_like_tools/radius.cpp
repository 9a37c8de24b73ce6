// lamina radius: an influence radius for every point.
#include <fmt/format.h>

#include <memory>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/outputs.h"
#include "common/text.h"
#include "lamina/error.h"
#include "lamina/point_radii.h"
#include "tables.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct RadiusOptions {
  std::string input, output, name = "radius";
  PointSettings reading;
  PointRadiiSettings settings;
  Precision precision = Precision::automatic;
  RunOptions run;
};

void run_radius(const RadiusOptions& o) {
  const RunContext context = make_context(o.run, o.output);
  const auto source = open_point_input(o.input, o.reading, context);
  require_no_degrees(source->info());
  PointColumns columns = with_precision(columns_of(source->info()), o.precision);
  columns.radius = o.name;
  for (const AttributeSpec& spec : columns.attributes) {
    if (spec.name == o.name)
      throw Error(ExitCode::usage, fmt::format("{}: has an attribute '{}' already; choose another name with --name",
                                               shown_name(o.input), o.name));
  }
  const auto writer = open_points_writer(
      o.output, columns,
      {.count = {}, .tmp_dir = o.run.tmp_dir, .crs = source->info().crs, .geographic = source->info().geographic});
  const PointRadiiReport report = write_point_radii(*source, *writer, o.settings, context);
  warn_of_bad_rows(report.rows, shown_name(o.input), context);
  writer->commit();
  std::string text = fmt::format("{} points, radius {:.4g} (1 % {:.4g}, 99 % {:.4g})", count_text(report.rows.written),
                                 report.median, report.low, report.high);
  if (report.raised > 0) text += fmt::format(", {} raised to {:g}", count_text(report.raised), o.settings.minradius);
  if (report.lowered > 0) text += fmt::format(", {} lowered to {:g}", count_text(report.lowered), o.settings.maxradius);
  context.info(text);
}

}  // namespace

void add_radius_options(CLI::App& tool, PointRadiiSettings& s) {
  const std::string group = "Radius";
  tool.add_option("--density", s.density, "Samples a counting cell needs to give a radius, 2 to 4096")
      ->type_name("N")
      ->capture_default_str()
      ->group(group);
  tool.add_option("--particlescale", s.particlescale, "Multiply every radius by K, up to 1000")
      ->type_name("K")
      ->capture_default_str()
      ->group(group);
  tool.add_option("--minradius", s.minradius, "Raise smaller radii to this; 0: none")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group(group);
  tool.add_option("--maxradius", s.maxradius, "Lower larger radii to this; 0: no limit")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group(group);
}

void add_radius(CLI::App& app) {
  auto* tool = app.add_subcommand("radius", "Give every point a radius from the sampling density around it");
  auto o = std::make_shared<RadiusOptions>();
  add_files(*tool, o->input, "Points; a radius they have is replaced", o->output, "Points with a radius");
  add_radius_options(*tool, o->settings);
  tool->add_option_function<std::string>(
          "--name", [o](const std::string& name) { o->name = name; },
          "Name of the column; Houdini says pscale [radius]")
      ->check(CLI::IsMember({"radius", "pscale"}).description(""))
      ->type_name("radius|pscale")
      ->group("Radius");
  add_point_options(*tool, o->reading);
  add_bad_samples(*tool, o->settings.bad_samples);
  add_precision(*tool, o->precision);
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "The radius is the one lamina surface would use. Normals are not needed. Memory: 256 MB and some cells, the rest "
      "is on disk.");
  add_examples(*tool,
               "  lamina radius scan.ply -o with_radii.ply\n"
               "  lamina radius scan.ply --particlescale 0.5 --name pscale -o particles.ply");
  tool->callback([o] { run_radius(*o); });
}

}  // namespace lamina::tools
