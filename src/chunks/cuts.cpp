#include "chunks/cuts.h"

#include <algorithm>
#include <cmath>

namespace lamina {
namespace {

/// What a slab costs whatever it holds: as much as so many samples.
constexpr double kSlab = 500;
/// Of a slab beside the chunk: it is read, refined and projected, but gives no mesh.
constexpr double kBeside = 0.7;
constexpr std::size_t kBelow = reach_of(Stage::project).below, kAbove = reach_of(Stage::project).above;

class Costs {
 public:
  explicit Costs(const std::vector<double>& cost) : sums_(cost.size() + 1, 0.0) {
    for (std::size_t s = 0; s < cost.size(); ++s) sums_[s + 1] = sums_[s] + cost[s];
  }
  [[nodiscard]] std::size_t slabs() const { return sums_.size() - 1; }
  [[nodiscard]] double whole() const { return sums_.back(); }
  /// Of a chunk of slabs [begin, end).
  [[nodiscard]] double of(std::size_t begin, std::size_t end) const {
    const std::size_t from = begin - std::min(begin, kBelow), to = std::min(end + kAbove, slabs());
    return sums_[end] - sums_[begin] + kBeside * (sums_[begin] - sums_[from] + sums_[to] - sums_[end]);
  }

 private:
  std::vector<double> sums_;
};

/// Ends of chunks that each cost at most `most`, one slab at least; as many as it takes.
std::vector<std::size_t> ends_within(const Costs& costs, double most, std::size_t limit) {
  std::vector<std::size_t> ends;
  for (std::size_t begin = 0; begin < costs.slabs();) {
    if (ends.size() == limit) return {};
    std::size_t end = begin + 1;
    while (end < costs.slabs() && costs.of(begin, end + 1) <= most) ++end;
    ends.push_back(end);
    begin = end;
  }
  return ends;
}

}  // namespace

std::vector<double> slab_samples(const ReconstructionPlan& plan, const SlabStore& store) {
  std::vector<double> samples(static_cast<std::size_t>(plan.slabs.size()), 0.0);
  const double height = plan.lattice.slab_height();
  for (std::size_t b = 0; b < store.buckets(); ++b) {
    if (store.count(b) == 0) continue;
    const double low = store.z_lower(b), high = static_cast<double>(store.z_upper(b)) + 1;
    const double per_step = static_cast<double>(store.count(b)) / (high - low);
    const std::int32_t last = plan.lattice.slab_of(store.z_upper(b));
    for (std::int32_t s = plan.lattice.slab_of(store.z_lower(b)); s <= last; ++s) {
      const double share = std::min(high, (s + 1.0) * height) - std::max(low, s * height);
      samples[static_cast<std::size_t>(s - plan.slabs.begin)] += per_step * share;
    }
  }
  return samples;
}

std::uint64_t samples_in(const ReconstructionPlan& plan, const SlabStore& store, const SlabSpan& span) {
  const std::vector<double> samples = slab_samples(plan, store);
  double sum = 0;
  for (std::int32_t s = span.begin; s < span.end; ++s) sum += samples[static_cast<std::size_t>(s - plan.slabs.begin)];
  return static_cast<std::uint64_t>(std::llround(sum));
}

double chunk_cost(const std::vector<double>& cost, std::size_t begin, std::size_t end) {
  return Costs(cost).of(begin, end);
}

std::vector<SlabSpan> cut(const std::vector<double>& cost, std::int32_t first, int count) {
  const Costs costs(cost);
  const auto limit = static_cast<std::size_t>(count);
  double low = 0, high = costs.whole() * (1 + kBeside);
  std::vector<std::size_t> best = ends_within(costs, high, limit);
  constexpr int kHalvings = 40;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    std::vector<std::size_t> ends = ends_within(costs, middle, limit);
    (ends.empty() ? low : high) = middle;
    if (!ends.empty()) best = std::move(ends);
  }
  best.resize(limit, cost.size());
  std::vector<SlabSpan> spans;
  std::int32_t begin = first;
  for (const std::size_t end : best) {
    spans.push_back({begin, first + static_cast<std::int32_t>(end)});
    begin = spans.back().end;
  }
  return spans;
}

std::vector<SlabSpan> cut(const ReconstructionPlan& plan, const SlabStore& store, int count) {
  std::vector<double> cost = slab_samples(plan, store);
  for (double& c : cost) c += kSlab;
  return cut(cost, plan.slabs.begin, count);
}

}  // namespace lamina
