#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/descriptor.h"
#include "base/run.h"
#include "lamina/error.h"
#include "lamina/normals.h"
#include "normals/directions.h"
#include "normals/row_normals.h"
#include "normals/row_records.h"
#include "normals/sample_window.h"
#include "normals/sides.h"
#include "samples/sampling_survey.h"
#include "store/ingest.h"

namespace lamina {
namespace {

using namespace normals;

constexpr std::size_t kMemory = std::size_t{64} << 20;  ///< for what is found, on its way to its rows
constexpr std::uint64_t kSurveyed = 1 << 18;            ///< samples the spacing is taken from
constexpr std::uint64_t kLeastSlab = 1 << 17;           ///< samples that keep all threads busy
constexpr double kPatches = 150'000;  ///< of a large cloud; cells and slabs cut them to about twice as many
constexpr double kLeastPatch = 128;   ///< samples
constexpr double kMostSteps = 1 << 29;
constexpr float kLined = 0.1F;  ///< share of samples on lines: of object scans it is under 0.04, of profiles 0.3 to 1

double percent(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

/// Lengths of the job, steps.
struct Scale {
  DirectionSettings directions;
  WindowSettings window;
  PatchSettings patches;
};

void require_sane(const NormalsSettings& s, const PointSourceInfo& info) {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw Error(ExitCode::usage, what);
  };
  require(s.k >= 3 && s.k <= 64, "--k must be in 3..64");
  require(s.radius >= 0 && std::isfinite(s.radius), "--radius must be 0 (the k nearest) or more");
  for (const Viewpoint& v : s.viewpoints) {
    const double squared = v.at[0] * v.at[0] + v.at[1] * v.at[1] + v.at[2] * v.at[2];
    require(std::isfinite(squared), "a viewpoint must be finite");
    require(!v.direction || squared > 0, "an up direction must not be 0,0,0");
  }
  if (s.mode == NormalsMode::check && !info.has_normals)
    throw Error(ExitCode::usage, fmt::format("{}: has no normals to check", info.path));
}

/// Whatever the density, a window holds a good number of samples beyond what a sample's neighbours take.
Scale scale_of(const NormalsSettings& settings, const SlabStore& store, const Frame& frame) {
  const RadiusSurvey radii = survey_radii(store, kSurveyed);
  const auto steps = [](double v) { return std::clamp(v, 1.0, kMostSteps); };
  Scale s;
  s.directions.k = settings.k;
  s.directions.radius = settings.radius > 0 ? static_cast<float>(steps(settings.radius / frame.step)) : 0.0F;
  // A density radius is about twice the spacing, and sixteen neighbours lie within 1.2 of it.
  const double usual = std::sqrt(std::max(settings.k, 16) / 16.0) * double{radii.high};
  constexpr double kSearched = 5;
  s.directions.search_radius = static_cast<float>(steps(std::max(kSearched * usual, double{s.directions.radius})));
  s.directions.lines = radii.lined > kLined;
  s.window.halo = static_cast<std::int32_t>(s.directions.search_radius);
  const double in_patch = std::max(kLeastPatch, static_cast<double>(store.total()) / kPatches);
  const double cell = std::max(0.5 * double{radii.median} * std::sqrt(in_patch), double{kLeastPatchCell});
  s.patches.cell = static_cast<std::int32_t>(steps(cell));
  s.patches.neighbours = std::max(settings.k, static_cast<int>(kLeastLinked));
  s.patches.given_stay = settings.mode == NormalsMode::complete || settings.mode == NormalsMode::check;
  s.window.least_samples = kLeastSlab;
  s.window.least_height = std::min(2 * s.window.halo, s.patches.cell);
  return s;
}

InputAxes axes_in(const Frame& frame) {
  InputAxes axes;
  for (int a = 0; a < 3; ++a) {
    const Eigen::Vector3f axis = frame.rotation.col(a).cast<float>();
    axes[static_cast<std::size_t>(a)] = {axis.x(), axis.y(), axis.z()};
  }
  return axes;
}

class Job {
 public:
  Job(PointSource& source, const NormalsSettings& settings, NormalsReport& report, const RunContext& run)
      : source_(source), settings_(settings), report_(report), run_(run) {}

