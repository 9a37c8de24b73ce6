// A mesh in memory simplified in rounds: cut into pieces that fit the processor's cache, each worked on by itself, and
// cut elsewhere in the next round.
#pragma once
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>

#include "lamina/run.h"
#include "simplify/work_mesh.h"

namespace lamina::simplify {

/// How many triangles contractions up to a cost leave: counted in pieces of a mesh, for the whole.
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

/// Contracts edges until `wanted` triangles are left, or no edge can go. Returns the number of contractions. Vertices
/// that have gone stay in the arrays. Throws Error(internal) when cancelled.
std::uint64_t contract_to(WorkMesh& work, std::uint64_t wanted, const RunContext& run);

/// Contracts the edges inside of pieces that cost no more than `limit`, in one round; an eighth of a piece stays. As
/// contract_to().
std::uint64_t contract_below(WorkMesh& work, float limit, const RunContext& run);

/// The same as far as the bound allows; errors that are there add up.
std::uint64_t contract_within(WorkMesh& work, const RunContext& run);

/// How contractions would thin out the mesh, down to an eighth: found in every `stride`th piece, whose contractions are
/// forgotten.
CostCurve sample_costs(WorkMesh& work, std::size_t stride);
/// About how many pieces there are.
std::size_t pieces_of(const WorkMesh& work);

}  // namespace lamina::simplify
