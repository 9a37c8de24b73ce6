#include "samples/cleaning.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "lamina/error.h"
#include "samples/neighbourhoods.h"
#include "samples/sampling_survey.h"
#include "samples/stray_clutter.h"
#include "samples/stray_passes.h"
#include "samples/stray_search.h"
#include "samples/stray_tests.h"

namespace lamina {
namespace {

constexpr std::uint64_t kSurveyed = 1u << 16;  ///< samples the spacing is taken from
/// How far neighbours are looked for, in median density radii (two spacings each).
constexpr double kStrayReach = 6;
/// Samples are sparse for their cloud where their neighbours lie so many median radii away in the mean, more than
/// twice as far as usual: whether they fill space is asked there alone, since under noise those of a surface do.
constexpr float kSparse = 1.5F;
/// Clutter is sparser: outliers that are a fifth of a cloud lie five median radii from their dozen, the inner wall of a
/// bowl that was hardly seen two and a half.
constexpr float kFarApart = 3;
/// How far the first dozens of clutter are looked for, in reaches of the strays: samples so sparse are few.
constexpr double kClutterReach = 2;

/// The median of the distances of its company; 0 where it has none.
float usual_distance(const Surroundings& known, const Company& company) {
  std::array<float, kStrayNeighbours> distances;
  std::size_t n = 0;
  for (std::size_t k = 0; k < company.count; ++k) {
    const float d = known.distance[company.places[k]];
    if (d >= 0) distances[n++] = d;
  }
  if (n == 0) return 0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(n / 2);
  std::nth_element(distances.begin(), middle, distances.begin() + static_cast<std::ptrdiff_t>(n));
  return *middle;
}

/// What samples are judged by.
struct Measures {
  float reach = 1;   ///< neighbours are looked for as far
  float sparse = 0;  ///< mean distance to a dozen neighbours from which on samples are sparse for their cloud
  float far = 0;     ///< and from which on they may be clutter
  SampleNormals normals = SampleNormals::given;
};

/// Judges the suspects within `margin` of the slab by what stays around them.
void judge_places(const Neighbourhoods& around, const Measures& by, float margin, Surroundings& known) {
  const Placed& samples = around.samples();
  const auto for_places = [&](const auto& each) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, samples.size(), 4096), [&](const auto& range) {
      for (std::size_t p = range.begin(); p < range.end(); ++p) {
        if (known.stray[p] == kStays) each(p);
      }
    });
  };
  known.distance.assign(samples.size(), -1);
  for_places([&](std::size_t p) {
    if (known.count[p] > 0) known.distance[p] = mean_distance(samples, p, company_of(known, p), by.reach);
    if (known.distance[p] < 0 || known.distance[p] > by.far) known.far[p] = 1;
  });
  known.scatter.assign(samples.size(), -1);
  for_places([&](std::size_t p) {
    if (known.distance[p] > by.sparse) known.scatter[p] = scatter_of(samples, p, company_of(known, p), by.normals);
  });
  const auto is_off = [&](std::size_t p, const Company& company, float least) {
    return by.normals != SampleNormals::none ? is_off_surface(samples, p, company, least, by.normals)
                                             : is_off_plane(samples, p, company, least);
  };
  std::vector<std::uint8_t> verdicts = known.stray;
  for_places([&](std::size_t p) {
    if (known.suspect[p] == kClear || !around.is_near(p, margin)) return;
    const Company company = company_of(known, p);
    const bool compared = known.suspect[p] == kToCompare;
    if (compared && (known.distance[p] < 0 || known.distance[p] > kLonely * usual_distance(known, company))) {
      verdicts[p] = kIsLonely;
    } else if (known.beside[p] != 0 && company.count < kStrayNeighbours) {
      if (company.count < kLeastCompany || is_off(p, company, kLeastOnSparseSurface)) verdicts[p] = kIsOffSurface;
    } else if (fills_space(known, p, company, by.normals) || is_off(p, company, kLeastOnSurface)) {
      verdicts[p] = kIsOffSurface;
    }
  });
  known.stray = std::move(verdicts);
}

/// One pass over the store.
class StraySweep {
 public:
  StraySweep(const SlabStore& store, KeepMasks& masks, Reasons* reasons)
      : store_(store), masks_(masks), reasons_(reasons), far_(masks.size()) {}

