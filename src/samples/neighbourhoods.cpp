#include "samples/neighbourhoods.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace lamina {
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

void Neighbourhoods::read_below(std::int64_t z) {
  while (next_filled() < store_.buckets() && store_.z_lower(next_filled()) < z) read_next();
}

/// The lowest layer with samples from this one on, all of which have been read.
std::optional<std::int64_t> Neighbourhoods::complete_layer_from(std::int64_t layer) {
  auto found = layers_.lower_bound(layer);
  while (found == layers_.end() && next_filled() < store_.buckets()) {
    read_next();
    found = layers_.lower_bound(layer);
  }
  if (found == layers_.end()) return std::nullopt;
  read_below((found->first + 1) * side_);
  return found->first;
}

void Neighbourhoods::read_next() {
  const std::size_t bucket = next_filled();
  next_ = bucket + 1;
  store_.read(bucket, local_);
  Layer* layer = nullptr;
  std::int32_t z = 0;  // of that layer
  for (std::size_t i = 0; i < local_.size(); ++i) {
    if (!masks_[bucket][i]) continue;
    if (const std::int32_t own = cell_of_(local_.z[i]); layer == nullptr || own != z) {
      z = own;
      if (!layers_.contains(z) && !spare_.empty()) {
        spare_.back().key() = z;
        layers_.insert(std::move(spare_.back()));
        spare_.pop_back();
      }
      layer = &layers_[z];
    }
    layer->waiting.push_back({{local_.x[i], local_.y[i], local_.z[i]},
                              {local_.nx[i], local_.ny[i], local_.nz[i]},
                              static_cast<std::uint32_t>(bucket),
                              static_cast<std::uint32_t>(i)});
  }
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
