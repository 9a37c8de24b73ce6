#include "volume/volume_data.h"

#include <fmt/format.h>
#include <openvdb/tools/LevelSetUtil.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "base/run.h"
#include "lamina/error.h"
#include "lattice/morphology.h"
#include "vdb/vdb_file.h"

namespace lamina::volume {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using BandLeaf = FloatTree::LeafNodeType;

constexpr int kLeafSide = 8;

/// Voxels of a leaf are masks whose last axis is OpenVDB's first. `which`: of the six faces, the low and high end of
/// OpenVDB's axis 0, 1, 2.
BlockMask face_of_leaf(int which) {
  return bits::face(2 - which / 2, which % 2 != 0);
}
/// Voxels on a face, seen from the leaf beyond.
BlockMask across_face(const BlockMask& voxels, int which) {
  return bits::across(voxels, 2 - which / 2, which % 2 != 0);
}

class OpenInside {
 public:
  explicit OpenInside(FloatGrid& grid) : tree_(grid.tree()), cells_(grid.tree()), background_(grid.background()) {}

  void empty() {
    begin();
    while (!seeds_.empty() || !tiles_.empty()) {
      while (!tiles_.empty()) {
        const auto [origin, side] = tiles_.back();
        tiles_.pop_back();
        for_cells_beside(origin, side,
                         [&](const Coord& cell, int which) { enter(cell, across_face(face_of_leaf(which), which)); });
      }
      if (seeds_.empty()) break;
      const auto seed = seeds_.extract(seeds_.begin());
      spread(seed.key(), seed.mapped());
    }
    for (const auto& [origin, voxels] : outside_) {
      BandLeaf& leaf = *tree_.probeLeaf(origin);
      for (openvdb::Index i = 0; i < BandLeaf::SIZE; ++i)
        if (voxels.test(static_cast<int>(i))) leaf.setValueOnly(i, background_);
    }
  }

 private:
  /// Leaf-sized cells that share a face with a cube; `which`: the cube's face.
  template <class Visit>
  void for_cells_beside(const Coord& origin, int side, const Visit& visit) {
    for (int which = 0; which < 6; ++which) {
      const int axis = which / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
      Coord cell = origin;
      cell[axis] += (which & 1) != 0 ? side : -kLeafSide;
      for (int i = 0; i < side; i += kLeafSide) {
        for (int j = 0; j < side; j += kLeafSide) {
          cell[u] = origin[u] + i;
          cell[v] = origin[v] + j;
          visit(cell, which);
        }
      }
    }
  }

  [[nodiscard]] bool is_outside_tile(const Coord& cell) {
    return cells_.probeConstLeaf(cell) == nullptr && cells_.getValue(cell) > 0;
  }

  void begin() {
    for (auto leaf = tree_.cbeginLeaf(); leaf; ++leaf) {
      for_cells_beside(leaf->origin(), kLeafSide, [&](const Coord& cell, int which) {
        if (is_outside_tile(cell)) add(leaf->origin(), face_of_leaf(which));
      });
    }
    std::vector<Coord> open;
    auto tile = tree_.cbeginValueOff();
    tile.setMaxDepth(FloatTree::ValueOffCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
      if (*tile > 0) continue;
      openvdb::CoordBBox box;
      tile.getBoundingBox(box);
      bool beside = false;
      for_cells_beside(box.min(), box.dim()[0],
                       [&](const Coord& cell, int) { beside = beside || is_outside_tile(cell); });
      if (beside) open.push_back(box.min());
    }
    for (const Coord& origin : open) enter(origin, {});
  }

  void add(const Coord& leaf, const BlockMask& voxels) { seeds_[leaf] |= voxels; }

  /// The outside has come to a leaf's voxels, or to a tile.
  void enter(const Coord& cell, const BlockMask& voxels) {
    if (cells_.probeConstLeaf(cell) != nullptr) return add(cell, voxels);
    if (cells_.getValue(cell) > 0) return;
    const int depth = tree_.getValueDepth(cell);
    const auto level = static_cast<openvdb::Index>(static_cast<int>(FloatTree::DEPTH) - 1 - depth);
    const int side = level == 1 ? kLeafSide : level == 2 ? kLeafSide * 16 : kLeafSide * 16 * 32;
    const Coord origin = cell & ~(side - 1);
    tree_.addTile(level, origin, background_, /*active*/ false);
    tiles_.emplace_back(origin, side);
  }

