// lamina.volume and lamina.voxels: meshes as .vdb files, and level sets and fogs as arrays.
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "common/console.h"
#include "functions.h"
#include "keywords.h"
#include "lamina/error.h"
#include "lamina/volume.h"
#include "lamina/volume_tools.h"
#include "mesh.h"
#include "run.h"
#include "tables.h"

namespace lamina::python {
namespace {

/// A folder that is gone with this.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const std::string& directory) {
    const std::filesystem::path place(directory.empty() ? std::filesystem::temp_directory_path().string() : directory);
    path_ = (place / "lamina-XXXXXX").string();
    if (::mkdtemp(path_.data()) == nullptr)
      throw Error(ExitCode::budget, place.string() + ": no temporary folder can be made in it");
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] std::string file(const char* name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

py::object volume(const py::object& mesh, const py::object& output, const py::object& progress,
                  const py::kwargs& keywords) {
  Keywords words("volume");
  VolumeSettings settings;
  tools::RunOptions run;
  tools::add_grid_options(words.app(), settings);
  tools::add_run_options(words.app(), run);
  words.parse(keywords);
  const std::vector<std::string> names = paths_of(output);
  if (names.size() != 1) throw py::type_error("volume: output must be a path");
  const std::shared_ptr<MeshData> data = mesh_argument(mesh);
  VolumeStats stats;
  run_job(run, progress, [&](const RunContext& context) {
    stats = write_volume(WithAttributes(data).mesh(), settings, names.front(), context);
  });
  return from_json(nlohmann::json{
      {"voxel", stats.voxel},
      {"boundary_edges", stats.boundary_edges},
      {"has_sign", stats.has_sign},
      {"voxels", stats.voxels},
      {"has_colours", stats.has_colours},
      {"bytes",
       stats.bytes}}.dump());
}

/// A grid's voxels, dense or sparse.
struct Block {
  DenseVoxels dense;
  SparseVoxels sparse;
};

template <class Grid>
Block block_of(const Grid& grid, bool sparse, const RunContext& context) {
  if (sparse) return {{}, sparse_voxels(grid, context)};
  return {dense_voxels(grid, context), {}};
}

py::tuple as_tuple(const std::array<double, 3>& v) {
  return py::make_tuple(v[0], v[1], v[2]);
}

bool is_fog(const std::string& path, const std::string& name) {
  bool fog = false, level_set = false;
  for (const GridInfo& grid : describe_volume(path).grids) {
    if (!name.empty() && grid.name != name) continue;
    fog = fog || grid.grid_class == "fog volume";
    level_set = level_set || grid.grid_class == "level set";
  }
  return fog && !level_set;
}

py::object voxels(const py::object& source, const std::string& grid, bool sparse, const py::object& progress,
                  const py::kwargs& keywords) {
  Keywords words("voxels");
  VolumeSettings settings;
  tools::RunOptions run;
  words.leave_out({"name", "no-colour", "half"});
  tools::add_grid_options(words.app(), settings);
  tools::add_run_options(words.app(), run);
  words.parse(keywords);
  std::vector<std::string> names = paths_of(source);
  std::shared_ptr<MeshData> data;
  if (names.empty() || std::filesystem::path(names.front()).extension() != ".vdb") data = mesh_argument(source);
  Block block;
  run_job(run, progress, [&](const RunContext& context) {
    if (!data) {
      block = is_fog(names.front(), grid) ? block_of(read_fog(names.front(), grid), sparse, context)
                                          : block_of(read_level_set(names.front(), grid), sparse, context);
      return;
    }
    const TemporaryFolder folder(context.tmp_dir);
    settings.colours = false;
    write_volume(data->geometry, settings, folder.file("mesh.vdb"), context);
    block = block_of(read_level_set(folder.file("mesh.vdb")), sparse, context);
  });
  const py::module_ package = py::module_::import("lamina");
  if (sparse) {
    const py::array indices = owning_array(std::move(block.sparse.indices));
    return package.attr("SparseVoxels")(owning_array(std::move(block.sparse.values)), indices,
                                        as_tuple(block.sparse.origin), block.sparse.edge);
  }
  const DenseVoxels& dense = block.dense;
  const std::vector<py::ssize_t> shape(dense.size.begin(), dense.size.end());
  const auto held = std::make_shared<std::vector<float>>(std::move(block.dense.values));
  return package.attr("Voxels")(shared_array(held, held->data(), shape), as_tuple(dense.origin), dense.edge);
}

}  // namespace

void add_volume_functions(py::module_& module) {
  Keywords words("volume");
  VolumeSettings settings;
  tools::RunOptions run;
  tools::add_grid_options(words.app(), settings);
  tools::add_run_options(words.app(), run);
  words.list_in(module);
  Keywords for_voxels("voxels");
  for_voxels.leave_out({"name", "no-colour", "half"});
  tools::add_grid_options(for_voxels.app(), settings);
  tools::add_run_options(for_voxels.app(), run);
  for_voxels.list_in(module);
  module.def("volume", &volume, py::arg("mesh"), py::arg("output"), py::kw_only(), py::arg("progress") = py::none(),
             (R"(Writes a mesh as an OpenVDB level set, and its colours as Cd; returns a dict of what was written.

mesh: a Mesh or a path. output: .vdb.

)" + words.describe())
                 .c_str());
  module.def("voxels", &voxels, py::arg("source"), py::kw_only(), py::arg("grid") = "", py::arg("sparse") = false,
             py::arg("progress") = py::none(),
             R"(Signed distances, or a fog's densities, as an array: a lamina.Voxels.

source: a Mesh or a mesh's path, of which a level set is made by voxelsize, halfbandvoxels and sign as volume() does; or
the path of a .vdb, of which grid names the one that is wanted. Distances are in the units of the mesh, negative inside;
beyond the band they have its half width. sparse: a lamina.SparseVoxels, the active voxels alone.)");
}

}  // namespace lamina::python
