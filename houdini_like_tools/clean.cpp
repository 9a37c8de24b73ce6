// lamina clean: points without duplicates, outliers and more samples than wanted.
#include <fmt/format.h>

#include <memory>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/options.h"
#include "common/outputs.h"
#include "common/text.h"
#include "lamina/clean.h"
#include "lamina/error.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct CleanOptions {
  std::string input, output;
  PointSettings reading;
  CleanSettings settings;
  BadSamples bad = BadSamples::drop;
  Precision precision = Precision::automatic;
  RunOptions run;
};

void run_clean(const CleanOptions& o) {
  require_sane(o.settings);
  if (!o.settings.looks_around() && o.settings.pick.takes_all())
    throw Error(ExitCode::usage,
                "clean: nothing to do; give --clip, --every, --merge, --outliers, --strays or --spacing");
  const RunContext context = make_context(o.run, o.output);
  PointSettings reading = o.reading;
  const RowPick& pick = o.settings.pick;
  if (pick.clip && pick.every <= 1) reading.select.box = {pick.clip->low, pick.clip->high};
  const auto source = open_point_input(o.input, reading, context);
  if (o.settings.looks_around()) require_no_degrees(source->info());
  const auto writer = open_points_writer(
      o.output, with_precision(columns_of(source->info()), o.precision),
      {.count = {}, .tmp_dir = o.run.tmp_dir, .crs = source->info().crs, .geographic = source->info().geographic});
  const CleanReport report = clean_points(*source, *writer, o.settings, o.bad, context);
  warn_of_bad_rows(report.rows, shown_name(o.input), context);
  const std::string said = describe(report.counts);
  if (report.rows.written == 0)
    throw Error(ExitCode::empty, fmt::format("{}: nothing is left of its {} points{}{}", shown_name(o.input),
                                             report.rows.read, said.empty() ? "" : ": ", said));
  writer->commit();
  context.info(fmt::format("kept {} of {} points{}{}", count_text(report.rows.written), count_text(report.rows.read),
                           said.empty() ? "" : ": ", said));
}

}  // namespace

void add_clean(CLI::App& app) {
  auto* tool = app.add_subcommand("clean", "Leave out duplicates, outliers, and more points than wanted");
  auto o = std::make_shared<CleanOptions>();
  add_files(*tool, o->input, "Points", o->output, "Points that stay, in their order");
  add_clean_options(*tool, o->settings, "Cleaning");
  add_point_options(*tool, o->reading);
  add_bad_samples(*tool, o->bad);
  add_precision(*tool, o->precision);
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "Points are left out in this order: outside the box, by number, duplicates, outliers, strays, more than wanted. "
      "Those "
      "that stay keep their order and every value. lamina surface does the same while it reads, by the same options. "
      "Where merging and thinning may choose, the point that comes first along the cloud stays; of equal positions "
      "the first in the file. Memory: a bit for each point and 256 MB, the rest is on disk.");
  add_examples(*tool,
               "  lamina clean scan.ply --merge 0 --outliers 3 -o cleaned.ply\n"
               "  lamina clean scan.ply --spacing 0.05 -o thinned.ply");
  tool->callback([o] { run_clean(*o); });
}

}  // namespace lamina::tools
