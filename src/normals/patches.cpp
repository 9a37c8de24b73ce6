#include "normals/sample_window.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "base/union_find.h"
#include "lattice/lattice.h"

namespace lamina::normals {
namespace {

using Vector3f = std::array<float, 3>;

/// Strong links join first; weak ones are left to the graph of patches, which has more to go by. Among noise a link of
/// half an agreement may well be wrong, and in a patch nothing outvotes it.
constexpr int kStrengths = 32;
constexpr float kWeakest = 0.75F;

Vector3f normal_of(const WindowSamples& s, std::uint32_t i) {
  return {s.nx[i], s.ny[i], s.nz[i]};
}
float dot(const Vector3f& a, const Vector3f& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Whether two neighbours lie beside each other on one surface, so that opposite normals contradict each other: across
/// a thin wall and around an edge they do not.
bool lie_along(const Vector3f& offset, const Vector3f& a, const Vector3f& b) {
  const float squared = dot(offset, offset);
  constexpr float kSine2 = 0.25F;
  const float along_a = dot(offset, a);
  const float along_b = dot(offset, b);
  return squared > 0 && along_a * along_a < kSine2 * squared && along_b * along_b < kSine2 * squared &&
         std::abs(dot(a, b)) > 0.5F;
}

/// Samples of a cell: places in `order`.
struct Cell {
  std::size_t begin = 0, end = 0;
  std::uint32_t patches = 0;  ///< found in it
  std::uint32_t first = 0;    ///< node of the first of them
  std::vector<PatchEdge> edges;
  std::uint64_t same = 0, opposite = 0;
};

class PatchGrower {
 public:
  PatchGrower(const SampleTree& tree, const PatchSettings& settings, const Viewpoints& viewpoints, const Links& links,
              WindowSamples& samples, PatchGraph& graph)
      : tree_(tree), settings_(settings), viewpoints_(viewpoints), links_(links), samples_(samples), graph_(graph) {}

  void run() {
    sort_into_cells();
    judge_links();
    for_cells([&](Cell& cell) { grow(cell); });
    auto node = static_cast<std::uint32_t>(graph_.nodes.size());
    for (Cell& cell : cells_) {
      cell.first = node;
      node += cell.patches;
    }
    graph_.nodes.resize(node);
    for_cells([&](Cell& cell) { settle(cell); });
    for_cells([&](Cell& cell) { connect(cell); });
    gather_edges();
  }

 private:
  template <class Work>
  void for_cells(const Work& work) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, cells_.size(), 16), [&](const auto& range) {
      for (std::size_t c = range.begin(); c < range.end(); ++c) work(cells_[c]);
    });
  }

  [[nodiscard]] bool is_fixed(std::uint32_t place) const { return settings_.given_stay && samples_.given[place] != 0; }

  void sort_into_cells() {
    const FloorDivider cell_of(settings_.cell);
    constexpr std::int64_t kMiddle = 1 << 20;
    const auto key = [&](std::uint32_t p) {
      const auto part = [&](std::int32_t v) { return static_cast<std::uint64_t>(cell_of(v) + kMiddle); };
      return part(samples_.z[p]) << 42 | part(samples_.y[p]) << 21 | part(samples_.x[p]);
    };
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keys(links_.core.size());
    tbb::parallel_for(std::size_t{0}, keys.size(), [&](std::size_t i) {
      keys[i] = {key(links_.core[i]), static_cast<std::uint32_t>(i)};
    });
    tbb::parallel_sort(keys.begin(), keys.end());
    order_.resize(keys.size());
    cell_of_.assign(samples_.size(), kNoNode);
    slot_.resize(samples_.size());
    for (std::size_t i = 0; i < keys.size(); ++i) {
      order_[i] = keys[i].second;
      if (i == 0 || keys[i].first != keys[i - 1].first) cells_.push_back({i, i, 0, 0, {}, 0, 0});
      cells_.back().end = i + 1;
      const std::uint32_t place = links_.core[order_[i]];
      cell_of_[place] = static_cast<std::uint32_t>(cells_.size() - 1);
      slot_[place] = static_cast<std::uint32_t>(i);
    }
    forest_.emplace(order_.size());
  }