  /// Judges the samples that `among` has, by each other. Returns those that stay, but have not a dozen neighbours.
  KeepMasks judge(const KeepMasks& among, const Measures& by, const RunContext& run);
  /// Judges the samples far from their neighbours that stay by all of these, strays too.
  void judge_clutter(double reach, const RunContext& run);

  [[nodiscard]] const StrayCounts& counts() const { return counts_; }
  [[nodiscard]] std::uint64_t alone() const { return alone_; }  ///< how many the last pass returned

 private:
  void drop(std::uint32_t bucket, std::uint32_t number, std::uint8_t verdict);

  const SlabStore& store_;
  KeepMasks& masks_;
  Reasons* reasons_;
  StrayCounts counts_;
  KeepMasks far_;  ///< those that may be clutter, of all passes, whether they stay or not
  std::uint64_t far_samples_ = 0;
  std::uint64_t alone_ = 0;
};

KeepMasks StraySweep::judge(const KeepMasks& among, const Measures& by, const RunContext& run) {
  KeepMasks alone(among.size());
  alone_ = 0;
  // Normals that were measured tell outliers by their disorder.
  const bool may_be_clutter = by.normals != SampleNormals::given;
  Neighbourhoods around(store_, among, by.reach, by.normals != SampleNormals::none ? find_doubtful : doubt_all);
  Surroundings known;
  while (around.advance()) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    Search search(around, by.reach, known);
    search.start();
    known.far.assign(around.samples().size(), 0);
    judge_places(around, by, by.reach, known);
    // Strays keep each other company: those left are judged again without the others.
    search.go_on();
    judge_places(around, by, 0, known);
    const Placed& samples = around.samples();
    for (std::size_t p = 0; p < samples.size(); ++p) {
      if (!around.is_own(p) || known.suspect[p] == kClear) continue;
      if (may_be_clutter && known.far[p] != 0 && include(far_, store_, samples.bucket[p], samples.number[p]))
        ++far_samples_;
      if (known.stray[p] != kStays) {
        drop(samples.bucket[p], samples.number[p], known.stray[p]);
      } else if (company_of(known, p).count < kStrayNeighbours) {
        include(alone, store_, samples.bucket[p], samples.number[p]);
        ++alone_;
      }
    }
  }
  return alone;
}

void StraySweep::judge_clutter(double reach, const RunContext& run) {
  if (!are_many(far_samples_, store_)) return;
  const KeepMasks clutter = find_clutter(store_, far_, reach, run);
  for (std::uint32_t bucket = 0; bucket < clutter.size(); ++bucket) {
    for (std::uint32_t number = 0; number < clutter[bucket].size(); ++number) {
      if (clutter[bucket][number] && masks_[bucket][number]) drop(bucket, number, kIsOffSurface);
    }
  }
}

void StraySweep::drop(std::uint32_t bucket, std::uint32_t number, std::uint8_t verdict) {
  masks_[bucket][number] = false;
  ++(verdict == kIsLonely ? counts_.lonely : counts_.off_surface);
  if (reasons_ == nullptr) return;
  std::vector<std::uint8_t>& reasons = (*reasons_)[bucket];
  reasons.resize(store_.count(bucket), 0);
  reasons[number] = verdict == kIsLonely ? kReasonLonely : kReasonOffSurface;
}

}  // namespace

StrayCounts drop_strays(const SlabStore& store, KeepMasks& masks, SampleNormals normals, const RunContext& run,
                        Reasons* reasons) {
  const double radius = survey_density(store, kSurveyed).median;
  const double first_reach = kStrayReach * radius;
  double reach = first_reach;
  StraySweep sweep(store, masks, reasons);
  KeepMasks among = masks;
  for (int pass = 0; pass < kMostReaches; ++pass, reach *= kNextReach) {
    Measures by;
    by.reach = usable_reach(reach);
    by.sparse = kSparse * static_cast<float>(radius);
    by.far = kFarApart * static_cast<float>(radius);
    by.normals = normals;
    among = sweep.judge(among, by, run);
    if (!are_many(sweep.alone(), store)) break;
  }
  sweep.judge_clutter(kClutterReach * first_reach, run);
  return sweep.counts();
}

}  // namespace lamina
