#include "boundary/rim_smoother.h"

#include <algorithm>
#include <array>
#include <utility>

namespace lamina {
namespace {

/// Sums of whole numbers do not depend on their order.
constexpr float kUnits = 1 << 20;

std::uint64_t mixed(std::uint32_t v) {
  const std::uint64_t m = v * std::uint64_t{0x9E3779B97F4A7C15};
  return m ^ m >> 29;
}

/// Calls use(vertex, next, before) for the corners of the slab's vertices [first, end) in triangles.
template <typename Use>
void for_corners(const std::vector<std::array<std::uint32_t, 3>>& triangles, std::uint32_t first, std::uint32_t end,
                 const Use& use) {
  for (const auto& t : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (t[k] >= first && t[k] < end) use(t[k] - first, t[(k + 1) % 3], t[(k + 2) % 3]);
    }
  }
}

}  // namespace

void RimSmoother::push(MeshSlab slab) {
  Held held;
  held.first = pushed_;
  held.overhang = slab.vertices.overhang;
  held.mesh = std::move(slab);
  pushed_ += static_cast<std::uint32_t>(held.overhang.size());
  held_.push_back(std::move(held));
  if (held_.size() > 1) find_boundary(held_[held_.size() - 2], &held_.back());
}

void RimSmoother::finish() {
  finished_ = true;
  if (!held_.empty()) find_boundary(held_.back(), nullptr);
}

bool RimSmoother::pop(MeshSlab& out) {
  const std::size_t at = below_ ? 1 : 0;
  if (held_.size() <= at || (!finished_ && held_.size() < at + 3)) return false;
  const Held* const below = below_ ? &held_.front() : nullptr;
  const Held* const above = held_.size() > at + 1 ? &held_[at + 1] : nullptr;
  Held& here = held_[at];
  if (here.rim || (below != nullptr && below->rim) || (above != nullptr && above->rim)) smooth(here, below, above);
  out = std::move(here.mesh);
  if (below_) held_.pop_front();
  below_ = true;
  return true;
}

/// Around a vertex inside every neighbour comes next in one triangle and before in another; at the ends of an open fan
/// it does not.
void RimSmoother::find_boundary(Held& here, const Held* above) {
  sums_.assign(here.overhang.size(), 0);
  const auto add = [&](std::uint32_t v, std::uint32_t next, std::uint32_t before) {
    sums_[v] += mixed(next) - mixed(before);
  };
  for_corners(here.mesh.triangles, here.first, here.end(), add);
  if (above != nullptr) for_corners(above->mesh.triangles, here.first, here.end(), add);
  here.boundary.resize(here.overhang.size());
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    here.boundary[i] = sums_[i] != 0 ? 1 : 0;
    here.rim = here.rim || here.boundary[i] != 0 || here.overhang[i] >= level_;
  }
}

void RimSmoother::smooth(Held& here, const Held* below, const Held* above) {
  const auto holder = [&](std::uint32_t v) -> const Held& {
    return v < here.first ? *below : v < here.end() ? here : *above;
  };
  const auto raised = [&](const Held& of, std::size_t i) {
    return of.boundary[i] != 0 ? std::max(of.overhang[i], kEndOverhang * level_) : of.overhang[i];
  };
  sums_.assign(here.overhang.size(), 0);
  counts_.assign(here.overhang.size(), 0);
  inside_.assign(here.overhang.size(), 0);
  const auto add = [&](std::uint32_t v, std::uint32_t next, std::uint32_t before) {
    for (const std::uint32_t neighbour : {next, before}) {
      const Held& of = holder(neighbour);
      const std::uint32_t i = neighbour - of.first;
      sums_[v] += static_cast<std::uint64_t>(raised(of, i) * kUnits);
      ++counts_[v];
      inside_[v] += of.boundary[i] == 0 ? 1 : 0;
    }
  };
  for_corners(here.mesh.triangles, here.first, here.end(), add);
  if (above != nullptr) for_corners(above->mesh.triangles, here.first, here.end(), add);
  std::vector<float>& out = here.mesh.vertices.overhang;
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (counts_[i] == 0 || (here.boundary[i] != 0 && inside_[i] == 0)) continue;
    const float mean = static_cast<float>(sums_[i]) / (kUnits * static_cast<float>(counts_[i]));
    out[i] = 0.5F * (raised(here, i) + mean);
  }
}

}  // namespace lamina
