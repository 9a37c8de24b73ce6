// Pages to look at a mesh, a cloud or a tile set in a browser: one file that holds everything, or served on this
// machine alone.
#pragma once
#include <cstdint>
#include <functional>
#include <string>

#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "lamina/points.h"
#include "lamina/run.h"

namespace lamina {

enum class ViewUp : std::uint8_t {
  automatic,
  x,
  y,
  z
};  ///< automatic: z for surveys (from the air, or far from the origin) and tiles, else y

/// What a page is made with.
struct ViewSettings {
  std::string bundle;             ///< the viewer's code, a file (find_viewer())
  std::string title;              ///< of the page; what is shown, as a rule the file's name
  ViewUp up = ViewUp::automatic;  ///< the axis that points up
  std::uint64_t points = 0;       ///< at most so many points, spread evenly over the cloud; 0: all
  BadSamples bad = BadSamples::drop;
  std::uint64_t most_bytes = 400'000'000;  ///< of data in one page: more than that, browsers do not open
};

/// What a page shows.
struct ViewStats {
  std::uint64_t vertices = 0, triangles = 0;
  std::uint64_t boundary_edges = 0, boundary_loops = 0;
  std::uint64_t points = 0, points_there = 0;  ///< shown, and in the cloud
  std::uint64_t tiles = 0;                     ///< files of a tile set
  std::uint64_t bytes = 0;                     ///< of data, before it is compressed
};

/// The viewer's code beside the program: share/lamina/viewer.js in its folder (where it was built) or beside that
/// (where it is installed). Throws Error(usage) telling how to get it.
std::string find_viewer();

/// A page that shows the mesh: one file, which needs no network. Throws Error(empty) for a mesh without triangles,
/// Error(budget) where one page cannot hold it, naming the remedy, or where the page cannot be written.
ViewStats write_mesh_page(const TriangleMesh& mesh, const ViewSettings& settings, const std::string& path);

/// The same of points, of which settings.points are kept. Throws Error(empty) where no point is usable,
/// Error(unreadable) for bad ones that are refused.
ViewStats write_points_page(PointSource& source, const ViewSettings& settings, const std::string& path,
                            const RunContext& run = {});

/// The same of a folder with a tileset.json: every file of 3D Tiles in it and below. Throws Error(unreadable) where
/// there is none, Error(budget) where a page cannot hold them.
ViewStats write_tiles_page(const std::string& folder, const ViewSettings& settings, const std::string& path);

/// Serves the page and the files of a tile set at 127.0.0.1 until the run is cancelled; port 0 takes a free one.
/// `listening` is told the page's address. Only GET, and only files under `folder`, links out of it excluded.
/// Throws Error(budget) where the port is taken, Error(usage) where the program was built without a server.
void serve_tiles(const std::string& folder, const ViewSettings& settings, int port,
                 const std::function<void(const std::string&)>& listening, const RunContext& run);

}  // namespace lamina
