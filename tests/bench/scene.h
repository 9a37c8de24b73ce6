// A cloud held in memory, brought as far as the slab store and the plan: what every benchmark starts from.
#pragma once
#include <cstdint>
#include <memory>
#include <string>

#include "lamina/points.h"
#include "reconstruct/plan.h"
#include "store/ingest.h"

namespace lamina::bench {

/// Points scattered over a procedural shape, in memory.
std::unique_ptr<PointSource> scattered(const std::string& shape, std::uint64_t count, bool colours);

struct Scene {
  std::unique_ptr<PointSource> source;
  SurfaceSettings settings;
  std::unique_ptr<StoredCloud> cloud;
  ReconstructionPlan plan;
  std::string folder;  ///< for temporary files
  [[nodiscard]] std::uint64_t samples() const { return source->info().count; }
  [[nodiscard]] std::size_t attributes() const { return source->info().attributes.size(); }
};

Scene make_scene(const std::string& shape, std::uint64_t count, bool colours, const std::string& folder);

}  // namespace lamina::bench
