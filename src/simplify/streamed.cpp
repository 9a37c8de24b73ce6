#include "simplify/streamed.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <system_error>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/descriptor.h"
#include "base/hashing.h"
#include "base/union_find.h"
#include "lamina/error.h"
#include "lamina/measure.h"
#include "measure/edge_table.h"
#include "meshes/mesh_blocks.h"
#include "meshes/stored_mesh.h"
#include "simplify/matching.h"
#include "simplify/regions.h"
#include "simplify/rounds.h"
#include "simplify/thinning.h"

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr std::size_t kPlaces = 1U << 18;  ///< of vertices by which regions are cut
constexpr double kRoomForErrors = 0.95;    ///< of a region, whose triangles are estimated from these places
constexpr double kRoundLeaves = 0.3;       ///< a round that goes by cost leaves no smaller share, or hardly
constexpr double kAboveWanted = 1.12;      ///< where it leaves more than are wanted; the last round takes the rest
constexpr double kLastShare = 0.8;         ///< of the triangles are wanted: the round is the last
constexpr double kHardlyFewer = 0.97;      ///< a round that leaves so many has found no more to do
constexpr int kBoundPasses = 2;            ///< with a bound: through all regions
constexpr std::uint32_t kSampleRegions = 16;
constexpr std::size_t kSamplePieces = 32;  ///< of all these, whose contractions tell what the whole mesh's will cost
constexpr std::size_t kAfterPieces = 2;    ///< of each region, behind a round: what the next round's will

double share_of_pass(int pass) {
  constexpr std::array<double, 3> kShares{0.5, 0.41, 0.59};
  return kShares[static_cast<std::size_t>(pass) % kShares.size()];
}

[[noreturn]] void refuse_non_manifold(const char* what) {
  throw Error(ExitCode::unreadable,
              fmt::format("simplify: the mesh is not manifold: {}; 'lamina check' tells more", what));
}

/// Locked vertices may have triangles elsewhere.
void require_manifold_part(const RegionMesh& part, const measure::EdgeTable& edges) {
  const auto& triangles = part.mesh.triangles;
  UnionFind fans(3 * triangles.size());  // of corners
  const auto corner_at = [&](std::uint32_t corner, std::uint32_t vertex) {
    const std::uint32_t first = corner / 3 * 3;
    const auto& t = triangles[corner / 3];
    return first + (t[0] == vertex ? 0 : t[1] == vertex ? 1 : 2);
  };
  edges.for_each_edge([&](std::span<const measure::Side> sides) {
    if (sides.size() > 2) refuse_non_manifold("an edge has more than two triangles");
    if (sides.size() != 2) return;
    const std::uint32_t a = sides[0].corner, b = sides[1].corner;
    const std::uint32_t from = triangles[a / 3][a % 3], to = triangles[a / 3][sides[0].next_corner() % 3];
    if (triangles[b / 3][b % 3] == from)
      refuse_non_manifold("two triangles face opposite sides, or one is there twice");
    for (const std::uint32_t v : {from, to}) fans.unite(corner_at(a, v), corner_at(b, v));
  });
  std::vector<std::uint32_t> fan(part.ids.size(), kNone);
  for (std::uint32_t corner = 0; corner < fans.size(); ++corner) {
    const std::uint32_t v = triangles[corner / 3][corner % 3], root = fans.find(corner);
    if (!part.locked.empty() && part.locked[v] != 0) continue;
    if (fan[v] != kNone && fan[v] != root) refuse_non_manifold("a vertex joins parts that share no edge");
    fan[v] = root;
  }
}

TriangleMesh read_whole(MeshBlocks& mesh) {
  TriangleMesh all, block;
  all.layout = mesh.layout();
  all.attributes.resize(all.layout.size());
  for (std::uint64_t first = 0; first < mesh.vertices(); first += kBlockRows) {
    mesh.read_vertices(first, std::min<std::uint64_t>(kBlockRows, mesh.vertices() - first), block);
    const auto add = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    add(all.positions, block.positions);
    if (mesh.has_normals()) add(all.normals, block.normals);
    for (std::size_t a = 0; a < all.attributes.size(); ++a) add(all.attributes[a], block.attributes[a]);
  }
  all.triangles.reserve(mesh.triangles());
  for_triangles(mesh, [&](const Triangle& t) {
    if (const std::uint32_t last = std::max({t[0], t[1], t[2]}); last >= mesh.vertices()) {
      throw Error(ExitCode::unreadable, fmt::format("simplify: triangle {} names vertex {}, the mesh has {}",
                                                    all.triangles.size(), last, mesh.vertices()));
    }
    all.triangles.push_back(t);
  });
  return all;
}

