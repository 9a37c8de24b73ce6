#include "samples/support_field.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "base/vectors.h"

namespace lamina {
namespace {

/// Places whose mean, weighted by how near they are, makes H.
constexpr std::size_t kBlended = 8;
/// Places that are passed over together where they lie far away.
constexpr std::size_t kGrouped = 32;

/// About how far a place is from the next one: of places spread over a surface.
float typical_distance(const std::vector<SupportPlace>& places) {
  constexpr std::size_t kAsked = 64;
  std::vector<float> nearest;
  for (std::size_t i = 0; i < places.size(); i += places.size() / kAsked + 1) {
    float least = std::numeric_limits<float>::infinity();
    for (std::size_t j = 0; j < places.size(); ++j) {
      if (j == i) continue;
      float squared = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const float d = places[j].at[k] - places[i].at[k];
        squared += d * d;
      }
      least = std::min(least, squared);
    }
    if (std::isfinite(least)) nearest.push_back(least);
  }
  // The nearest of evenly strewn points is half as far as they are apart.
  return 2 * std::sqrt(median_of(nearest));
}

}  // namespace

float SupportSurvey::median() const {
  std::vector<float> supports;
  for (const SupportPlace& p : places) supports.push_back(p.blend);
  return supports.empty() ? 0 : median_of(supports);
}

SupportField::SupportField(const std::vector<SupportPlace>& places) {
  std::vector<float> sorted;
  sorted.reserve(places.size());
  for (const SupportPlace& p : places) sorted.push_back(p.blend);
  const auto [least, most] = std::minmax_element(sorted.begin(), sorted.end());
  least_ = *least;
  most_ = *most;
  median_ = median_of(sorted);
  const float apart = std::clamp(typical_distance(places), 1.0F, 0x1p29F);
  edge_ = static_cast<std::int64_t>(std::bit_ceil(static_cast<std::uint32_t>(apart)));
  put_in_order(places);
}

void SupportField::put_in_order(std::vector<SupportPlace> places) {
  // Cells that hold some dozen places of a surface.
  const float side = 4 * static_cast<float>(edge_);
  const auto cell = [side](const SupportPlace& p) {
    return std::tuple(std::floor(p.at[2] / side), std::floor(p.at[1] / side), std::floor(p.at[0] / side));
  };
  std::stable_sort(places.begin(), places.end(),
                   [&](const SupportPlace& a, const SupportPlace& b) { return cell(a) < cell(b); });
  for (std::size_t i = 0; i < places.size(); ++i) {
    const SupportPlace& p = places[i];
    if (groups_.empty() || groups_.back().end - groups_.back().begin == kGrouped) groups_.push_back({i, i, p.at, p.at});
    Group& group = groups_.back();
    group.end = i + 1;
    for (std::size_t k = 0; k < 3; ++k) {
      group.low[k] = std::min(group.low[k], p.at[k]);
      group.high[k] = std::max(group.high[k], p.at[k]);
    }
    x_.push_back(p.at[0]);
    y_.push_back(p.at[1]);
    z_.push_back(p.at[2]);
    blend_.push_back(p.blend);
  }
}

float SupportField::interpolated(const std::array<float, 3>& at) const {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  std::array<std::pair<float, float>, kBlended> near;  // squared distance, H
  near.fill({kFar, 0});
  const auto look_at = [&](const Group& group) {
    for (std::size_t i = group.begin; i < group.end; ++i) {
      const float dx = x_[i] - at[0];
      const float dy = y_[i] - at[1];
      const float dz = z_[i] - at[2];
      const float squared = dx * dx + dy * dy + dz * dz;
      if (squared >= near.back().first) continue;
      std::size_t k = kBlended - 1;
      for (; k > 0 && squared < near[k - 1].first; --k) near[k] = near[k - 1];
      near[k] = {squared, blend_[i]};
    }
  };
  // How near a group's places may be. Rounded as their own distances are, so that it is not more than any of these.
  const auto least_square = [&](const Group& group) {
    float squared = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const float d = std::max({group.low[k] - at[k], at[k] - group.high[k], 0.0F});
      squared += d * d;
    }
    return squared;
  };
  const auto nearest = std::min_element(groups_.begin(), groups_.end(), [&](const Group& a, const Group& b) {
    return least_square(a) < least_square(b);
  });
  look_at(*nearest);
  for (auto group = groups_.begin(); group != groups_.end(); ++group) {
    if (group != nearest && least_square(*group) < near.back().first) look_at(*group);
  }
  const std::size_t found = std::min(kBlended, x_.size());
  const float far = near[found - 1].first;
  // The farthest has next to no weight, so that nothing jumps where another takes its place.
  constexpr float kLeastWeight = 1e-6F;
  float sum = 0;
  float weights = 0;
  for (std::size_t k = 0; k < found; ++k) {
    const float weight = far > 0 ? std::max(kLeastWeight, 1 - near[k].first / far) : 1;
    sum += weight * near[k].second;
    weights += weight;
  }
  return std::clamp(sum / weights, least_, most_);
}

float SupportField::Cursor::corner(const Corner& at) {
  constexpr std::size_t kMostKept = 4096;
  const auto known = corners_.find(at);
  if (known != corners_.end()) return known->second;
  if (corners_.size() == kMostKept) corners_.clear();
  const auto edge = static_cast<float>(field_->edge_);
  const float made = field_->interpolated(
      {edge * static_cast<float>(at[0]), edge * static_cast<float>(at[1]), edge * static_cast<float>(at[2])});
  corners_.emplace(at, made);
  return made;
}

float SupportField::Cursor::at(std::int32_t x, std::int32_t y, std::int32_t z) {
  const int shift = std::countr_zero(static_cast<std::uint64_t>(field_->edge_));
  const std::array<std::int64_t, 3> p{x, y, z};
  const Corner cube{p[0] >> shift, p[1] >> shift, p[2] >> shift};
  if (!any_ || cube != cube_) {
    for (std::size_t k = 0; k < blend_.size(); ++k) {
      const auto bit = [k](unsigned axis) { return static_cast<std::int64_t>(k >> axis & 1U); };
      blend_[k] = corner({cube[0] + bit(0), cube[1] + bit(1), cube[2] + bit(2)});
    }
    cube_ = cube;
    any_ = true;
  }
  std::array<float, 3> along{};
  for (std::size_t a = 0; a < 3; ++a)
    along[a] = static_cast<float>(p[a] - (cube[a] << shift)) / static_cast<float>(field_->edge_);
  const auto mix = [](float low, float high, float share) { return low + share * (high - low); };
  const float near_low = mix(blend_[0], blend_[1], along[0]);
  const float near_high = mix(blend_[2], blend_[3], along[0]);
  const float far_low = mix(blend_[4], blend_[5], along[0]);
  const float far_high = mix(blend_[6], blend_[7], along[0]);
  return mix(mix(near_low, near_high, along[1]), mix(far_low, far_high, along[1]), along[2]);
}

}  // namespace lamina
