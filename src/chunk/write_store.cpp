#include <filesystem>

#include "chunk/new_folder.h"
#include "lamina/chunk.h"
#include "surface/kept_input.h"

namespace lamina {

SurfaceStats write_store(const SurfaceSettings& given, const std::string& store, const RunContext& given_run) {
  SurfaceSettings settings = given;
  RunContext run = given_run;
  if (run.tmp_dir.empty()) run.tmp_dir = (std::filesystem::absolute(store) / "..").lexically_normal().string();
  settings.dry_run = true;  // nothing but the store is written
  settings.output.clear();
  check_settings(settings);
  settings.dry_run = false;
  SurfaceStats stats;
  Stopwatch watch;
  const Stopwatch::Moment began = Stopwatch::now();
  NewFolder folder(store);
  run_in_arena(run, [&] {
    const SweepInput input = read_surface_input(settings, folder.path(), /*keep=*/true, run, watch, stats);
    plan_surface(settings, input, run, watch, Stopwatch::now().wall - began.wall, stats);
    watch.time("store", [&] { save_input(input, settings, folder.path()); });
  });
  folder.publish();
  finish_stats(watch, began, stats);
  return stats;
}

}  // namespace lamina
