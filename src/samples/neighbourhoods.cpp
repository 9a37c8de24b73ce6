#include "samples/neighbourhoods.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <tuple>

#include "base/vectors.h"
#include "lattice/lattice.h"

namespace lamina {
namespace {

constexpr std::size_t kEnoughInLeaf = 12;  ///< samples in a leaf, one more where halves are not even

static_assert(CellLayer::kMostInLeaf >= 2 * kEnoughInLeaf + 2);

template <typename T>
void drop_from(std::vector<T>& values, std::size_t n) {
  values.erase(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(n));
}

}  // namespace

void Placed::resize(std::size_t n) {
  for (auto* values : {&x, &y, &z}) values->resize(n);
  for (auto* values : {&nx, &ny, &nz}) values->resize(n);
  for (auto* values : {&bucket, &number}) values->resize(n);
}

void Placed::drop_front(std::size_t n) {
  for (auto* values : {&x, &y, &z}) drop_from(*values, n);
  for (auto* values : {&nx, &ny, &nz}) drop_from(*values, n);
  for (auto* values : {&bucket, &number}) drop_from(*values, n);
}

void CellLayer::build(std::span<const StoredSample> samples, std::int32_t side, std::size_t first, Scratch& scratch,
                      Placed& out) {
  cells_.clear();
  nodes_.clear();
  leaves_.clear();
  if (samples.empty()) return;
  const FloorDivider cell_of(side);
  std::array<std::int32_t, 2> low{};
  std::array<std::int32_t, 2> high{};
  for (std::size_t a = 0; a < 2; ++a) {
    const auto [least, most] = std::minmax_element(samples.begin(), samples.end(),
                                                   [a](const auto& l, const auto& r) { return l.at[a] < r.at[a]; });
    low[a] = cell_of(least->at[a]);
    high[a] = cell_of(most->at[a]);
  }
  const std::uint64_t row = static_cast<std::uint64_t>(std::int64_t{high[0]} - low[0]) + 1;
  const std::uint64_t rows = static_cast<std::uint64_t>(std::int64_t{high[1]} - low[1]) + 1;
  auto& keyed = scratch.keyed;
  resize_anew(keyed, samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto x = static_cast<std::uint64_t>(std::int64_t{cell_of(samples[i].at[0])} - low[0]);
    const auto y = static_cast<std::uint64_t>(std::int64_t{cell_of(samples[i].at[1])} - low[1]);
    keyed[i] = {y * row + x, static_cast<std::uint32_t>(i)};
  }
  digit_sort(keyed, scratch.other, row * rows - 1, [](const Scratch::Keyed& k) { return k.key; });
  for (std::size_t begin = 0; begin < keyed.size();) {
    std::size_t end = begin;
    while (end < keyed.size() && keyed[end].key == keyed[begin].key) ++end;
    const std::size_t n = end - begin;
    resize_anew(scratch.items, n);
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint32_t sample = keyed[begin + i].sample;
      scratch.items[i] = {samples[sample].at, sample};
    }
    std::uint32_t depth = 0;
    while ((n >> depth) > kEnoughInLeaf) ++depth;
    const auto x = static_cast<std::int32_t>(keyed[begin].key % row) + low[0];
    const auto y = static_cast<std::int32_t>(keyed[begin].key / row) + low[1];
    cells_.push_back({x, y, depth, first + begin, first + end, nodes_.size()});
    nodes_.resize(nodes_.size() + (std::size_t{2} << depth) - 1);
    split(scratch.items, first + begin, {0, 0, n, depth}, cells_.back().first_node);
    for (std::size_t i = 0; i < n; ++i) {
      const StoredSample& s = samples[scratch.items[i].number];
      const std::size_t place = first + begin + i;
      std::tie(out.x[place], out.y[place], out.z[place]) = std::tuple_cat(s.at);
      std::tie(out.nx[place], out.ny[place], out.nz[place]) = std::tuple_cat(s.normal);
      out.bucket[place] = s.bucket;
      out.number[place] = s.number;
    }
    begin = end;
  }
}