  std::unique_ptr<RowNormals> work() {
    const std::string directory = run_.tmp_dir.empty() ? system_tmp_dir() : run_.tmp_dir;
    RunContext silent = run_;  // what is left out is told by whoever takes the rows
    silent.log = nullptr;
    RowIdSource points(source_, settings_.mode != NormalsMode::estimate);
    const Survey survey = survey_input(points, settings_.bad_samples, silent);
    const Frame frame = choose_frame(survey, FrameMode::pca);
    turn_ = frame.rotation.transpose();
    const Ingested in = ingest(points, survey, frame, directory, run_);
    const std::vector<Viewpoint> everywhere =
        settings_.viewpoints.size() > 1 && settings_.viewpoints.size() == source_.info().scans.size()
            ? std::vector<Viewpoint>{}
            : settings_.viewpoints;
    const Viewpoints viewpoints(everywhere, scanners_of(source_.info(), settings_), frame);
    const std::size_t memory = run_.max_memory > 0 ? std::min(kMemory, run_.max_memory / 4) : kMemory;
    RowRecords records(source_.info().count, memory, directory);
    const Scale scale = scale_of(settings_, in.store, frame);
    require_memory(in.store, scale, memory);
    graph_.cell = static_cast<float>(scale.patches.cell / PatchNode::kUnit);
    sweep(in.store, scale, viewpoints, records);
    PatchSigns signs = find_signs(graph_, axes_in(frame));
    report_.samples = in.store.total();
    tell(signs, viewpoints);
    if (settings_.flip) {
      for (std::size_t i = 1; i < signs.sign.size(); ++i) signs.sign[i] = static_cast<std::int8_t>(-signs.sign[i]);
    }
    count_flipped(signs);
    return std::make_unique<RowNormals>(records, signs, source_.info().count, directory, run_);
  }

 private:
  void require_memory(const SlabStore& store, const Scale& scale, std::size_t records) const {
    if (run_.max_memory == 0) return;
    // Measured: arrays of the window twice while it slides, its tree, links and patches of the slab.
    constexpr std::uint64_t kWindow = 150;
    constexpr std::uint64_t kSlab = 150;
    constexpr double kPatch = 400;
    constexpr std::uint64_t kProgram = std::uint64_t{40} << 20;
    const WindowCounts most = largest_window(store, scale.window);
    const double patches = 2 * std::min(kPatches, static_cast<double>(store.total()) / kLeastPatch) + 1;
    const std::uint64_t needed =
        kProgram + records + kWindow * most.window + kSlab * most.slab + static_cast<std::uint64_t>(kPatch * patches);
    if (needed <= run_.max_memory) return;
    throw Error(ExitCode::budget,
                fmt::format("{}: normals need about {:.0f} MB of memory, --max-memory allows {:.0f} MB; give it more, "
                            "or cut the cloud across its longest way",
                            source_.info().path, static_cast<double>(needed) / 1e6,
                            static_cast<double>(run_.max_memory) / 1e6));
  }

  void sweep(const SlabStore& store, const Scale& scale, const Viewpoints& viewpoints, RowRecords& records) {
    SampleWindow window(store, scale.window);
    Links links;
    while (window.advance()) {
      if (run_.cancelled()) throw Error(ExitCode::internal, "cancelled");
      links.core = window.core();
      std::vector<std::array<float, 3>> given = given_normals(window.samples(), links);
      find_directions(window.tree(), scale.directions, window.samples(), links);
      if (settings_.mode == NormalsMode::check) keep_given_only(window.samples(), links);
      grow_patches(window.tree(), scale.patches, viewpoints, links, window.samples(), graph_);
      hand_over(window.samples(), links, given, records);
      if (run_.progress) run_.progress({"normals", window.done(), store.total(), 0, 0});
    }
  }

  /// Patches turn normals; only against the given ones can that be told.
  std::vector<std::array<float, 3>> given_normals(const WindowSamples& s, const Links& links) const {
    std::vector<std::array<float, 3>> given;
    if (settings_.mode != NormalsMode::reorient) return given;
    for (const std::uint32_t p : links.core) given.push_back({s.nx[p], s.ny[p], s.nz[p]});
    return given;
  }

  static void keep_given_only(WindowSamples& s, const Links& links) {
    for (const std::uint32_t p : links.core) {
      if (s.given[p] == 0) s.nx[p] = s.ny[p] = s.nz[p] = 0;
    }
  }

