// Whose normals a reconstruction uses: the file's, or found ones.

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/error.h"
#include "lamina/normals.h"
#include "normals/given_normals.h"
#include "points/formats.h"
#include "reconstruct/job.h"
#include "reconstruct/stored_cloud.h"

namespace lamina {
namespace {

constexpr std::size_t kRowsAtOnce = std::size_t{1} << 15;
/// Of these, in a row: rows are often in the scanner's order, and neighbours of each other.
constexpr std::size_t kRowsLookedAt = kRowsAtOnce / 4;

/// Normals that say nothing: what a plan comes to does not depend on them.
class PlannedNormals final : public WithNormals {
 public:
  using WithNormals::WithNormals;

 private:
  void give_normals(SampleBatch& out) const override {
    out.nx.assign(out.size(), 0);
    out.ny.assign(out.size(), 0);
    out.nz.assign(out.size(), 1);
  }
};

/// What a look at the rows tells of their normals.
struct LookedAt {
  std::uint64_t rows = 0, missing = 0;  ///< looked at, and of these without a usable normal
  GivenNormals given;                   ///< the others
};

/// All rows, or a million of a large input, spread over it if it can be read anywhere.
LookedAt look_at_rows(PointSource& source, bool every_row, const RunContext& run) {
  constexpr std::uint64_t kLooks = 32;
  const PointSourceInfo& info = source.info();
  const bool part = info.count > kLooks * kRowsAtOnce;
  const std::uint64_t end = part && !every_row && !info.random_access ? kLooks * kRowsAtOnce : info.count;
  const std::uint64_t step = part && !every_row && info.random_access ? info.count / kLooks : kRowsAtOnce;
  const std::uint64_t looks = (end + step - 1) / step;
  LookedAt out;
  std::vector<Eigen::Vector3d> at;
  std::vector<Eigen::Vector3f> normals;
  SampleBatch batch;
  for (std::uint64_t look = 0; look < looks; ++look) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    source.read(look * step, kRowsAtOnce, batch);
    out.rows += batch.size();
    for (std::size_t i = 0; i < batch.size(); ++i) out.missing += defect_of(batch, i) == Defect::normal ? 1 : 0;
    if (look % (looks / kLooks + 1) != 0) continue;
    for (std::size_t i = 0; i < std::min(batch.size(), kRowsLookedAt); ++i) {
      at.emplace_back(batch.x[i], batch.y[i], batch.z[i]);
      normals.emplace_back(batch.nx[i], batch.ny[i], batch.nz[i]);
    }
  }
  out.given = look_at_normals(at, normals);
  return out;
}

/// How the cloud's own normals are to be completed or turned; nothing where they stay as they are.
std::optional<NormalsMode> mode_for(PointSource& source, const SurfaceSettings& settings, const RunContext& run) {
  const bool asked = settings.normals.has_value();
  const LookedAt rows = look_at_rows(source, asked, run);
  if (rows.missing == rows.rows) return NormalsMode::estimate;
  if (rows.given.lean()) {
    run.info(fmt::format("{}: normals are not those of the surface: all are found again (--normals file keeps them)",
                         input_name(settings)));
    return NormalsMode::estimate;
  }
  if (rows.given.scatter()) {
    run.info(
        fmt::format("{}: normals scatter so much that the samples' places tell more: all are found again "
                    "(--normals file keeps them)",
                    input_name(settings)));
    return NormalsMode::estimate;
  }
  if (rows.given.contradict()) {
    run.info(
        fmt::format("{}: normals contradict each other, {:.2g} % of neighbours: their signs are found again "
                    "(--normals file keeps them)",
                    input_name(settings), 100 * rows.given.share()));
    return NormalsMode::reorient;
  }
  // Unasked, a few are not worth the search: they are dropped.
  constexpr std::uint64_t kFew = 100;
  if (rows.missing <= (asked ? 0 : rows.rows / kFew)) return std::nullopt;
  return NormalsMode::complete;
}

}  // namespace

std::unique_ptr<PointSource> choose_normals(std::unique_ptr<PointSource> source, const SurfaceSettings& settings,
                                            const std::string& tmp_dir, Job& job) {
  const NormalsChoice choice = settings.normals.value_or(NormalsChoice::automatic);
  if (choice == NormalsChoice::file || source->info().count == 0) return source;
  NormalsSettings search = settings.normal_search;
  search.bad_samples = settings.bad_samples;
  search.mode = NormalsMode::estimate;
  if (settings.guess_trade) face_by_trade(guess_trade(source->info()).trade, search);
  if (choice == NormalsChoice::automatic && source->info().has_normals) {
    const std::optional<NormalsMode> mode = mode_for(*source, settings, job.run);
    if (!mode) return source;
    search.mode = *mode;
  }
  if (settings.dry_run) return std::make_unique<PlannedNormals>(std::move(source));
  RunContext here = job.run;
  here.tmp_dir = tmp_dir;
  here.threads = 0;  // this runs on the caller's already
  const std::string path = source->info().path == "-" ? "standard input" : source->info().path;
  NormalsReport& report = job.stats.normals.emplace();
  std::unique_ptr<PointSource> found = with_normals(std::move(source), search, report, here);
  job.run.info(describe(report));
  warn_of_conflicts(report, path, job.run);
  return found;
}

}  // namespace lamina
