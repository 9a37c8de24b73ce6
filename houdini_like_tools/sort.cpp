// lamina sort: points in another order.
#include <fmt/format.h>

#include <map>
#include <memory>

#include "console.h"
#include "inputs.h"
#include "lamina/error.h"
#include "lamina/sort_points.h"
#include "text.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct SortOptions {
  std::string input, output, columns;
  SortSettings settings;
  Precision precision = Precision::automatic;
  RunOptions run;
};

void run_sort(const SortOptions& o) {
  const RunContext context = make_context(o.run);
  const auto source = open_point_input(o.input, o.columns, context);
  const auto writer = open_points_writer(o.output, with_precision(columns_of(source->info()), o.precision),
                                         {.count = {}, .tmp_dir = o.run.tmp_dir});
  const EditReport report = sort_points(*source, *writer, o.settings, context);
  warn_of_bad_rows(report, shown_name(o.input), context);
  writer->commit();
  context.info(fmt::format("sorted {} points", count_text(report.written)));
}

}  // namespace

void add_sort(CLI::App& app) {
  auto* tool = app.add_subcommand("sort", "Put points into another order, more of them than memory holds");
  auto o = std::make_shared<SortOptions>();
  add_files(*tool, o->input, "Points", o->output, "Points");
  const std::map<std::string, SortKey> words{{"x", SortKey::x},
                                             {"y", SortKey::y},
                                             {"z", SortKey::z},
                                             {"sweep", SortKey::sweep},
                                             {"spatial", SortKey::spatial}};
  auto* by = tool->add_option_function<std::string>(
                     "--by", [o, words](const std::string& word) { o->settings.key = words.at(word); },
                     "An axis; sweep: the dominant axis, as a reconstruction sweeps; spatial: neighbours in space "
                     "become neighbours in the file [spatial]")
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
  add_columns(*tool, o->columns);
  add_bad_samples(*tool, o->settings.bad_samples);
  add_precision(*tool, o->precision);
  add_run_options(*tool, o->run);
  add_examples(*tool,
               "  lamina sort scan.ply --by sweep -o swept.ply\n"
               "  lamina sort scan.ply --attribute confidence --reverse -o best_first.ply");
  tool->callback([o] { run_sort(*o); });
}

}  // namespace lamina::tools
