// How many triangles contractions up to a cost leave.
#pragma once
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

namespace lamina::simplify {

/// Counted in pieces of a mesh, for the whole.
class CostCurve {
 public:
  /// Costs are told apart by their steps, some 19 % each; nothing below the first.
  static float step_above(float cost) {
    constexpr float kLeast = 1e-37F;
    if (!(cost > kLeast)) return kLeast;
    return std::exp2(std::ceil(4 * std::log2(cost)) / 4);
  }

  /// `triangles` that may go at all.
  void expect(std::uint64_t triangles) { all_ += triangles; }
  /// So many have gone at a cost of up to `step`.
  void add(float step, std::uint64_t triangles) { gone_[step] += triangles; }
  void add(const CostCurve& other) {
    all_ += other.all_;
    for (const auto& [step, triangles] : other.gone_) gone_[step] += triangles;
  }

  [[nodiscard]] bool empty() const { return all_ == 0; }
  /// The largest step that leaves no less than this share of the triangles; 0 where the first one takes more.
  [[nodiscard]] float cost_for(double share) const {
    const double most = (1 - share) * static_cast<double>(all_);
    float cost = 0;
    std::uint64_t gone = 0;
    for (const auto& [step, triangles] : gone_) {
      gone += triangles;
      if (static_cast<double>(gone) > most) break;
      cost = step;
    }
    return cost;
  }
  /// What contractions up to this cost leave, as a share.
  [[nodiscard]] double left_at(float cost) const {
    std::uint64_t gone = 0;
    for (const auto& [step, triangles] : gone_) gone += step <= cost ? triangles : 0;
    return all_ == 0 ? 1 : 1 - static_cast<double>(gone) / static_cast<double>(all_);
  }

 private:
  std::uint64_t all_ = 0;
  std::map<float, std::uint64_t> gone_;
};

}  // namespace lamina::simplify