  void spread(const Coord& origin, const BlockMask& seeds) {
    const BandLeaf& leaf = *tree_.probeConstLeaf(origin);
    BlockMask free;
    for (openvdb::Index i = 0; i < BandLeaf::SIZE; ++i)
      if (!leaf.isValueOn(i) && leaf.getValue(i) < 0) free.set(static_cast<int>(i));
    BlockMask& done = outside_[origin];
    const BlockMask now = bits::connected(seeds & free & ~done, free), more = now & ~done;
    done |= now;
    if (!more.any()) return;
    for_cells_beside(origin, kLeafSide, [&](const Coord& cell, int which) {
      const BlockMask beyond = across_face(more, which);
      if (beyond.any()) enter(cell, beyond);
    });
  }

  FloatTree& tree_;
  openvdb::tree::ValueAccessor<FloatTree, false> cells_;  ///< not registered with the tree: no leaf comes or goes
  float background_;
  std::map<Coord, BlockMask> seeds_, outside_;
  std::vector<std::pair<Coord, int>> tiles_;  ///< turned, their neighbours not yet looked at; origin and side
};

}  // namespace

void empty_open_inside(openvdb::FloatGrid& grid) {
  OpenInside(grid).empty();
}

}  // namespace lamina::volume

namespace lamina {
namespace {

using openvdb::GridBase;

/// How well a grid serves as a fog; 0: not at all. Whoever names one may take any numbers for densities.
int fog_fitness(const GridBase& grid, bool named) {
  if (!volume::is_scalar(grid) || grid.getGridClass() == openvdb::GRID_LEVEL_SET) return 0;
  if (grid.getName() == "density") return 3;
  return named || grid.getGridClass() == openvdb::GRID_FOG_VOLUME ? 2 : 0;
}

}  // namespace

FogVolume::FogVolume(std::shared_ptr<const Data> data) : data_(std::move(data)) {}
const std::string& FogVolume::name() const {
  return data_->name;
}
double FogVolume::voxel() const {
  const openvdb::Vec3d v = data_->grid->voxelSize();
  return std::min({v[0], v[1], v[2]});
}

FogVolume read_fog(const std::string& path, const std::string& name) {
  const volume::VdbFile file = volume::read_vdb(path);
  const GridBase::Ptr grid = volume::choose_grid(path, file.grids, name, "fog volume", fog_fitness);
  auto data = std::make_shared<FogVolume::Data>();
  data->name = grid->getName();
  data->grid = volume::as_float(grid);
  data->colours = volume::colours_of(file.grids);
  return FogVolume(std::move(data));
}

std::uint64_t write_fog(const LevelSet& level_set, const FogSettings& settings, const std::string& path,
                        const RunContext& run) {
  if (settings.name.empty()) throw Error(ExitCode::usage, "--name must be a word");
  if (!(settings.ramp >= 0)) throw Error(ExitCode::usage, "--ramp must be a length, or 0 for the whole band");
  openvdb::FloatGrid::Ptr fog = level_set.data().grid->deepCopy();
  if (level_set.data().open) volume::empty_open_inside(*fog);
  const auto band = static_cast<float>(level_set.band());
  const float ramp = settings.ramp > 0 ? std::min(static_cast<float>(settings.ramp), band) : band;
  with_threads(run.threads, [&] {
    openvdb::tools::sdfToFogVolume(*fog, ramp);
    // Deeper than the ramp OpenVDB goes on rising.
    openvdb::tree::LeafManager<openvdb::FloatTree> leaves(fog->tree());
    leaves.foreach ([](openvdb::FloatTree::LeafNodeType& leaf, std::size_t) {
      for (auto value = leaf.beginValueOn(); value; ++value) value.setValue(std::min(*value, 1.0F));
    });
  });
  if (fog->activeVoxelCount() == 0) {
    throw Error(ExitCode::empty,
                fmt::format("{}: grid {} has no inside to fill with density", level_set.data().path, level_set.name()));
  }
  fog->clearMetadata();
  fog->setGridClass(openvdb::GRID_FOG_VOLUME);
  volume::label(*fog, settings.name, settings.half);
  return volume::write_vdb({fog}, path);
}

}  // namespace lamina
