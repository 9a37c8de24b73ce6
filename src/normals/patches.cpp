#include "normals/sample_window.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>
#include <optional>
#include <utility>

#include "base/four.h"
#include "base/union_find.h"
#include "base/vectors.h"
#include "lattice/lattice.h"
#include "normals/judgement.h"

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
    judge();
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

  /// The number of a core sample's cell and its own.
  using Keyed = std::pair<std::uint64_t, std::uint32_t>;
  std::vector<Keyed> keyed_samples(std::uint64_t& largest) const {
    const FloorDivider cell_of(settings_.cell);
    const std::array axes{&samples_.x, &samples_.y, &samples_.z};
    std::array<std::int64_t, 3> low{};
    std::array<std::uint64_t, 3> extent{1, 1, 1};
    for (std::size_t a = 0; a < 3 && samples_.size() > 0; ++a) {
      const auto [least, most] = std::minmax_element(axes[a]->begin(), axes[a]->end());
      low[a] = cell_of(*least);
      extent[a] = static_cast<std::uint64_t>(cell_of(*most) - low[a] + 1);
    }
    largest = extent[0] * extent[1] * extent[2] - 1;
    std::vector<Keyed> keys(links_.core.size());
    tbb::parallel_for(std::size_t{0}, keys.size(), [&](std::size_t i) {
      std::uint64_t key = 0;
      for (std::size_t a = 3; a-- > 0;)
        key = key * extent[a] + static_cast<std::uint64_t>(cell_of((*axes[a])[links_.core[i]]) - low[a]);
      keys[i] = {key, static_cast<std::uint32_t>(i)};
    });
    return keys;
  }

  void sort_into_cells() {
    std::uint64_t largest = 0;
    std::vector<Keyed> keys = keyed_samples(largest);
    std::vector<Keyed> scratch;
    digit_sort(keys, scratch, largest, [](const Keyed& k) { return k.first; });
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
  void judge() {
    judged_.resize(links_.core.size());
    turned_.assign(samples_.size(), 0);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, judged_.size(), 1024), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) judged_[i] = judge_links(tree_, samples_, links_, i);
    });
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
      const StrongLinks strong = strong_links(i);
      for (unsigned left = strong.links; left != 0; left &= left - 1) {
        const auto l = static_cast<std::size_t>(std::countr_zero(left));
        const std::uint32_t other = links_.neighbours[i][l];
        if (is_fixed(other)) continue;
        const Link link{static_cast<std::uint32_t>(s), slot_[other], judged_[i].agreement[l] < 0};
        const auto bin = static_cast<std::size_t>(strong.bin[l]);
        if (bin == 0) {
          join(link);
        } else {
          weaker[bin].push_back(link);
        }
      }
    }
    for (const std::vector<Link>& links : weaker) {
      for (std::size_t l = 0; l < links.size() && cell.patches > 1; ++l) join(links[l]);
    }
  }

  /// Links within the cell that are strong enough to join at all: a bit for each, and how far from the strongest.
  struct StrongLinks {
    unsigned links = 0;
    std::array<std::int32_t, Links::kMost> bin{};
  };
  [[nodiscard]] StrongLinks strong_links(std::size_t i) const {
    StrongLinks out;
    const auto place = static_cast<std::int32_t>(links_.core[i]);
    const auto cell = static_cast<std::int32_t>(cell_of_[links_.core[i]]);
    for (std::size_t first = 0; first < Links::kMost; first += 4) {
      const std::uint32_t* const others = &links_.neighbours[i][first];
      const FourInts places = load_four(others);
      FourFloats strength;
      std::memcpy(&strength, &judged_[i].agreement[first], sizeof(strength));
      strength = strength < 0 ? -strength : strength;
      strength = strength > 1 ? FourFloats{} + 1 : strength;
      const FourInts within = (places != place) & (four_at(cell_of_, others) == cell);
      out.links |= bits_of(within & (strength >= kWeakest)) << first;
      FourInts bin = __builtin_convertvector((1 - strength) / (1 - kWeakest) * kStrengths, FourInts);
      bin = bin > kStrengths - 1 ? four_times(kStrengths - 1) : bin;
      std::memcpy(&out.bin[first], &bin, sizeof(bin));
    }
    return out;
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
    std::size_t last = 0;
    for (std::size_t s = cell.begin; s < cell.end; ++s) {
      const std::uint32_t i = order_[s];
      const std::uint32_t place = links_.core[i];
      const std::uint32_t node = samples_.node[place];
      if (node == kNoNode) continue;
      const Ends ends = ends_of(i);
      const unsigned along = judged_[i].along;
      const unsigned same = judged_[i].same ^ ends.turned;
      cell.same += static_cast<std::uint64_t>(std::popcount(ends.within & along & same));
      cell.opposite += static_cast<std::uint64_t>(std::popcount(ends.within & along & ~same));
      for (unsigned left = ends.beyond; left != 0; left &= left - 1) {
        const auto l = static_cast<std::size_t>(std::countr_zero(left));
        const std::uint32_t other = samples_.node[links_.neighbours[i][l]];
        const float w = (ends.turned >> l & 1) != 0 ? -judged_[i].agreement[l] : judged_[i].agreement[l];
        add(cell.edges,
            {std::min(node, other), std::max(node, other), w * std::min(std::abs(w), 1.0F), (along & same) >> l & 1,
             (along & ~same) >> l & 1},
            last);
      }
    }
    add_up(cell.edges);
  }

  /// Where a sample's links end, a bit for each.
  struct Ends {
    unsigned within = 0, beyond = 0;  ///< in its own patch, in another
    unsigned turned = 0;              ///< one end has been turned and the other has not
  };
  [[nodiscard]] Ends ends_of(std::size_t i) const {
    Ends out;
    const std::uint32_t place = links_.core[i];
    const auto node = static_cast<std::int32_t>(samples_.node[place]);
    for (std::size_t first = 0; first < Links::kMost; first += 4) {
      const std::uint32_t* const others = &links_.neighbours[i][first];
      const FourInts places = load_four(others);
      const FourInts nodes = four_at(samples_.node, others);
      const FourInts is_link = (places != static_cast<std::int32_t>(place)) & (nodes != std::int32_t{-1});
      static_assert(kNoNode == ~0U);
      out.within |= bits_of(is_link & (nodes == node)) << first;
      out.beyond |= bits_of(is_link & (nodes != node)) << first;
      out.turned |= bits_of(four_at(turned_, others) != std::int32_t{turned_[place]}) << first;
    }
    return out;
  }

  /// A cell has few neighbours, and mostly few patches: the first edges are summed up as they come, in the order in
  /// which add_up() would; the others are left to it.
  /// `last`: where the one before went, the next one mostly belongs.
  static void add(std::vector<PatchEdge>& edges, const PatchEdge& e, std::size_t& last) {
    constexpr std::size_t kSummedAtOnce = 16;
    if (last < edges.size() && edges[last].a == e.a && edges[last].b == e.b) {
      include(e, edges[last]);
      return;
    }
    const auto end = edges.begin() + static_cast<std::ptrdiff_t>(std::min(edges.size(), kSummedAtOnce));
    const auto known = std::find_if(edges.begin(), end, [&](const PatchEdge& k) { return k.a == e.a && k.b == e.b; });
    const auto place = static_cast<std::size_t>(known - edges.begin());
    if (known == end) {
      edges.push_back(e);
    } else {
      include(e, *known);
    }
    if (place < kSummedAtOnce) last = place;
  }
  static void include(const PatchEdge& e, PatchEdge& sum) {
    sum.agreement += e.agreement;
    sum.same += e.same;
    sum.opposite += e.opposite;
  }

  static void add_up(std::vector<PatchEdge>& edges) {
    std::stable_sort(edges.begin(), edges.end(),
                     [](const PatchEdge& l, const PatchEdge& r) { return l.a < r.a || (l.a == r.a && l.b < r.b); });
    std::size_t n = 0;
    for (const PatchEdge& e : edges) {
      if (n > 0 && edges[n - 1].a == e.a && edges[n - 1].b == e.b) {
        include(e, edges[n - 1]);
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

void grow_patches(const SampleTree& tree, const PatchSettings& settings, const Viewpoints& viewpoints,
                  const Links& links, WindowSamples& samples, PatchGraph& graph) {
  PatchGrower(tree, settings, viewpoints, links, samples, graph).run();
}

}  // namespace lamina::normals
