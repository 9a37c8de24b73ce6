#include "edit/point_tree.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

namespace lamina::edit {
namespace {

double squared(const PointTree::Position& a, const PointTree::Position& b) {
  double sum = 0;
  for (std::size_t k = 0; k < 3; ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return sum;
}

/// On a coarse grid, so that points coincide and distances tie.
PointTree::Position place() {
  return {*rc::gen::inRange(0, 12) * 1.0, *rc::gen::inRange(0, 12) * 1.0, *rc::gen::inRange(0, 3) * 1.0};
}

RC_GTEST_PROP(PointTree, FindsWhatBruteForceFinds, ()) {
  std::vector<PointTree::Position> points(*rc::gen::inRange<std::size_t>(0, 200));
  for (auto& p : points) p = place();
  const PointTree tree(points);
  for (int query = 0; query < 10; ++query) {
    auto p = place();
    p[0] += 0.5;
    const double bound = *rc::gen::element(1e300, 4.0, 1.25);
    double best = bound;
    std::uint32_t first = 0;
    std::vector<std::uint32_t> near, found;
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      const double d2 = squared(points[i], p);
      if (d2 < best) {
        best = d2;
        first = i;
      }
      if (d2 <= 6.25) near.push_back(i);
    }
    const NearestPoint nearest = tree.nearest(p, bound);
    RC_ASSERT(nearest.squared_distance == best);
    if (best < bound) RC_ASSERT(nearest.point == first);
    tree.within(p, 6.25, [&](std::uint32_t i, double d2) {
      RC_ASSERT(d2 == squared(points[i], p));
      found.push_back(i);
    });
    std::sort(found.begin(), found.end());
    RC_ASSERT(found == near);
  }
}

}  // namespace
}  // namespace lamina::edit
