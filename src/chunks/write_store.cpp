#include <filesystem>

#include "chunks/new_folder.h"
#include "lamina/chunk.h"
#include "reconstruct/job.h"
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
  Job job(here);
  NewFolder folder(store);
  run_in_arena(run, [&] {
    const StoredCloud cloud = read_cloud(own, {folder.path(), /*stays=*/true}, job);
    plan_surface(own, cloud, job);
    job.watch.time("store", [&] { save_input(cloud, own, folder.path()); });
  });
  folder.publish();
  job.finish();
  return job.stats;
}

}  // namespace lamina
