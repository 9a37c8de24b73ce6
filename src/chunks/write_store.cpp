#include <filesystem>

#include "chunks/new_folder.h"
#include "lamina/chunk.h"
#include "reconstruct/kept_input.h"

namespace lamina {

SurfaceStats write_store(const SurfaceSettings& settings, const std::string& store, const RunContext& run) {
  SurfaceSettings own = settings;
  own.dry_run = true;  // nothing but the store is written
  own.output.clear();
  check_settings(own);
  own.dry_run = false;
  RunContext here = run;
  if (here.tmp_dir.empty()) here.tmp_dir = (std::filesystem::absolute(store) / "..").lexically_normal().string();
  SurfaceStats stats;
  Stopwatch watch;
  const Stopwatch::Moment began = Stopwatch::now();
  NewFolder folder(store);
  run_in_arena(run, [&] {
    const SweepInput input = read_surface_input(own, folder.path(), /*keep=*/true, here, watch, stats);
    plan_surface(own, input, here, watch, Stopwatch::now().wall - began.wall, stats);
    watch.time("store", [&] { save_input(input, own, folder.path()); });
  });
  folder.publish();
  finish_stats(watch, began, stats);
  return stats;
}

}  // namespace lamina