/// Lists the leaves of a cell's tree, whose first place is `first`, and puts its samples in their order.
void CellLayer::split(std::span<TreeItem> items, std::size_t first, const Subtree& tree, std::size_t first_node) {
  const ItemBox box = ItemBox::around(items.subspan(tree.begin, tree.end - tree.begin));
  nodes_[first_node + tree.node] = box;
  if (tree.depth == 0) {
    leaves_.push_back({first + tree.begin, first + tree.end});
    return;
  }
  const std::size_t middle = tree.begin + (tree.end - tree.begin) / 2;
  MedianSplit(items, box.longest_axis()).select(tree.begin, middle, tree.end);
  split(items, first, {2 * tree.node + 1, tree.begin, middle, tree.depth - 1}, first_node);
  split(items, first, {2 * tree.node + 2, middle, tree.end, tree.depth - 1}, first_node);
}

void CellLayer::move_up(std::size_t by) {
  for (Cell& cell : cells_) {
    cell.begin -= by;
    cell.end -= by;
  }
  for (SampleLeaf& leaf : leaves_) {
    leaf.begin -= by;
    leaf.end -= by;
  }
}

/// The first of its row that does not lie before x, or a later row's.
std::size_t CellLayer::first_cell(std::int32_t x, std::int32_t y) const {
  const auto at = std::lower_bound(cells_.begin(), cells_.end(), std::pair(y, x),
                                   [](const Cell& c, const auto& p) { return std::pair(c.y, c.x) < p; });
  return static_cast<std::size_t>(at - cells_.begin());
}

void CellLayer::search(Query& query, std::int32_t x, std::int32_t y, const PlacedAxes& at) const {
  for (std::size_t c = first_cell(x - 1, y); c < cells_.size() && cells_[c].y == y && cells_[c].x <= x + 1; ++c) {
    const Cell& cell = cells_[c];
    if (query.box.squared_to(nodes_[cell.first_node]) > query.bound) continue;
    search(query, cell, {0, cell.begin, cell.end, cell.depth}, at);
  }
}

void CellLayer::search(Query& query, const Cell& cell, const Subtree& tree, const PlacedAxes& at) const {
  if (tree.depth == 0) {
    query.bound = 0;
    for (std::size_t i = 0; i < query.count; ++i) {
      query.own[i].take<kMostInLeaf>(at, tree.begin, tree.end);
      query.bound = std::max(query.bound, query.own[i].bound());
    }
    return;
  }
  const std::size_t middle = tree.begin + (tree.end - tree.begin) / 2;
  const Subtree lower{2 * tree.node + 1, tree.begin, middle, tree.depth - 1};
  const Subtree upper{2 * tree.node + 2, middle, tree.end, tree.depth - 1};
  const float to_lower = query.box.squared_to(nodes_[cell.first_node + lower.node]);
  const float to_upper = query.box.squared_to(nodes_[cell.first_node + upper.node]);
  const bool lower_first = to_lower <= to_upper;
  if (std::min(to_lower, to_upper) <= query.bound) search(query, cell, lower_first ? lower : upper, at);
  if (std::max(to_lower, to_upper) <= query.bound) search(query, cell, lower_first ? upper : lower, at);
}

std::size_t CellLayer::count_within(const std::array<std::int32_t, 3>& from, float squared, std::int32_t x,
                                    std::int32_t y, std::int32_t by, const PlacedAxes& at) const {
  std::size_t count = 0;
  for (std::size_t c = first_cell(x - by, y); c < cells_.size() && cells_[c].y == y && cells_[c].x <= x + by; ++c) {
    for (std::size_t i = cells_[c].begin; i < cells_[c].end; ++i) {
      const auto dx = static_cast<float>(at.x[i] - from[0]);
      const auto dy = static_cast<float>(at.y[i] - from[1]);
      const auto dz = static_cast<float>(at.z[i] - from[2]);
      count += dx * dx + dy * dy + dz * dz <= squared ? 1 : 0;
    }
  }
  return count;
}

namespace {

constexpr std::uint64_t kStraySlab = 1u << 17;  ///< samples tested together, at least
/// Layers around a slab that are looked at, too.
constexpr std::int64_t kAround = 3;
/// And of the slab itself, at least: few samples are searched around for two slabs.
constexpr std::int64_t kLeastLayers = 6;

}  // namespace

Neighbourhoods::Neighbourhoods(const SlabStore& store, const KeepMasks& masks, float reach, LeafTest test)
    : store_(store),
      masks_(masks),
      side_(static_cast<std::int32_t>(std::ceil(reach))),
      reach_(reach),
      test_(test),
      cell_of_(side_),
      first_(std::numeric_limits<std::int32_t>::min()),
      end_(first_) {}