/// Places of vertices chosen by their numbers, which never mean anything.
class Places {
 public:
  explicit Places(std::uint64_t vertices) : each_(vertices / kPlaces + 1) {}
  void add(std::uint32_t id, const Vec3& at) {
    if (static_cast<std::uint64_t>(cell_hash(id, 0, 0)) % each_ == 0) places_.push_back(at);
  }
  /// Of regions for a mesh of so many triangles.
  BoxTree cut(std::uint64_t triangles, std::uint64_t region, double share) && {
    if (triangles <= region || places_.empty()) return {};
    const double each = static_cast<double>(triangles) / static_cast<double>(places_.size());
    const double most = kRoomForErrors * static_cast<double>(region) / each;
    return {std::move(places_), static_cast<std::size_t>(most), share};
  }

 private:
  std::uint64_t each_;
  std::vector<Vec3> places_;
};

/// What one pass through all regions does.
struct Pass {
  enum class Aim { count, cost, bound };
  Aim aim = Aim::count;
  std::uint64_t count = 0;  ///< triangles that stay, of all regions
  float cost = 0;           ///< of contractions, at most
  bool last = false;
};

class StreamedSimplifier {
 public:
  /// `region`: triangles that are held at once.
  StreamedSimplifier(MeshBlocks& mesh, const SimplifySettings& settings, std::uint64_t region, std::string tmp_dir,
                     const RunContext& run)
      : mesh_(mesh),
        bound_(settings.error),
        wanted_(wanted_triangles(settings, mesh.triangles())),
        region_(region),
        tmp_dir_(std::move(tmp_dir)),
        run_(run) {}

  SimplifyStats simplify(const std::function<void(TriangleMesh)>& take) {
    stats_.triangles_before = there_ = mesh_.triangles();
    std::unique_ptr<Regions> regions = regions_of_mesh(mesh_, cut_mesh(), tmp_dir_, run_);
    if (bound_ == 0 && regions->count() > 1) sample(*regions);
    for (int number = 0;; ++number) {
      const Pass pass = next_pass(number, regions->count());
      if (pass.last) {
        finish(*regions, pass, take);
        break;
      }
      regions = go_through(*regions, pass, share_of_pass(number + 1));
    }
    stats_.triangles_after = written_triangles_;
    stats_.vertices_after = written_vertices_;
    stats_.reached = bound_ > 0 || stats_.triangles_after <= wanted_;
    return stats_;
  }

 private:
  BoxTree cut_mesh() {
    Places places(mesh_.vertices());
    std::uint32_t id = 0;
    for_vertices(mesh_, [&](const TriangleMesh& block, std::size_t v) {
      for (const double c : block.positions[v]) {
        if (!std::isfinite(c))
          throw Error(ExitCode::unreadable, fmt::format("simplify: vertex {} of the mesh is not finite", id));
      }
      places.add(id++, block.positions[v]);
    });
    return std::move(places).cut(there_, region_, share_of_pass(0));
  }

  Pass next_pass(int number, std::uint32_t regions) {
    if (bound_ > 0) return {Pass::Aim::bound, 0, 0, regions == 1 || number + 1 == kBoundPasses};
    const double share = static_cast<double>(wanted_) / static_cast<double>(there_);
    if (regions == 1 || share > kLastShare || stuck_) return {Pass::Aim::count, wanted_, 0, true};
    const double leave = std::max(kAboveWanted * share, kRoundLeaves);
    const float cost = curve_.cost_for(leave);
    // Where very many cost the same, or nothing, costs do not tell how far to go.
    if (curve_.left_at(cost) < 0.5 * (1 + leave)) return {Pass::Aim::cost, 0, cost, false};
    return {Pass::Aim::count, static_cast<std::uint64_t>(leave * static_cast<double>(there_)), 0, false};
  }