  void hand_over(const WindowSamples& s, const Links& links, const std::vector<std::array<float, 3>>& given,
                 RowRecords& records) {
    if (settings_.mode == NormalsMode::check) {
      for (const std::uint32_t p : links.core) report_.without += s.has_normal(p) ? 0 : 1;
      return;
    }
    std::vector<std::uint64_t> rows(links.core.size());
    std::vector<RowRecord> made(links.core.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rows.size(), 4096), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) {
        const std::uint32_t p = links.core[i];
        rows[i] = s.row[p];
        made[i] = {kNoNormal, s.node[p]};
        if (!s.has_normal(p)) continue;
        if (s.given[p] == 0) {
          const Eigen::Vector3d n = turn_ * Eigen::Vector3d(s.nx[p], s.ny[p], s.nz[p]);
          made[i].code = code_of({static_cast<float>(n.x()), static_cast<float>(n.y()), static_cast<float>(n.z())});
        } else if (settings_.mode == NormalsMode::reorient) {
          const auto& g = given[i];
          made[i].code = s.nx[p] * g[0] + s.ny[p] * g[1] + s.nz[p] * g[2] < 0 ? kTurn : kKeep;
        }
      }
    });
    std::size_t n = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const std::uint32_t p = links.core[i];
      const bool has = s.has_normal(p);
      if (!has) ++report_.without;
      if (settings_.mode == NormalsMode::complete && s.given[p] != 0) continue;
      if (has && s.given[p] != 0) count_given(made[i]);
      if (has && s.given[p] == 0) ++report_.estimated;
      rows[n] = rows[i];
      made[n++] = made[i];
    }
    records.add(std::span(rows).first(n), std::span(made).first(n));
  }

  /// Given normals, by patch, as they stand and turned.
  void count_given(const RowRecord& r) {
    const std::uint32_t node = r.node();
    given_.resize(std::max<std::size_t>(given_.size(), std::size_t{node} + 1));
    ++(r.code == kTurn ? given_[node].second : given_[node].first);
  }
  void count_flipped(const PatchSigns& signs) {
    for (std::size_t i = 0; i < given_.size(); ++i)
      report_.flipped += signs.sign[i] < 0 ? given_[i].first : given_[i].second;
  }

  void tell(const PatchSigns& signs, const Viewpoints& viewpoints) {
    report_.patches = graph_.nodes.size() - 1;
    report_.components = signs.components;
    report_.slabs = count_conflicts(graph_, signs);
    for (const SignConflicts& slab : report_.slabs) {
      report_.conflicts.pairs += slab.pairs;
      report_.conflicts.conflicts += slab.conflicts;
    }
    for (std::size_t i = 1; i < graph_.nodes.size(); ++i) {
      const std::uint64_t count = graph_.nodes[i].count;
      switch (signs.source[i]) {
        case SignSource::fixed:
          (viewpoints.any() ? report_.by_viewpoint : report_.by_given) += count;
          break;
        case SignSource::outside:
          report_.by_outside += count;
          break;
        case SignSource::inside:
          report_.by_inside += count;
          break;
        case SignSource::up:
          report_.by_up += count;
          break;
        case SignSource::sight:
          report_.by_sight += count;
          break;
        case SignSource::unsure:
          report_.unsure += count;
          break;
      }
    }
  }

  PointSource& source_;
  const NormalsSettings& settings_;
  NormalsReport& report_;
  const RunContext& run_;
  Eigen::Matrix3d turn_ = Eigen::Matrix3d::Identity();  ///< back to input coordinates
  PatchGraph graph_;
  std::vector<std::pair<std::uint64_t, std::uint64_t>> given_;
};

/// Organised scans bring their neighbourhoods: normals by the faces of the grid, the search is for the others.
/// Returns how many were found; then the settings are those of the search.
std::uint64_t take_grid_normals(std::unique_ptr<PointSource>& source, NormalsSettings& settings,
                                const RunContext& run) {
  const bool all_wanted =
      settings.mode == NormalsMode::estimate || (settings.mode == NormalsMode::complete && !source->info().has_normals);
  if (!all_wanted || settings.flip || settings.radius > 0) return 0;
  std::vector<SeenFrom> seen = scanners_of(source->info(), settings);
  if (settings.viewpoints.size() == 1) seen = {{0, true, settings.viewpoints.front()}};
  const std::vector<PlacedGrid> grids = grids_of(*source);
  const bool known = std::any_of(seen.begin(), seen.end(), [](const SeenFrom& s) { return s.known; });
  if (grids.empty() || !known) return 0;
  GridNormals by_grid =
      grid_normals(std::move(source), grids, seen, run.tmp_dir.empty() ? system_tmp_dir() : run.tmp_dir, run);
  source = std::move(by_grid.source);
  settings.mode = NormalsMode::complete;
  run.info(fmt::format("{} of {} samples have normals by the faces of their scans' grids", by_grid.found,
                       source->info().count));
  return by_grid.found;
}

}  // namespace

std::unique_ptr<PointSource> with_normals(std::unique_ptr<PointSource> source, const NormalsSettings& settings,
                                          NormalsReport& report, const RunContext& run) {
  require_sane(settings, source->info());
  report = {};
  NormalsSettings search = settings;
  const std::uint64_t by_grid = take_grid_normals(source, search, run);
  std::unique_ptr<RowNormals> found;
  with_threads(run.threads, [&] { found = Job(*source, search, report, run).work(); });
  report.estimated += by_grid;
  report.by_viewpoint += by_grid;
  return give_normals(std::move(source), std::move(found));
}

