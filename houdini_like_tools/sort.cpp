// lamina sort: points in another order.
#include <fmt/format.h>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/options.h"
#include "common/outputs.h"
#include "common/presets.h"
#include "common/text.h"
#include "lamina/chunk.h"
#include "lamina/edit.h"
#include "lamina/error.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct SortOptions {
  std::vector<std::string> inputs;
  std::string output, store;
  PointSettings points;
  SurfaceSettings reading;  ///< of the store
  SortSettings settings;
  Precision precision = Precision::automatic;
  RunOptions run;
  std::optional<Trade> preset;
  CLI::App* tool = nullptr;  ///< knows which options were given
};

/// For chunks of a reconstruction.
void run_store(SortOptions& o) {
  if (o.preset) {
    const auto before_the_mesh = [](PresetPart part) {
      return part == PresetPart::points || part == PresetPart::cleaning;
    };
    apply_preset(*o.tool, *o.preset, before_the_mesh, make_context(o.run));
  }
  SurfaceSettings settings = o.reading;
  settings.guess_trade = !o.preset;
  settings.input = o.inputs.front();
  settings.more_inputs.assign(o.inputs.begin() + 1, o.inputs.end());
  settings.reading = o.points;
  settings.bad_samples = o.settings.bad_samples;
  if (o.tool->count("--align") == 0) settings.align = true;
  if (o.tool->count("--strays") == 0) settings.clean.strays = true;
  const RunContext context = make_context(o.run);
  const SurfaceStats stats = write_store(settings, o.store, context);
  context.info(
      fmt::format("{}: {} samples, {}", o.store, count_text(stats.plan.samples), bytes_text(stats.disk_bytes)));
}

void run_sort(SortOptions& o) {
  if (!o.store.empty()) return run_store(o);
  const RunContext context = make_context(o.run, o.output);
  const auto source = open_point_input(o.inputs.front(), o.points, context);
  const auto writer = open_points_writer(
      o.output, with_precision(columns_of(source->info()), o.precision),
      {.count = {}, .tmp_dir = o.run.tmp_dir, .crs = source->info().crs, .geographic = source->info().geographic});
  const EditReport report = sort_points(*source, *writer, o.settings, context);
  warn_of_bad_rows(report, shown_name(o.inputs.front()), context);
  writer->commit();
  context.info(fmt::format("sorted {} points", count_text(report.written)));
}

/// What else lamina surface would do with the samples while it reads them: all of it needs --store.
void add_reading(CLI::App& tool, CLI::Option& store, SurfaceSettings& reading, std::optional<Trade>& preset) {
  const std::size_t before = tool.get_options().size();
  add_preset(tool, preset, "Store");
  add_align(tool, reading.align, "Cleaning of the store");
  add_clean_options(tool, reading.clean, "Cleaning of the store");
  add_normals_choice(tool, reading.normals, "Normals of the store");
  add_normals_options(tool, reading.normal_search, "Normals of the store");
  const std::vector<CLI::Option*> options = tool.get_options();
  for (std::size_t i = before; i < options.size(); ++i) options[i]->needs(&store);
}

}  // namespace

void add_sort(CLI::App& app) {
  auto* tool = app.add_subcommand("sort", "Put points into another order, more of them than memory holds");
  auto o = std::make_shared<SortOptions>();
  o->tool = tool;
  tool->add_option_function<std::vector<std::string>>(
          "INPUT",
          [o](const std::vector<std::string>& names) {
            for (const std::string& name : names) o->inputs.push_back(pipe_name(name));
          },
          "Points; - for PLY on standard input. With --store several files, folders, patterns or scan lists")
      ->required()
      ->expected(1, 1000000)
      ->type_name(" ");
  auto* output = tool->add_option_function<std::string>(
                         "-o,--output", [o](const std::string& name) { o->output = pipe_name(name); },
                         "Points; - for PLY on standard output")
                     ->type_name("FILE")
                     ->group("Output");
  const std::map<std::string, SortKey> words{{"x", SortKey::x},
                                             {"y", SortKey::y},
                                             {"z", SortKey::z},
                                             {"sweep", SortKey::sweep},
                                             {"spatial", SortKey::spatial}};
  auto* by = tool->add_option_function<std::string>(
                     "--by", [o, words](const std::string& word) { o->settings.key = words.at(word); },
                     "An axis; sweep: the cloud's dominant axis, as a reconstruction sweeps; spatial: a space-filling "
                     "curve, so "
                     "that neighbours in space are neighbours in the file [spatial]")
                 ->check(CLI::IsMember({"x", "y", "z", "sweep", "spatial"}).description(""))
                 ->type_name("x|y|z|sweep|spatial")
                 ->group("Order");
  tool->add_option_function<std::string>(
          "--attribute",
          [o](const std::string& name) {
            o->settings.key = SortKey::attribute;
            o->settings.attribute = name;
          },
          "By the values of this column instead")
      ->type_name("NAME")
      ->excludes(by)
      ->group("Order");
  tool->add_flag("--reverse", o->settings.reverse, "Largest first")->group("Order");
  const std::string store = "Store";
  auto* folder = tool->add_option("--store", o->store,
                                  "Make a new folder instead, sorted along the sweep axis, from which lamina surface "
                                  "reconstructs chunk by chunk on many machines")
                     ->type_name("DIR")
                     ->excludes(output)
                     ->excludes(by)
                     ->group(store);
  tool->add_option_function<std::string>(
          "--frame",
          [o](const std::string& word) { o->reading.frame = word == "axis" ? FrameMode::axis : FrameMode::pca; },
          "Of the store: sweep along the cloud's dominant axis, or along the longest input axis [pca]")
      ->check(CLI::IsMember({"pca", "axis"}).description(""))
      ->type_name("pca|axis")
      ->needs(folder)
      ->group(store);
  tool->add_option("--particlescale", o->reading.radius_scale,
                   "Multiply the radii that the input gives by K; lamina surface scales those it estimates")
      ->type_name("K")
      ->capture_default_str()
      ->needs(folder)
      ->group(store);
  add_reading(*tool, *folder, o->reading, o->preset);
  add_point_options(*tool, o->points);
  add_bad_samples(*tool, o->settings.bad_samples);
  add_precision(*tool, o->precision);
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "Values stay the same bits, and equal keys keep their order. With --store one cloud of any number of inputs goes "
      "into a folder with an index, the frame and checksums, from which lamina surface reconstructs, in chunks on many "
      "machines if need be; the store can be cleaned and given normals on the way. Memory: 256 MB, the rest is on "
      "disk.");
  add_examples(*tool,
               "  lamina sort scan.ply --by sweep -o swept.ply\n"
               "  lamina sort scan.ply --store scan.store\n"
               "  lamina sort scan.ply --store cleaned.store --outliers 3 --normals auto\n"
               "  lamina sort scan.ply --attribute confidence --reverse -o best_first.ply");
  tool->parse_complete_callback([o] {
    if (!o->store.empty()) return;
    if (o->output.empty()) throw CLI::ValidationError("--output is required, or --store");
    if (o->inputs.size() > 1)
      throw CLI::ValidationError("several inputs go into a --store only; put them into one file first: lamina merge");
  });
  tool->callback([o] { run_sort(*o); });
}

}  // namespace lamina::tools
