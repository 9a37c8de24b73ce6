#include "bench/replay.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdio>
#include <limits>

#include "isosurface/extract.h"
#include "mls/extension.h"
#include "mls/project.h"
#include "octree/refine.h"
#include "reconstruct/mesh_output.h"
#include "reconstruct/stages.h"

namespace lamina::bench {
namespace {

FeedSettings all_cached(FeedSettings settings) {
  settings.cache_bytes = std::numeric_limits<std::size_t>::max();
  return settings;
}

}  // namespace

Replay::Replay(const Scene& scene, const ProjectSettings& settings, const Kernel& kernel)
    : scene_(scene),
      settings_(settings),
      kernel_(kernel),
      feed_(scene.cloud->ingested.store, scene.plan.lattice, all_cached(scene.plan.feed), scene.plan.radii, false),
      window_(scene.plan.lattice, static_cast<int>(scene.attributes()), scene.plan.extent),
      projector_(settings, kernel),
      first_(scene.plan.slabs.begin),
      last_(scene.plan.slabs.end - 1) {}

void Replay::mark(const ActiveBucket& bucket) {
  constexpr std::size_t kPiece = 4096;
  const std::size_t n = bucket.samples.size();
  tbb::parallel_for(std::size_t{0}, (n + kPiece - 1) / kPiece, [&](std::size_t piece) {
    std::vector<Mark> marks;
    for (std::size_t i = piece * kPiece; i < std::min(n, (piece + 1) * kPiece); ++i) {
      if (bucket.support[i] <= 0) continue;
      marks.push_back(
          {bucket.samples.x[i], bucket.samples.y[i], bucket.samples.z[i], bucket.level[i], bucket.support[i]});
    }
    mark_samples(window_, marks);
  });
}

void Replay::number() {
  for (std::int32_t s = first_; s <= last_; ++s) {
    auto here = std::make_shared<IsoSlab>();
    number_edges(window_, s, {}, iso_.empty() ? nullptr : iso_.back().get(), *here);
    iso_.push_back(std::move(here));
  }
}

void Replay::triangulate() {
  IsoSlab nothing;
  ExtractCounts counts;
  for (std::size_t k = 0; k < iso_.size(); ++k) {
    IsoSlab& above = k + 1 < iso_.size() ? *iso_[k + 1] : nothing;
    lamina::triangulate(window_, first_ + static_cast<std::int32_t>(k), *iso_[k], above, counts);
    separate_fans(k > 0 ? iso_[k - 1].get() : nullptr, *iso_[k], &above, counts);
  }
}

void Replay::cluster(ClusterMode mode) {
  Clusterer clusterer(ClusterSettings{mode});
  for (const auto& slab : iso_) clusterer.push(slab);
  clusterer.finish();
  final_.clear();
  FinalSlab slab;
  while (clusterer.pop(slab)) final_.push_back(std::move(slab));
}

std::uint64_t Replay::write() const {
  MeshSinkSettings settings;
  settings.path = scene_.folder + "/mesh.ply";
  settings.attributes = scene_.source->info().attributes;
  MeshSink sink(settings);
  VertexBatch vertices;
  for (std::size_t k = 0; k < final_.size(); ++k) {
    const IsoSlab* next = k + 1 < iso_.size() ? iso_[k + 1].get() : nullptr;
    place_vertices({final_[k], *iso_[k], next}, scene_.plan, vertices);
    sink.append_vertices(vertices);
    sink.append_triangles(final_[k].triangles);
  }
  sink.commit();
  std::remove(settings.path.c_str());
  return sink.triangles();
}

void Replay::run(Stage stage) {
  const auto every_slab = [&](const auto& work) {
    for (std::int32_t s = first_; s <= last_; ++s) work(s);
  };
  switch (stage) {
    case Stage::load:
      feed_.prepare(std::numeric_limits<std::int64_t>::max(), [&](const Batch& ready) {
        for (const auto& b : ready) buckets_.push_back(std::make_shared<ActiveBucket>(*b));
      });
      every_slab([&](std::int32_t s) { window_.cover(s); });
      return;
    case Stage::mark:
      for (const auto& bucket : buckets_) mark(*bucket);
      return;
    case Stage::refine:
      return every_slab([&](std::int32_t s) { refine_slab(window_, s); });
    case Stage::place:
      return every_slab([&](std::int32_t s) { place_corners(window_, s); });
    case Stage::project:
      return every_slab([&](std::int32_t s) { projector_.project(window_, s, feed_); });
    case Stage::diffuse:
      if (settings_.centres) every_slab([&](std::int32_t s) { diffuse_slab(window_, s); });
      return;
    case Stage::extend:
      return every_slab(
          [&](std::int32_t s) { extend_slab(window_, s, kernel_, static_cast<float>(scene_.settings.boundary)); });
    case Stage::number:
      return number();
    case Stage::triangulate:
      return triangulate();
    case Stage::cluster:
      return cluster(scene_.settings.cluster);
  }
}

void Replay::run_before(Stage stage) {
  for (int s = 0; s < static_cast<int>(stage); ++s) run(static_cast<Stage>(s));
}

}  // namespace lamina::bench