bool Neighbourhoods::advance() {
  read_least();
  std::uint64_t samples = 0;
  std::int64_t begin = end_;
  while (samples < kStraySlab || end_ - begin < kLeastLayers) {
    const std::optional<std::int64_t> layer = complete_layer_from(end_);
    if (!layer) break;
    if (samples == 0) begin = *layer;
    samples += layers_.at(*layer).size();
    end_ = *layer + 1;
  }
  if (samples == 0) return false;
  first_ = begin;
  read_below((end_ + kAround) * side_);
  forget_below(first_ - kAround);
  put_in_order();
  return true;
}

std::size_t Neighbourhoods::next_filled() const {
  std::size_t bucket = next_;
  while (bucket < store_.buckets() && store_.count(bucket) == 0) ++bucket;
  return bucket;
}

/// What a slab takes however full its layers are: the more there is to read at once, the more threads have work.
void Neighbourhoods::read_least() {
  const auto known = layers_.lower_bound(end_);
  const std::size_t next = next_filled();
  if (known == layers_.end() && next == store_.buckets()) return;
  const std::int64_t first = known != layers_.end() ? known->first : cell_of_(store_.z_lower(next));
  read_below((first + kLeastLayers + kAround) * side_);
}

/// The buckets that begin below z.
void Neighbourhoods::read_below(std::int64_t z) {
  for (;;) {
    std::size_t n = 0;
    for (; n < arriving_.size() && (next_ = next_filled()) < store_.buckets() && store_.z_lower(next_) < z; ++next_) {
      if (!masks_[next_].empty()) arriving_[n++].bucket = next_;
    }
    if (n == 0) return;
    take_in(std::span(arriving_).first(n));
  }
}

/// The lowest layer with samples from this one on, all of which have been read.
std::optional<std::int64_t> Neighbourhoods::complete_layer_from(std::int64_t layer) {
  auto found = layers_.lower_bound(layer);
  while (found == layers_.end() && next_filled() < store_.buckets()) {
    read_below(std::int64_t{store_.z_lower(next_filled())} + 1);
    found = layers_.lower_bound(layer);
  }
  if (found == layers_.end()) return std::nullopt;
  read_below((found->first + 1) * side_);
  return found->first;
}

/// Buckets read, and their samples put to those that wait in their layers, in the order of the buckets.
void Neighbourhoods::take_in(std::span<Arriving> buckets) {
  const auto each_sample = [&](Arriving& from, const auto& use) {
    Places* places = nullptr;
    std::int32_t z = 0;  // of their layer
    for (std::size_t i = 0; i < from.samples.size(); ++i) {
      if (!masks_[from.bucket][i]) continue;
      if (const std::int32_t own = cell_of_(from.samples.z[i]); places == nullptr || own != z) {
        z = own;
        places = &from.by_layer[z];
      }
      use(*places, i);
    }
  };
  tbb::parallel_for(std::size_t{0}, buckets.size(), [&](std::size_t b) {
    Arriving& from = buckets[b];
    store_.read(from.bucket, from.samples);
    from.by_layer.clear();
    each_sample(from, [](Places& places, std::size_t) { ++places.count; });
  });
  for (Arriving& from : buckets) {
    for (auto& [z, places] : from.by_layer) {
      places.layer = &layer_at(z);
      places.next = places.layer->waiting.size();
      places.layer->waiting.resize(places.next + places.count);
    }
  }
  tbb::parallel_for(std::size_t{0}, buckets.size(), [&](std::size_t b) {
    Arriving& from = buckets[b];
    const LocalSamples& s = from.samples;
    each_sample(from, [&](Places& places, std::size_t i) {
      places.layer->waiting[places.next++] = {{s.x[i], s.y[i], s.z[i]},
                                              {s.nx[i], s.ny[i], s.nz[i]},
                                              static_cast<std::uint32_t>(from.bucket),
                                              static_cast<std::uint32_t>(i)};
    });
  });
}

Neighbourhoods::Layer& Neighbourhoods::layer_at(std::int64_t z) {
  if (!layers_.contains(z) && !spare_.empty()) {
    spare_.back().key() = z;
    layers_.insert(std::move(spare_.back()));
    spare_.pop_back();
  }
  return layers_[z];
}