  struct Link {
    std::uint32_t from, to;  ///< slots
    bool opposite;
  };
  /// What a sample's links say of normals as they were found; a bit for each link besides.
  struct Judgement {
    std::array<float, Links::kMost> agreement{};
    std::uint8_t along = 0, same = 0;
  };
  void judge_links() {
    judged_.resize(links_.core.size());
    turned_.assign(samples_.size(), 0);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, judged_.size(), 1024), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) judged_[i] = judge(i);
    });
  }
  [[nodiscard]] Judgement judge(std::size_t i) const {
    Judgement out;
    const std::uint32_t place = links_.core[i];
    const Vector3f n = normal_of(samples_, place);
    for (std::size_t l = 0; l < Links::kMost; ++l) {
      const std::uint32_t other = links_.neighbours[i][l];
      const Vector3f m = normal_of(samples_, other);
      const Vector3f d = offset(place, other);
      out.agreement[l] = agreement(d, n, m, links_.scale[i]);
      if (lie_along(d, n, m)) out.along = static_cast<std::uint8_t>(out.along | 1U << l);
      if (dot(n, m) > 0) out.same = static_cast<std::uint8_t>(out.same | 1U << l);
    }
    return out;
  }

  /// Between the sheets that the two belong to.
  [[nodiscard]] Vector3f offset(std::uint32_t place, std::uint32_t other) const {
    Vector3f d = tree_.offset(place, other);
    const Vector3f n = normal_of(samples_, place);
    const Vector3f m = normal_of(samples_, other);
    for (std::size_t a = 0; a < 3; ++a) d[a] += samples_.lift[other] * m[a] - samples_.lift[place] * n[a];
    return d;
  }

  /// Joins samples of the cell along their links, the strongest first, until there is nothing left to join: mostly the
  /// strongest links do it all.
  void grow(Cell& cell) {
    const auto takes_part = [&](std::uint32_t place) { return !is_fixed(place) && samples_.has_normal(place); };
    for (std::size_t s = cell.begin; s < cell.end; ++s) cell.patches += takes_part(links_.core[order_[s]]) ? 1 : 0;
    const auto join = [&](const Link& link) {
      if (forest_->unite(link.from, link.to, static_cast<std::int8_t>(link.opposite ? -1 : 1))) --cell.patches;
    };
    std::array<std::vector<Link>, kStrengths>& weaker = by_strength_.local();
    for (std::vector<Link>& links : weaker) links.clear();
    for (std::size_t s = cell.begin; s < cell.end && cell.patches > 1; ++s) {
      const std::uint32_t i = order_[s];
      const std::uint32_t place = links_.core[i];
      if (!takes_part(place)) continue;
      for (std::size_t l = 0; l < Links::kMost; ++l) {
        const float w = judged_[i].agreement[l];
        const float strength = std::min(std::abs(w), 1.0F);
        if (strength < kWeakest) continue;
        const std::uint32_t other = links_.neighbours[i][l];
        if (other == place || cell_of_[other] != cell_of_[place] || is_fixed(other)) continue;
        const auto bin = std::min(kStrengths - 1, static_cast<int>((1 - strength) / (1 - kWeakest) * kStrengths));
        const Link link{static_cast<std::uint32_t>(s), slot_[other], w < 0};
        if (bin == 0) {
          join(link);
        } else {
          weaker[static_cast<std::size_t>(bin)].push_back(link);
        }
      }
    }
    for (const std::vector<Link>& links : weaker) {
      for (std::size_t l = 0; l < links.size() && cell.patches > 1; ++l) join(links[l]);
    }
  }

  /// Gives the cell's patches their nodes, and the samples their signs.
  void settle(Cell& cell) {
    std::uint32_t next = cell.first;
    for (std::size_t s = cell.begin; s < cell.end; ++s) {
      const std::uint32_t place = links_.core[order_[s]];
      samples_.node[place] = kNoNode;
      if (!samples_.has_normal(place)) continue;
      if (is_fixed(place)) {
        samples_.node[place] = kFixed;
        continue;
      }
      const std::uint32_t root = forest_->find(static_cast<std::uint32_t>(s));
      // The root is the patch's first sample.
      samples_.node[place] = root == s ? next++ : samples_.node[links_.core[order_[root]]];
      if (forest_->sign(static_cast<std::uint32_t>(s)) < 0) {
        for (auto* n : {&samples_.nx[place], &samples_.ny[place], &samples_.nz[place], &samples_.lift[place]}) *n = -*n;
        turned_[place] = 1;
      }
    }
    sum_up(cell);
  }

  /// Offsets are from a corner near the cell, so that sums of floats cannot cancel.
  void sum_up(const Cell& cell) {
    struct Sums {
      double area = 0, bulge = 0, vote = 0;
      std::array<double, 3> moment{}, outward{};
      std::uint32_t count = 0;
    };
    std::vector<Sums> all(cell.patches);
    if (all.empty()) return;
    const std::uint32_t pivot = links_.core[order_[cell.begin]];
    const double share = std::numbers::pi / settings_.neighbours / (PatchNode::kUnit * PatchNode::kUnit);
    for (std::size_t s = cell.begin; s < cell.end; ++s) {
      const std::uint32_t place = links_.core[order_[s]];
      if (samples_.node[place] == kNoNode || samples_.node[place] == kFixed) continue;
      Sums& sum = all[samples_.node[place] - cell.first];
      const Vector3f n = normal_of(samples_, place);
      const Vector3f at = tree_.offset(pivot, place);
      // A sample stands for the area its neighbourhood has for each of its samples.
      const double area = share * std::max(double{links_.scale[order_[s]]}, 1.0);
      sum.area += area;
      for (std::size_t a = 0; a < 3; ++a) {
        sum.moment[a] += area * double{at[a]} / PatchNode::kUnit;
        sum.outward[a] += area * double{n[a]};
      }
      sum.bulge += area * double{dot(n, at)} / PatchNode::kUnit;
      sum.vote +=
          double{viewpoints_.vote(samples_.row[place], {samples_.x[place], samples_.y[place], samples_.z[place]}, n)};
      ++sum.count;
    }
    const std::array<std::int32_t, 3> origin{samples_.x[pivot], samples_.y[pivot], samples_.z[pivot]};
    for (std::uint32_t p = 0; p < cell.patches; ++p) {
      const Sums& sum = all[p];
      PatchNode& node = graph_.nodes[cell.first + p];
      node.count = sum.count;
      node.area = static_cast<float>(sum.area);
      double bulge = sum.bulge;
      for (std::size_t a = 0; a < 3; ++a) {
        const double centre = sum.moment[a] / sum.area;
        bulge -= sum.outward[a] * centre;
        node.centre[a] = static_cast<float>(centre + origin[a] / PatchNode::kUnit);
        node.outward[a] = static_cast<float>(sum.outward[a]);
      }
      node.bulge = static_cast<float>(bulge);
      node.vote = static_cast<float>(sum.vote);
    }
  }

  /// What the links of the cell's samples say, within their patches and to others. Later slabs look back themselves.
  void connect(Cell& cell) {
    for (std::size_t s = cell.begin; s < cell.end; ++s) {
      const std::uint32_t i = order_[s];
      const std::uint32_t place = links_.core[i];
      const std::uint32_t node = samples_.node[place];
      if (node == kNoNode) continue;
      for (std::size_t l = 0; l < Links::kMost; ++l) {
        const std::uint32_t other = links_.neighbours[i][l];
        if (other == place || samples_.node[other] == kNoNode) continue;
        const bool turned = turned_[place] != turned_[other];
        const bool along = (judged_[i].along >> l & 1) != 0;
        const bool same = (judged_[i].same >> l & 1) != (turned ? 1 : 0);
        if (samples_.node[other] == node) {
          if (along) ++(same ? cell.same : cell.opposite);
          continue;
        }
        const float w = turned ? -judged_[i].agreement[l] : judged_[i].agreement[l];
        cell.edges.push_back({std::min(node, samples_.node[other]), std::max(node, samples_.node[other]),
                              w * std::min(std::abs(w), 1.0F), along && same ? 1U : 0U, along && !same ? 1U : 0U});
      }
    }
    add_up(cell.edges);
  }

  static void add_up(std::vector<PatchEdge>& edges) {
    std::stable_sort(edges.begin(), edges.end(),
                     [](const PatchEdge& l, const PatchEdge& r) { return l.a < r.a || (l.a == r.a && l.b < r.b); });
    std::size_t n = 0;
    for (const PatchEdge& e : edges) {
      if (n > 0 && edges[n - 1].a == e.a && edges[n - 1].b == e.b) {
        edges[n - 1].agreement += e.agreement;
        edges[n - 1].same += e.same;
        edges[n - 1].opposite += e.opposite;
      } else {
        edges[n++] = e;
      }
    }
    edges.resize(n);
  }

  void gather_edges() {
    std::vector<PatchEdge> edges;
    SlabLinks slab;
    for (const Cell& cell : cells_) {
      edges.insert(edges.end(), cell.edges.begin(), cell.edges.end());
      slab.same += cell.same;
      slab.opposite += cell.opposite;
    }
    add_up(edges);
    graph_.edges.insert(graph_.edges.end(), edges.begin(), edges.end());
    slab.edge_end = graph_.edges.size();
    graph_.slabs.push_back(slab);
  }

  const SampleTree& tree_;
  const PatchSettings& settings_;
  const Viewpoints& viewpoints_;
  const Links& links_;
  WindowSamples& samples_;
  PatchGraph& graph_;
  std::vector<std::uint32_t> order_;       ///< numbers of core samples, by cell
  std::vector<std::uint32_t> cell_of_;     ///< by place; kNoNode outside the slab
  std::vector<std::uint32_t> slot_;        ///< by place: where in order_
  std::vector<Judgement> judged_;          ///< by number of the core sample
  std::vector<std::uint8_t> turned_;       ///< by place: 1 where the patch has another sign than the normal found
  std::optional<SignedUnionFind> forest_;  ///< of slots
  tbb::enumerable_thread_specific<std::array<std::vector<Link>, kStrengths>> by_strength_;
  std::vector<Cell> cells_;
};

}  // namespace

float agreement(const std::array<float, 3>& offset, const std::array<float, 3>& a, const std::array<float, 3>& b,
                float scale) {
  constexpr float kNoise = 0.25F;  // offsets of half the neighbourhood's radius are mirrored by half
  const float cosine = dot(a, b);
  const float squared = dot(offset, offset) + kNoise * scale;
  return squared > 0 ? cosine - 2 * dot(a, offset) * dot(b, offset) / squared : cosine;
}

void grow_patches(const SampleTree& tree, const PatchSettings& settings, const Viewpoints& viewpoints,
                  const Links& links, WindowSamples& samples, PatchGraph& graph) {
  PatchGrower(tree, settings, viewpoints, links, samples, graph).run();
}

}  // namespace lamina::normals
