#include <fmt/format.h>
#include <openvdb/tools/LevelSetUtil.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>

#include "base/run.h"
#include "lamina/error.h"
#include "vdb/vdb_file.h"
#include "volume/level_set_data.h"
#include "volume/open_inside.h"

namespace lamina {

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
