// OpenVDB's reader behind our walk through the file. OpenVDB itself is not instrumented; what it asks for is: the
// allocator's checks see every byte it writes past its arrays.
#include "vdb/vdb_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "harness.h"
#include "lamina/volume_points.h"

FUZZED(vdb) {
  using namespace lamina;
  const InputFile file = fuzz::as_file(data, size);
  const std::string path = fmt::format("/proc/self/fd/{}", file.file.get());
  return fuzz::run([&] {
    const auto grids = volume::read_vdb(path).grids;
    const auto is_points = [](const auto& grid) { return volume::kind_of(*grid) == "points"; };
    if (std::any_of(grids.begin(), grids.end(), is_points)) read_point_volume(path);
  });
}
