// lamina merge: several volumes into one.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "console.h"
#include "lamina/volume_merge.h"
#include "text.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct MergeOptions {
  std::vector<std::string> inputs;
  std::string output;
  RunOptions run;
};

void run_merge(const MergeOptions& o) {
  const RunContext context = make_context(o.run);
  const VolumeMergeStats stats = merge_volumes(o.inputs, o.output, context);
  const std::string points = stats.points > 0 ? ", " + count_text(stats.points) + " points" : std::string();
  context.info(
      fmt::format("{} grids, {} voxels{}, {}", stats.grids, count_text(stats.voxels), points, bytes_text(stats.bytes)));
}

}  // namespace

void add_merge(CLI::App& app) {
  auto* tool = app.add_subcommand("merge", "Join .vdb files: the files of a sequence, level sets, points");
  auto o = std::make_shared<MergeOptions>();
  tool->add_option("INPUTS", o->inputs, "volumes to join: .vdb; grids of one name become one")
      ->required()
      ->type_name("");
  tool->add_option("-o,--output", o->output, "volume to write: .vdb, - for standard output")
      ->required()
      ->type_name("FILE");
  add_run_options(*tool, o->run);
  tool->callback([o] { run_merge(*o); });
}

}  // namespace lamina::tools
