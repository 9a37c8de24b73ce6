#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/output_file.h"
#include "base/union_find.h"
#include "lamina/edit.h"
#include "lamina/error.h"
#include "lamina/mesh.h"
#include "lamina/view.h"
#include "measure/edge_table.h"
#include "meshes/formats.h"
#include "view/page_writer.h"
#include "view/tile_files.h"

namespace lamina {

namespace view {
namespace {

const char* up_word(ViewUp up, bool survey) {
  switch (up) {
    case ViewUp::x:
      return "x";
    case ViewUp::y:
      return "y";
    case ViewUp::z:
      return "z";
    case ViewUp::automatic:
      break;
  }
  return survey ? "z" : "y";
}

/// Coordinates far from their origin are those of surveys, whose third one is the height.
bool is_far(const TriangleMesh& mesh) {
  constexpr double kFar = 20;  // extents
  bool far = false;
  double extent = 0;
  std::array<double, 3> distance{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto less = [k](const auto& a, const auto& b) { return a[k] < b[k]; };
    const auto [low, high] = std::minmax_element(mesh.positions.begin(), mesh.positions.end(), less);
    extent = std::max(extent, (*high)[k] - (*low)[k]);
    distance[k] = std::abs((*low)[k] + (*high)[k]) / 2;
  }
  for (const double d : distance) far = far || d > kFar * extent;
  return far;
}

std::string megabytes(std::uint64_t bytes) {
  return fmt::format("{:.0f} MB", static_cast<double>(bytes) * 1e-6);
}

/// The page's file with the model in it, ready for its description.
class PageFile {
 public:
  PageFile(const ViewSettings& settings, const std::string& path)
      : bundle_(read_bundle(settings.bundle)),
        file_(path),
        page_([this](std::string_view text) { file_.write(text); }, settings.title) {}

  PageWriter& page() { return page_; }
  void add_model(const TriangleMesh& mesh) {
    page_.begin_block("model");
    meshes::write_glb(mesh, file_.name(), [this](std::string_view bytes) { page_.add(bytes); });
    page_.end_block();
  }
  void commit(const PageJson& description) {
    page_.finish(description, bundle_);
    file_.commit();
  }

 private:
  std::string bundle_;
  ResultFile file_;
  PageWriter page_;
};

void add_attributes(PageJson& description, const AttributeLayout& layout) {
  description["attributes"] = PageJson::array();
  for (const AttributeSpec& a : layout) description["attributes"].push_back(a.name);
}

std::uint64_t count_loops(const std::vector<measure::Edge>& edges) {
  std::vector<std::uint32_t> ends;
  for (const measure::Edge& e : edges) ends.insert(ends.end(), e.begin(), e.end());
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  const auto place = [&](std::uint32_t v) {
    return static_cast<std::uint32_t>(std::lower_bound(ends.begin(), ends.end(), v) - ends.begin());
  };
  UnionFind loops(ends.size());
  for (const measure::Edge& e : edges) loops.unite(place(e[0]), place(e[1]));
  std::uint64_t count = 0;
  for (std::uint32_t v = 0; v < ends.size(); ++v) count += loops.find(v) == v;
  return count;
}

/// Which of the rows are kept where they are too many: one of each run of equal length, by chance, so that scan lines
/// make no pattern; the same ones each time.
class EvenSubset {
 public:
  EvenSubset(std::uint64_t rows, std::uint64_t most) : rows_(rows), kept_(most == 0 ? rows : std::min(rows, most)) {}
  [[nodiscard]] bool all() const { return kept_ == rows_; }
  [[nodiscard]] std::uint64_t kept() const { return kept_; }
  /// Rows come in order.
  bool keep(std::uint64_t row) {
    if (all()) return true;
    if (run_ < kept_ && row == chosen(run_)) {
      ++run_;
      return true;
    }
    return false;
  }

