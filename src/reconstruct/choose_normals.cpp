#include "reconstruct/choose_normals.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "lamina/error.h"
#include "store/survey.h"

namespace lamina {
namespace {

constexpr std::size_t kRowsAtOnce = std::size_t{1} << 15;

/// Normals that say nothing: what a plan comes to does not depend on them.
class PlannedNormals final : public PointSource {
 public:
  explicit PlannedNormals(std::unique_ptr<PointSource> source) : source_(std::move(source)) {
    info_ = source_->info();
    info_.has_normals = true;
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    source_->read(first, count, out);
    out.nx.assign(out.size(), 0);
    out.ny.assign(out.size(), 0);
    out.nz.assign(out.size(), 1);
  }

 private:
  std::unique_ptr<PointSource> source_;
};

struct Usable {
  bool any = false, all = true;
};

/// Looks until it knows: rows of every kind, or all of them.
Usable look_for_normals(PointSource& source, const RunContext& run) {
  Usable usable;
  SampleBatch batch;
  for (std::uint64_t first = 0; first < source.info().count; first += kRowsAtOnce) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    source.read(first, kRowsAtOnce, batch);
    for (std::size_t i = 0; i < batch.size(); ++i) {
      const bool missing = defect_of(batch, i) == Defect::normal;
      usable.any = usable.any || !missing;
      usable.all = usable.all && !missing;
    }
    if (usable.any && !usable.all) break;
  }
  return usable;
}

}  // namespace

std::unique_ptr<PointSource> choose_normals(std::unique_ptr<PointSource> source, const SurfaceSettings& settings,
                                            std::optional<NormalsReport>& report, const std::string& tmp_dir,
                                            const RunContext& run) {
  if (settings.normals == NormalsChoice::file || source->info().count == 0) return source;
  NormalsSettings search = settings.normal_search;
  search.bad_samples = settings.bad_samples;
  search.mode = NormalsMode::estimate;
  if (settings.normals == NormalsChoice::automatic && source->info().has_normals) {
    const Usable usable = look_for_normals(*source, run);
    if (usable.all) return source;
    if (usable.any) search.mode = NormalsMode::complete;
  }
  if (settings.dry_run) return std::make_unique<PlannedNormals>(std::move(source));
  RunContext here = run;
  here.tmp_dir = tmp_dir;
  here.threads = 0;  // this runs on the caller's already
  const std::string path = source->info().path == "-" ? "standard input" : source->info().path;
  std::unique_ptr<PointSource> found = with_normals(std::move(source), search, report.emplace(), here);
  run.info(describe(*report));
  warn_of_conflicts(*report, path, run);
  return found;
}

std::string normals_words(const SurfaceSettings& settings) {
  if (settings.normals == NormalsChoice::file) return "file";
  // Every setting by name: one that is added must be dealt with here, or this does not compile.
  const auto& [mode, k, radius, viewpoints, scanners, pose_origins, flip, bad_samples] = settings.normal_search;
  (void)mode, (void)bad_samples;
  std::string words = settings.normals == NormalsChoice::automatic ? "auto" : "estimate";
  words += fmt::format(" k {} radius {} scanners {} poses {} flip {}", k, radius, scanners, pose_origins, flip);
  for (const Viewpoint& v : viewpoints)
    words += fmt::format(" {} {} {} {}", v.direction ? "towards" : "from", v.at[0], v.at[1], v.at[2]);
  return words;
}

}  // namespace lamina
