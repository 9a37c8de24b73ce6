#include "normals/directions.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>

#include "normals/plane.h"

namespace lamina::normals {
namespace {

constexpr double kLine = 1.0 / 32;        ///< a smaller share of the middle variance in the largest is a line's
constexpr std::size_t kLeastLinked = 12;  ///< neighbours that links are chosen from

/// Neighbours at even steps of the list: the nearest ones alone may lie on one scan line, or at one place.
void link(const Neighbour* found, std::size_t count, std::uint32_t place, std::size_t i, Links& links) {
  auto& neighbours = links.neighbours[i];
  neighbours.fill(place);
  const std::size_t n = std::min(count, Links::kMost);
  for (std::size_t l = 0; l < n; ++l) neighbours[l] = found[(l + 1) * count / n - 1].sample;
  links.scale[i] = count > 0 ? found[count - 1].squared : 0.0F;
}

Plane plane_of(const SampleTree& tree, std::uint32_t place, const Neighbour* found, std::size_t count) {
  Moments m;
  m.count = 1;  // the sample itself
  for (std::size_t n = 0; n < count; ++n) m.add(tree.offset(place, found[n].sample));
  return fit_plane(m);
}

bool is_line(const Plane& plane) {
  return !plane.valid() || plane.middle < kLine * plane.most;
}

}  // namespace

void find_directions(const SampleTree& tree, const DirectionSettings& settings, WindowSamples& samples, Links& links) {
  links.neighbours.resize(links.core.size());
  links.scale.resize(links.core.size());
  const float bound = settings.reach * settings.reach;
  const float ball = settings.radius * settings.radius;
  const auto k = static_cast<std::size_t>(settings.k);
  const auto find = [&](std::size_t i) {
    const std::uint32_t place = links.core[i];
    std::array<Neighbour, SampleTree::kMostNeighbours> found;
    std::size_t wanted = std::max(k, kLeastLinked);
    std::size_t count = tree.nearest(place, wanted, bound, found.data());
    Plane plane = plane_of(tree, place, found.data(), std::min(count, k));
    const std::size_t most = std::min(4 * wanted, SampleTree::kMostNeighbours);
    while (is_line(plane) && count == wanted && wanted < most) {
      wanted = std::min(2 * wanted, most);
      count = tree.nearest(place, wanted, bound, found.data());
      plane = plane_of(tree, place, found.data(), count);
    }
    link(found.data(), count, place, i, links);
    if (samples.given[place] != 0) return;
    if (ball > 0) {
      Moments m;
      m.count = 1;
      tree.within(place, ball, [&](Neighbour n) { m.add(tree.offset(place, n.sample)); });
      const Plane wide = fit_plane(m);
      // Too few within the radius: the nearest ones will do.
      if (!is_line(wide)) plane = wide;
    }
    samples.nx[place] = plane.normal[0];
    samples.ny[place] = plane.normal[1];
    samples.nz[place] = plane.normal[2];
  };
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, links.core.size(), 512), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) find(i);
  });
}

}  // namespace lamina::normals