 private:
  [[nodiscard]] std::uint64_t chosen(std::uint64_t run) const {
    const auto start = [&](std::uint64_t k) { return k * rows_ / kept_; };
    std::uint64_t bits = run * 0x9E3779B97F4A7C15U;
    bits = (bits ^ bits >> 32) * 0xD6E8FEB86659FD93U;
    return start(run) + (bits >> 32) % std::max<std::uint64_t>(1, start(run + 1) - start(run));
  }
  std::uint64_t rows_, kept_, run_ = 0;
};

/// A mesh of points alone.
struct PointCollector {
  TriangleMesh mesh;
  explicit PointCollector(const PointSourceInfo& info) {
    mesh.layout = info.attributes;
    if (info.has_radius) mesh.layout.push_back({info.radius_name.empty() ? "radius" : info.radius_name});
    if (info.has_quality) mesh.layout.push_back({info.quality_name.empty() ? "quality" : info.quality_name});
    mesh.attributes.resize(mesh.layout.size());
  }
  void add(const SampleBatch& batch) {
    for (std::size_t i = 0; i < batch.size(); ++i) {
      mesh.positions.push_back({batch.x[i], batch.y[i], batch.z[i]});
      if (!batch.nx.empty()) mesh.normals.push_back({batch.nx[i], batch.ny[i], batch.nz[i]});
      std::size_t a = 0;
      for (const auto& values : batch.attributes) mesh.attributes[a++].push_back(values[i]);
      if (!batch.radius.empty()) mesh.attributes[a++].push_back(batch.radius[i]);
      if (!batch.quality.empty()) mesh.attributes[a++].push_back(batch.quality[i]);
    }
  }
};

}  // namespace
}  // namespace view

ViewStats write_mesh_page(const TriangleMesh& mesh, const ViewSettings& settings, const std::string& path) {
  using namespace view;
  if (mesh.triangles.empty()) throw Error(ExitCode::empty, settings.title + ": a mesh without triangles");
  ViewStats stats;
  stats.vertices = mesh.positions.size();
  stats.triangles = mesh.triangles.size();
  stats.bytes = meshes::glb_data_bytes(mesh.layout, !mesh.normals.empty(), stats.vertices, stats.triangles);
  if (stats.bytes > settings.most_bytes) {
    throw Error(
        ExitCode::budget,
        fmt::format("{}: {} triangles are {} of data, and a page holds {}; make tiles ('lamina tiles'), or fewer "
                    "triangles ('lamina simplify')",
                    settings.title, stats.triangles, megabytes(stats.bytes), megabytes(settings.most_bytes)));
  }
  PageFile file(settings, path);
  file.add_model(mesh);
  const std::vector<measure::Edge> boundary = measure::boundary_edges(mesh);
  stats.boundary_edges = boundary.size();
  stats.boundary_loops = count_loops(boundary);
  if (!boundary.empty()) {
    file.page().begin_block("boundary");
    file.page().add({reinterpret_cast<const char*>(boundary.data()), boundary.size() * sizeof boundary[0]});
    file.page().end_block();
  }
  PageJson description{{"kind", "mesh"},
                       {"title", settings.title},
                       {"up", up_word(settings.up, is_far(mesh))},
                       {"vertices", stats.vertices},
                       {"triangles", stats.triangles},
                       {"boundaryEdges", stats.boundary_edges},
                       {"boundaryLoops", stats.boundary_loops}};
  add_attributes(description, mesh.layout);
  file.commit(description);
  return stats;
}

ViewStats write_points_page(PointSource& source, const ViewSettings& settings, const std::string& path,
                            const RunContext& run) {
  using namespace view;
  const PointSourceInfo& info = source.info();
  EvenSubset subset(info.count, settings.points);
  PointCollector collector(info);
  ViewStats stats;
  stats.points_there = info.count;
  stats.bytes = meshes::glb_data_bytes(collector.mesh.layout, info.has_normals, subset.kept(), 0);
  if (stats.bytes > settings.most_bytes) {
    const std::uint64_t fit = subset.kept() * settings.most_bytes / stats.bytes;
    throw Error(
        ExitCode::budget,
        fmt::format("{}: {} points are {} of data, and a page holds {}; --points {} shows an even subset",
                    settings.title, subset.kept(), megabytes(stats.bytes), megabytes(settings.most_bytes), fit));
  }
  PageFile file(settings, path);
  SampleBatch batch;
  EditReport report;
  constexpr std::uint64_t kBatch = 1u << 16;
  std::vector<std::uint8_t> keep;
  for (std::uint64_t first = 0; first < info.count; first += kBatch) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    source.read(first, kBatch, batch);
    keep.resize(batch.size());
    for (std::size_t i = 0; i < batch.size(); ++i) keep[i] = subset.keep(first + i) ? 1 : 0;
    const EditReport part = clean_rows(batch, keep);
    if (part.bad_rows > 0 && settings.bad == BadSamples::refuse) refuse_bad_row(part, settings.title);
    add(report, part);
    collector.add(batch);
    if (run.progress) run.progress({"read", std::min(first + kBatch, info.count), info.count, 0, 0});
  }
  warn_of_bad_rows(report, settings.title, run);
  const TriangleMesh& mesh = collector.mesh;
  if (mesh.positions.empty()) throw Error(ExitCode::empty, settings.title + ": no usable point");
  stats.points = mesh.positions.size();
  file.add_model(mesh);
  const bool survey = info.from_above || !info.crs.empty() || is_far(mesh);
  PageJson description{{"kind", "points"},
                       {"title", settings.title},
                       {"up", up_word(settings.up, survey)},
                       {"points", stats.points},
                       {"pointsThere", stats.points_there}};
  if (!info.crs.empty()) description["crs"] = crs_name(info.crs);
  add_attributes(description, mesh.layout);
  file.commit(description);
  return stats;
}