  /// What contractions will cost, from a few pieces of a few regions.
  void sample(Regions& regions) {
    const std::uint32_t few = std::min(kSampleRegions, regions.count());
    for (std::uint32_t i = 0; i < few; ++i) {
      RegionMesh part =
          regions.load(static_cast<std::uint32_t>((2 * std::uint64_t{i} + 1) * regions.count() / (2 * few)));
      if (part.mesh.triangles.empty()) continue;
      WorkMesh work = begin_work_mesh(part.mesh);
      work.locked = part.locked;
      add_planes(work);
      // Of a mesh of few regions a sixteenth is enough.
      sample_pieces(work, std::max<std::size_t>(std::min(kSamplePieces / few, pieces_of(work) / 16), 1));
    }
  }

  void sample_pieces(WorkMesh& work, std::size_t pieces) {
    if (!work.mesh.triangles.empty())
      curve_.add(sample_costs(work, std::max<std::size_t>(pieces_of(work) / pieces, 1)));
  }

  WorkMesh begin(RegionMesh& part) const {
    const measure::EdgeTable edges(part.mesh);
    require_manifold_part(part, edges);
    WorkMesh work = begin_work_mesh(part.mesh);
    work.bound = bound_;
    work.locked = part.locked;
    if (part.quadrics.empty()) {
      add_planes(work);
      add_walls(work, edges);
    } else {
      for (std::size_t v = 0; v < part.ids.size(); ++v)
        work.quadrics[v] = part.quadrics[v].moved(part.mesh.positions[v] - work.centre);
    }
    work.errors = std::move(part.errors);
    work.tried = std::move(part.tried);
    return work;
  }

  void contract(WorkMesh& work, const Pass& pass, std::uint64_t share) {
    switch (pass.aim) {
      case Pass::Aim::count:
        stats_.contractions += contract_to(work, share, run_);
        break;
      case Pass::Aim::cost:
        stats_.contractions += contract_below(work, pass.cost, run_);
        break;
      case Pass::Aim::bound:
        stats_.contractions += contract_within(work, run_);
        break;
    }
    stats_.deviation = std::max(stats_.deviation, work.deviation);
  }

  /// What is left of a region's vertices.
  static void clear_up(RegionMesh& part, WorkMesh& work) {
    const Vec3 centre = work.centre;
    const std::vector<std::uint32_t> numbers = drop_unused(part.mesh);
    part.quadrics.resize(numbers.size());
    for (std::size_t v = 0; v < numbers.size(); ++v) {
      const std::uint32_t n = numbers[v];
      if (n == kNone) continue;
      part.ids[n] = part.ids[v];
      part.locked[n] = part.locked[v];
      if (!work.tried.empty()) work.tried[n] = work.tried[v];
      part.quadrics[n] = work.quadrics[v].moved(centre - part.mesh.positions[n]);
    }
    part.ids.resize(part.mesh.positions.size());
    part.locked.resize(part.ids.size());
    part.quadrics.resize(part.ids.size());
    part.errors = std::move(work.errors);
    part.tried = std::move(work.tried);
    part.tried.resize(part.errors.empty() ? 0 : part.ids.size());
  }

  /// Calls use(region) for those with triangles, simplified.
  template <class Use>
  void for_regions(Regions& regions, const Pass& pass, const Use& use) {
    const std::uint64_t all = there_;
    std::uint64_t seen = 0;
    there_ = 0;
    for (std::uint32_t r = 0; r < regions.count(); ++r) {
      if (run_.cancelled()) throw Error(ExitCode::internal, "cancelled");
      RegionMesh part = regions.load(r);
      if (part.mesh.triangles.empty()) continue;
      seen += part.mesh.triangles.size();
      WorkMesh work = begin(part);
      // A region's share of what is wanted, and what the ones before could not do.
      const auto until_here = static_cast<std::uint64_t>(static_cast<double>(pass.count) *
                                                         (static_cast<double>(seen) / static_cast<double>(all)));
      contract(work, pass, std::max<std::uint64_t>(until_here > there_ ? until_here - there_ : 0, 1));
      there_ += part.mesh.triangles.size();
      if (bound_ == 0 && !pass.last) sample_pieces(work, kAfterPieces);
      clear_up(part, work);
      use(part);
      if (run_.progress) run_.progress({"simplify", 0, 0, r + std::int64_t{1}, regions.count()});
    }
  }