void Neighbourhoods::forget_below(std::int64_t layer) {
  std::size_t dropped = 0;
  while (!layers_.empty() && layers_.begin()->first < layer) {
    dropped = layers_.begin()->second.places.end;
    spare_.push_back(layers_.extract(layers_.begin()));
    spare_.back().mapped().places = {};
  }
  if (dropped == 0) return;
  samples_.drop_front(dropped);
  doubtful_.erase(doubtful_.begin(), doubtful_.begin() + static_cast<std::ptrdiff_t>(dropped));
  for (auto& [z, known] : layers_) {
    if (known.places.size() == 0) break;
    known.places = {known.places.begin - dropped, known.places.end - dropped};
    known.cells.move_up(dropped);
  }
}

void Neighbourhoods::put_in_order() {
  std::vector<Layer*> added;
  std::size_t places = 0;
  own_ = {};
  for (auto& [z, layer] : layers_) {
    if (z >= end_ + kAround) break;
    if (layer.places.size() == 0) {
      layer.places = {places, places + layer.waiting.size()};
      added.push_back(&layer);
    }
    if (z >= first_ && own_.end == 0) own_.begin = places;
    places = layer.places.end;
    if (z >= first_ && z < end_) own_.end = places;
  }
  samples_.resize(places);
  doubtful_.resize(places);
  tbb::parallel_for(std::size_t{0}, added.size(), [&](std::size_t i) {
    Layer& layer = *added[i];
    layer.cells.build(layer.waiting, side_, layer.places.begin, scratch_.local(), samples_);
    layer.waiting.clear();
    for (const SampleLeaf& leaf : layer.cells.leaves()) test_(samples_, leaf, &doubtful_[leaf.begin]);
  });
  leaves_.clear();
  for (const auto& [z, layer] : layers_) {
    if (layer.places.size() == 0) break;
    leaves_.insert(leaves_.end(), layer.cells.leaves().begin(), layer.cells.leaves().end());
  }
}

const CellLayer* Neighbourhoods::cells_of(std::int64_t layer) const {
  const auto found = layers_.find(layer);
  return found == layers_.end() || found->second.places.size() == 0 ? nullptr : &found->second.cells;
}

void Neighbourhoods::find_nearest(std::span<const std::uint32_t> places, Nearest* found) const {
  CellLayer::Query query;
  query.count = places.size();
  query.bound = reach_ * reach_;
  std::array<TreeItem, kMostInLeaf> items{};
  for (std::size_t i = 0; i < query.count; ++i) {
    const std::uint32_t place = places[i];
    items[i] = {{samples_.x[place], samples_.y[place], samples_.z[place]}, 0};
    query.own[i].start(items[i].at, place, query.bound);
  }
  query.box = ItemBox::around({items.data(), query.count});
  const std::int32_t x = cell_of_(items[0].at[0]);
  const std::int32_t y = cell_of_(items[0].at[1]);
  const std::int32_t z = cell_of_(items[0].at[2]);
  // Its own row first: what is found there leaves little to look for in the others.
  for (const std::int32_t dz : {0, -1, 1}) {
    const CellLayer* const layer = cells_of(std::int64_t{z} + dz);
    if (layer == nullptr) continue;
    for (const std::int32_t dy : {0, -1, 1}) layer->search(query, x, y + dy, samples_.axes());
  }
  for (std::size_t i = 0; i < query.count; ++i) found[i].count = query.own[i].write(found[i].places);
}

std::size_t Neighbourhoods::count_within_twice(std::size_t place) const {
  const std::array<std::int32_t, 3> at{samples_.x[place], samples_.y[place], samples_.z[place]};
  std::size_t count = 0;
  for (std::int32_t dz = -2; dz <= 2; ++dz) {
    const CellLayer* const layer = cells_of(std::int64_t{cell_of_(at[2])} + dz);
    if (layer == nullptr) continue;
    for (std::int32_t dy = -2; dy <= 2; ++dy) {
      count += layer->count_within(at, 4 * reach_ * reach_, cell_of_(at[0]), cell_of_(at[1]) + dy, 2, samples_.axes());
    }
  }
  return count - 1;  // itself
}

}  // namespace lamina