ViewStats write_tiles_page(const std::string& folder, const ViewSettings& settings, const std::string& path) {
  using namespace view;
  const std::vector<TileFile> files = tile_files(folder);
  ViewStats stats;
  stats.tiles = files.size();
  for (const TileFile& f : files) stats.bytes += f.bytes;
  if (stats.bytes > settings.most_bytes) {
    throw Error(ExitCode::budget,
                fmt::format("{}: {} files are {} of data, and a page holds {}; serve them with --serve", folder,
                            stats.tiles, megabytes(stats.bytes), megabytes(settings.most_bytes)));
  }
  PageFile file(settings, path);
  std::vector<char> piece(1u << 20);
  for (const TileFile& f : files) {
    std::ifstream in(folder + "/" + f.name, std::ios::binary);
    file.page().begin_block("file:" + f.name);
    while (in.read(piece.data(), static_cast<std::streamsize>(piece.size())), in.gcount() > 0)
      file.page().add({piece.data(), static_cast<std::size_t>(in.gcount())});
    if (in.bad() || !in.eof()) throw Error(ExitCode::unreadable, fmt::format("{}/{}: cannot be read", folder, f.name));
    file.page().end_block();
  }
  file.commit({{"kind", "tiles"},
               {"title", settings.title},
               {"up", up_word(settings.up, true)},
               {"embedded", true},
               {"files", stats.tiles}});
  return stats;
}

std::string find_viewer() {
  namespace fs = std::filesystem;
  std::error_code failed;
  const fs::path folder = fs::read_symlink("/proc/self/exe", failed).parent_path();
  for (const fs::path& share : {folder / "share", folder.parent_path() / "share"}) {
    const fs::path file = share / "lamina" / "viewer.js";
    if (fs::is_regular_file(file, failed)) return file.string();
  }
  throw Error(ExitCode::usage,
              fmt::format("the viewer's code, share/lamina/viewer.js, is not beside the program in {}; 'scripts/setup "
                          "viewer' in Lamina's sources makes it (npm), building installs it",
                          folder.string()));
}

}  // namespace lamina