  std::unique_ptr<Regions> go_through(Regions& regions, const Pass& pass, double next_share) {
    TriangleMesh layout;
    layout.layout = mesh_.layout();
    if (mesh_.has_normals()) layout.normals.emplace_back();
    RegionFile file(tmp_dir_, layout, bound_ > 0);
    std::vector<RegionFile::Place> parts;
    Places places(there_ / 2);
    const std::uint64_t before = there_;
    curve_ = {};
    for_regions(regions, pass, [&](const RegionMesh& part) {
      parts.push_back(file.append(part));
      for (std::size_t v = 0; v < part.ids.size(); ++v) places.add(part.ids[v], part.mesh.positions[v]);
    });
    file.flush();
    stuck_ = static_cast<double>(there_) > kHardlyFewer * static_cast<double>(before);
    return regions_of_parts(file, parts, std::move(places).cut(there_, region_, next_share),
                            std::make_unique<RegionFile>(tmp_dir_, layout, bound_ > 0), run_);
  }

  void finish(Regions& regions, const Pass& pass, const std::function<void(TriangleMesh)>& take) {
    std::unordered_map<std::uint32_t, std::uint32_t> written;  // vertices that other regions may have, by their ids
    for_regions(regions, pass, [&](RegionMesh& part) {
      std::vector<std::uint32_t> number(part.ids.size());
      std::vector<std::uint8_t> stays(part.ids.size(), 1);
      TriangleMesh& mesh = part.mesh;
      for (std::size_t v = 0; v < number.size(); ++v) {
        number[v] = written_vertices_;
        if (part.locked[v] != 0) {
          const auto [place, is_new] = written.emplace(part.ids[v], written_vertices_);
          number[v] = place->second;
          stays[v] = is_new ? 1 : 0;
        }
        written_vertices_ += stays[v];
      }
      keep_vertices(mesh, stays);
      for (auto& t : mesh.triangles) {
        for (std::uint32_t& v : t) v = number[v];
      }
      written_triangles_ += mesh.triangles.size();
      take(std::move(mesh));
    });
  }

  MeshBlocks& mesh_;
  double bound_;
  std::uint64_t wanted_, region_;
  std::string tmp_dir_;
  const RunContext& run_;
  SimplifyStats stats_;
  CostCurve curve_;
  std::uint64_t there_ = 0;  ///< triangles
  bool stuck_ = false;
  std::uint32_t written_vertices_ = 0;
  std::uint64_t written_triangles_ = 0;
};

}  // namespace

std::uint64_t memory_for(const SimplifySettings& settings, std::uint64_t triangles) {
  constexpr std::uint64_t kBuffers = 200U << 20, kThinBytes = 250, kThinBlocks = 4;
  if (settings.deviation > 0)
    return kThinBytes * std::min<std::uint64_t>(triangles, kThinBlocks * thin_block_of(triangles));
  const std::uint64_t each = settings.error > 0 ? 650 : 450;
  return each * std::min(triangles, kRegionTriangles) + (triangles > kRegionTriangles ? kBuffers : 0);
}

SimplifyStats simplify_blocks(MeshBlocks& mesh, const SimplifySettings& settings, const std::string& tmp_dir,
                              const std::function<void(TriangleMesh)>& take, const RunContext& run,
                              std::uint64_t region) {
  require_goal(settings);
  if (settings.deviation > 0) return thin_blocks(mesh, settings.deviation, take, run);
  if (mesh.triangles() > region) return StreamedSimplifier(mesh, settings, region, tmp_dir, run).simplify(take);
  TriangleMesh whole = read_whole(mesh);
  const SimplifyStats stats = simplify_mesh(whole, settings, run);
  take(std::move(whole));
  return stats;
}

std::string unsimplified_path(const MeshSinkSettings& layout) {
  const std::string& output = staging_path(layout);
  std::error_code ignored;
  const auto kind = std::filesystem::status(output, ignored).type();
  const bool beside = output != "-" && !output.empty() &&
                      (kind == std::filesystem::file_type::regular || kind == std::filesystem::file_type::not_found);
  const std::filesystem::path folder = !layout.tmp_dir.empty() ? std::filesystem::path(layout.tmp_dir)
                                       : beside                ? std::filesystem::path(output).parent_path()
                                                               : std::filesystem::path(system_tmp_dir());
  return (folder / "unsimplified.ply").string();
}

SimplifyStats write_simplified(MeshBlocks& mesh, const SimplifySettings& settings, const MeshSinkSettings& layout,
                               const RunContext& run) {
  MeshSink sink(layout);
  const SimplifyStats stats = simplify_blocks(
      mesh, settings, sink.tmp_dir(), [&](const TriangleMesh& piece) { append_mesh(piece, sink); }, run);
  sink.commit(run);
  return stats;
}

}  // namespace lamina::simplify