std::size_t NormalsReport::worst_slab() const {
  // A few links say nothing.
  constexpr std::uint64_t kEnoughLinks = 1000;
  std::size_t worst = 0;
  double share = -1;
  for (std::size_t i = 0; i < slabs.size(); ++i) {
    if (slabs[i].pairs < std::min(kEnoughLinks, conflicts.pairs) || slabs[i].share() <= share) continue;
    share = slabs[i].share();
    worst = i;
  }
  return worst;
}

std::string describe(const NormalsReport& r) {
  std::string text = fmt::format("{} normals found", r.estimated);
  if (r.flipped > 0) text += fmt::format(", {} turned", r.flipped);
  if (r.without > 0) text += fmt::format(", {} samples without one", r.without);
  if (r.by_viewpoint > 0) text += fmt::format("; {:.1f} % face a viewpoint", percent(r.by_viewpoint, r.samples));
  if (r.by_given > 0) text += fmt::format("; {:.1f} % follow given ones", percent(r.by_given, r.samples));
  if (r.by_outside > 0)
    text += fmt::format("; {:.1f} % face out of what they enclose", percent(r.by_outside, r.samples));
  if (r.by_inside > 0) text += fmt::format("; {:.1f} % face into a room", percent(r.by_inside, r.samples));
  if (r.by_up > 0) text += fmt::format("; {:.1f} % are ground and face up", percent(r.by_up, r.samples));
  if (r.by_sight > 0) text += fmt::format("; {:.1f} % face where one sees farther", percent(r.by_sight, r.samples));
  if (r.unsure > 0) text += fmt::format("; {:.1f} % are too open to tell", percent(r.unsure, r.samples));
  return text + fmt::format("; {:.2f} % of neighbours conflict", 100 * r.conflicts.share());
}

void warn_of_conflicts(const NormalsReport& r, const std::string& path, const RunContext& run) {
  constexpr double kMuch = 0.02;  // scans of thin things have a percent
  constexpr double kUnsure = 0.2;
  const SignConflicts worst = r.slabs.empty() ? SignConflicts{} : r.slabs[r.worst_slab()];
  if (r.conflicts.share() > kMuch || worst.share() > 4 * kMuch) {
    run.warn(
        fmt::format("{}: the normals of {:.1f} % of neighbouring samples point to opposite sides, {:.1f} % in slab "
                    "{} of {}: expect holes and double sheets; a viewpoint, an up direction or a larger k may help",
                    path, 100 * r.conflicts.share(), 100 * worst.share(), r.worst_slab() + 1, r.slabs.size()));
  }
  if (static_cast<double>(r.unsure) > kUnsure * static_cast<double>(r.samples)) {
    run.warn(
        fmt::format("{}: {:.0f} % of the samples lie on surfaces too flat or open to tell their outside: say where "
                    "it is with --viewpoint or --up",
                    path, percent(r.unsure, r.samples)));
  }
}

namespace {

bool has_attribute(const PointSourceInfo& info, std::string_view name) {
  return std::any_of(info.attributes.begin(), info.attributes.end(),
                     [&](const AttributeSpec& a) { return a.name == name; });
}

}  // namespace

TradeGuess guess_trade(const PointSourceInfo& info) {
  const bool stations = std::any_of(info.scans.begin(), info.scans.end(),
                                    [](const ScanPart& scan) { return scan.scanner == ScanPart::Scanner::position; });
  if (stations) return {Trade::terrestrial, "the file tells where its scanner stood"};
  if (info.from_above) return {Trade::aerial, "wide and flat, with returns or classes of surveys from the air"};
  if (has_attribute(info, "red") && !has_attribute(info, "intensity"))
    return {Trade::photogrammetry, "colours and no intensity"};
  return {Trade::object, "nothing tells of anything else"};
}

std::string describe(const TradeGuess& guess) {
  return fmt::format("taken for --preset {} ({}){}; give --preset to have all it sets, or another of {}",
                     kTradeNames.at(static_cast<std::size_t>(guess.trade)), guess.because,
                     guess.trade == Trade::aerial ? ": normals that are found face up" : "",
                     fmt::join(kTradeNames, ", "));
}

void face_by_trade(Trade trade, NormalsSettings& settings) {
  if (trade == Trade::aerial && settings.viewpoints.empty() && !settings.pose_origins)
    settings.viewpoints.push_back({{0, 0, 1}, true});
}

}  // namespace lamina
