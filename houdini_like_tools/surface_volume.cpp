#include "surface_volume.h"

#include "text.h"
#include "words.h"

namespace lamina::tools {

void add_volume_options(CLI::App& tool, VolumeExport& v) {
  const std::string volume = "Volume";
  tool.add_option("--vdb", v.path, "write the signed distance as an OpenVDB level set, grid surface, too")
      ->type_name("OUT.vdb")
      ->group(volume);
  tool.add_option("--vdb-grids", v.grids,
                  "further grids: N, Cd, weight, curvature, any attribute; auto: Cd with colours")
      ->delimiter(',')
      ->expected(1, -1)
      ->option_text("NAME,... [auto]")
      ->group(volume);
  tool.add_option("--vdb-precision", v.half, "numbers of 16 or 32 bits")
      ->transform(words<bool>({{"half", true}, {"float", false}}))
      ->option_text("half|float [half]")
      ->group(volume);
  tool.add_option("--vdb-band", v.band, "half width of the band, voxels")->capture_default_str()->group(volume);
  tool.add_option("--vdb-voxelsize", v.voxel,
                  "edge of a voxel: the octree's nearest cell size is taken; 0: most cells'")
      ->capture_default_str()
      ->group(volume);
  tool.add_flag("--vdb-levels", v.levels, "one grid per level of the octree, surface_L0 the finest, for inspection")
      ->group(volume);
  tool.add_option_function<std::string>(
          "--vdb-split", [&v](const std::string& text) { v.split = parse_bytes(text); },
          "begin a new file, OUT.0001.vdb ..., after so many bytes of voxels in memory")
      ->type_name("SIZE")
      ->group(volume);
  tool.add_option("--vdb-points", v.points, "write the projected corners as an OpenVDB points grid (P, N, Cd, pscale)")
      ->type_name("OUT.vdb")
      ->group(volume);
}

}  // namespace lamina::tools
