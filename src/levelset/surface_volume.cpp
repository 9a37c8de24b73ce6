#include "levelset/surface_volume.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/output_file.h"
#include "isosurface/iso_mesh.h"
#include "lamina/error.h"
#include "lamina/file_ending.h"
#include "lamina/frame.h"
#include "lamina/volume_export.h"
#include "lamina/volume_points.h"
#include "levelset/band.h"
#include "vdb/points_grid.h"
#include "vdb/streamed_vdb.h"
#include "vdb/vdb_file.h"

namespace lamina::volume {
namespace {

/// The projected corners next to the surface, as points: where the mesh's vertices are taken from. A points grid needs
/// all of its points at once: beyond VolumeExport::points_per_file a numbered sequence is begun.
class CornerPoints {
 public:
  CornerPoints(const VolumeExport& settings, const AttributeLayout& layout, const Frame& frame);
  void add(const IsoSlab& slab);
  void finish();
  /// The names the files appear under.
  std::vector<std::string> commit();
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

 private:
  void write_file();

  std::string path_;
  std::size_t per_file_;
  Frame frame_;
  std::optional<std::array<double, 3>> shift_;
  std::string crs_;
  PointArrays points_;
  std::vector<std::unique_ptr<ResultFile>> files_;
  std::uint64_t count_ = 0, bytes_ = 0;
};

CornerPoints::CornerPoints(const VolumeExport& settings, const AttributeLayout& layout, const Frame& frame)
    : path_(settings.points),
      per_file_(settings.points_per_file),
      frame_(frame),
      shift_(settings.shift),
      crs_(settings.crs) {
  points_.layout = layout;
  points_.samples.attributes.resize(layout.size());
  // An output that cannot be written is refused before the work.
  files_.push_back(std::make_unique<ResultFile>(path_));
}

void CornerPoints::add(const IsoSlab& slab) {
  const Eigen::Matrix3d back = frame_.rotation.transpose();
  SampleBatch& s = points_.samples;
  for (std::size_t i = 0; i < slab.corners.size(); ++i) {
    const SurfaceCorner& c = slab.corners[i];
    const Eigen::Vector3d normal(c.normal[0], c.normal[1], c.normal[2]);
    if (!(normal.squaredNorm() > 0.5)) continue;  // nothing was projected there
    const Eigen::Vector3d local(double{c.offset[0]} + c.position[0], double{c.offset[1]} + c.position[1],
                                double{c.offset[2]} + c.position[2]);
    const Eigen::Vector3d world = frame_.to_world(local), n = back * normal;
    s.x.push_back(world[0]);
    s.y.push_back(world[1]);
    s.z.push_back(world[2]);
    s.nx.push_back(static_cast<float>(n[0]));
    s.ny.push_back(static_cast<float>(n[1]));
    s.nz.push_back(static_cast<float>(n[2]));
    // Discs of this radius cover the surface: half the diagonal of a cell's side.
    constexpr float kHalfDiagonal = 0.70711F;
    s.radius.push_back(kHalfDiagonal * c.cell * static_cast<float>(frame_.step));
    for (std::size_t a = 0; a < s.attributes.size(); ++a) s.attributes[a].push_back(slab.corner_attributes[a][i]);
    ++count_;
    if (s.size() == per_file_) write_file();
  }
}

void CornerPoints::write_file() {
  const auto grid = point_grid(points_);
  label(*grid, "points", false);
  if (shift_) note_shift(*grid, *shift_);
  note_crs(*grid, crs_);
  const std::string bytes = vdb_bytes({grid});
  bytes_ += bytes.size();
  files_.back()->write(bytes);
  files_.push_back(std::make_unique<ResultFile>(numbered(path_, files_.size() + 1)));
  SampleBatch& s = points_.samples;
  for (auto* a : {&s.x, &s.y, &s.z}) a->clear();
  for (auto* a : {&s.nx, &s.ny, &s.nz, &s.radius}) a->clear();
  for (auto& a : s.attributes) a.clear();
}

void CornerPoints::finish() {
  if (points_.samples.size() > 0) write_file();
  files_.pop_back();  // begun for points that did not come
}

std::vector<std::string> CornerPoints::commit() {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < files_.size(); ++i) {
    names.push_back(files_.size() == 1 ? path_ : numbered(path_, i + 1));
    files_[i]->commit(names.back());
  }
  return names;
}

}  // namespace
}  // namespace lamina::volume

namespace lamina {
namespace {

using namespace volume;

[[noreturn]] void usage(const std::string& message) {
  throw Error(ExitCode::usage, message);
}

/// Own values reach one and a half voxels from the surface, those of finer cells less; each round of growth adds one,
/// and the first closes gaps.
int rounds_for(double band, bool has_finer) {
  const double own = has_finer ? 0.5 : 1.4;
  return std::clamp(static_cast<int>(std::ceil(band - own)), 1, kMaxRounds);
}

bool fits_half(double voxel, double band) {
  // 16-bit floats end at 65504 and have steps of 2^-24 near zero.
  return voxel * band < 65504 && voxel > 1000 * 0x1p-24;
}

void require_vdb(const char* option, const std::string& path) {
  if (path.empty() || file_ending(path) == ".vdb") return;
  usage(fmt::format("{} {}: the file's name must end in .vdb, by which other programs know it", option, path));
}

/// One level's band and the numbers of its grids in the file.
struct LevelGrid {
  std::string name;
  GridFrame frame;
  Band band;
  std::vector<std::size_t> numbers{};
};

}  // namespace

void check_volume_export(const VolumeExport& s) {
  if (!(s.band >= 1 && s.band <= 8)) usage("--vdb-band must be in 1..8 voxels");
  if (!(s.voxel >= 0 && std::isfinite(s.voxel))) usage("--vdb-voxelsize must be a positive length");
  if (s.path == "-" || s.points == "-") usage("--vdb and --vdb-points name files, not pipes");
  require_vdb("--vdb", s.path);
  require_vdb("--vdb-points", s.points);
  if (!s.path.empty() && s.path == s.points) usage("--vdb and --vdb-points name the same file");
  if (s.levels && s.split > 0) usage("--vdb-levels and --vdb-split exclude each other");
  if (s.points_per_file < 1) usage("--vdb-points: a file must hold one point at least");
}

int volume_level(const VolumeExport& settings, double step, const Lattice& lattice, int main_level) {
  if (!(settings.voxel > 0)) return main_level;
  const double finest = step * lattice.cell, coarsest = std::ldexp(finest, lattice.levels - 1);
  if (settings.voxel < 0.5 * finest || settings.voxel > 2 * coarsest) {
    usage(
        fmt::format("--vdb-voxelsize {:g}: the octree's cells are {:.3g} to {:.3g}; name a length between, or choose "
                    "them by --cell",
                    settings.voxel, finest, coarsest));
  }
  const long above_finest = std::lround(std::log2(settings.voxel / finest));
  return static_cast<int>(std::clamp(above_finest, 0L, static_cast<long>(lattice.levels) - 1));
}

struct SurfaceVolume::Impl {
  VolumeExport settings;
  Frame frame;
  std::string tmp_dir;
  std::vector<ExtraGrid> extras;
  std::vector<LevelGrid> levels;
  bool half = true;
  std::vector<std::unique_ptr<StreamedVdb>> files;  ///< of a sequence; the last is being filled
  std::unique_ptr<CornerPoints> points;
  std::vector<BrickLeaves> leaves;  ///< of the bricks at hand; their memory goes round
  VolumeExportStats stats;
  tbb::task_group tasks;  ///< grow the bands and pack leaves while the window goes on

  ~Impl();
  Impl(const VolumeExport& s, const Frame& f, const Lattice& lattice, int main_level, const AttributeLayout& layout,
       const std::string& tmp);
  void add_level(const Lattice& lattice, int level, const std::string& name, const std::vector<int>& channels);
  void begin_file();
  void emit(LevelGrid& level, bool end);
  void set_open(bool open);
};

SurfaceVolume::Impl::Impl(const VolumeExport& s, const Frame& f, const Lattice& lattice, int main_level,
                          const AttributeLayout& layout, const std::string& tmp)
    : settings(s), frame(f), tmp_dir(tmp), half(s.half) {
  openvdb::initialize();
  if (!s.points.empty()) points = std::make_unique<CornerPoints>(s, layout, f);
  if (s.path.empty()) return;
  std::vector<int> channels;
  extras = resolve_grids(s.grids, layout, f.step, channels);
  if (s.levels) {
    for (int level = 0; level < lattice.levels; ++level)
      add_level(lattice, level, fmt::format("surface_L{}", level), channels);
  } else {
    add_level(lattice, volume_level(s, f.step, lattice, main_level), "surface", channels);
  }
  begin_file();
}

SurfaceVolume::Impl::~Impl() {
  tasks.cancel();
  try {
    tasks.wait();
  } catch (...) {  // the caller has its own reason to leave
  }
}

void SurfaceVolume::Impl::add_level(const Lattice& lattice, int level, const std::string& name,
                                    const std::vector<int>& channels) {
  GridFrame grid(frame, lattice, level);
  half = half && fits_half(grid.voxel, settings.band);
  if (levels.empty()) stats.voxel = grid.voxel;
  const int rounds = settings.levels ? 1 : rounds_for(settings.band, level > 0);
  levels.push_back({name, std::move(grid), Band({level, !settings.levels, settings.band, rounds, channels}, lattice)});
}

void SurfaceVolume::Impl::begin_file() {
  files.push_back(std::make_unique<StreamedVdb>(numbered(settings.path, files.size() + 1), tmp_dir));
  for (LevelGrid& level : levels) {
    level.numbers.clear();
    const std::string suffix = level.name.substr(std::string("surface").size());
    const auto add = [&](const openvdb::GridBase::Ptr& grid, const std::string& name) {
      grid->setTransform(level.frame.transform->copy());
      label(*grid, name, half);
      if (settings.shift) note_shift(*grid, *settings.shift);
      note_crs(*grid, settings.crs);
      level.numbers.push_back(files.back()->add_grid(grid));
    };
    const auto distances = openvdb::FloatGrid::create(static_cast<float>(level.frame.voxel * settings.band));
    distances->setGridClass(openvdb::GRID_LEVEL_SET);
    distances->insertMeta("band_voxels", openvdb::FloatMetadata(static_cast<float>(settings.band)));
    add(distances, level.name);
    for (const ExtraGrid& extra : extras) {
      if (extra.kind == ExtraGrid::Kind::scalar || extra.kind == ExtraGrid::Kind::weight) {
        add(openvdb::FloatGrid::create(0), extra.name + suffix);
      } else {
        const auto vectors = openvdb::Vec3SGrid::create();
        vectors->setVectorType(extra.kind == ExtraGrid::Kind::normal ? openvdb::VEC_COVARIANT_NORMALIZE
                                                                     : openvdb::VEC_INVARIANT);
        add(vectors, extra.name + suffix);
      }
    }
  }
}

void SurfaceVolume::Impl::emit(LevelGrid& level, bool end) {
  std::vector<Brick*> bricks = level.band.pop(end);
  if (bricks.empty()) return;
  constexpr std::uint64_t kLeafBytes = 512 * sizeof(float) + 112;
  if (settings.split > 0 && files.back()->leaves() * kLeafBytes >= settings.split) {
    set_open(true);  // its band ends where the next file's begins
    files.back()->finish();
    begin_file();
  }
  const LeafMaker make(level.band, level.frame, extras, frame.rotation, half);
  if (leaves.size() < bricks.size()) leaves.resize(bricks.size());
  const std::span<BrickLeaves> made{leaves.data(), bricks.size()};
  tbb::parallel_for(std::size_t{0}, bricks.size(), [&](std::size_t i) { make(*bricks[i], made[i]); });
  level.band.give_back(bricks);
  for (const BrickLeaves& b : made)
    if (b.any) stats.voxels += b.leaves[0].active;
  for (std::size_t g = 0; g < level.numbers.size(); ++g)
    for (const BrickLeaves& b : made)
      if (b.any) files.back()->add(level.numbers[g], b.leaves[g]);
}

void SurfaceVolume::Impl::set_open(bool open) {
  for (const auto& file : files)
    for (const LevelGrid& level : levels)
      file->grid(level.numbers[0]).insertMeta(kOpenMetadata, openvdb::BoolMetadata(open));
}

SurfaceVolume::SurfaceVolume(const VolumeExport& settings, const Frame& frame, const Lattice& lattice, int main_level,
                             const AttributeLayout& layout, const std::string& tmp_dir)
    : impl_(std::make_unique<Impl>(settings, frame, lattice, main_level, layout, tmp_dir)) {}
SurfaceVolume::~SurfaceVolume() = default;

void SurfaceVolume::add(const Window& window, const IsoSlab& slab, std::int32_t number) {
  impl_->tasks.wait();
  for (LevelGrid& level : impl_->levels) level.band.collect(window, number);
  if (impl_->points != nullptr) impl_->points->add(slab);
  const auto emit = [impl = impl_.get()] {
    for (LevelGrid& level : impl->levels) impl->emit(level, false);
  };
  if (tbb::this_task_arena::max_concurrency() == 1) {
    emit();
  } else {
    impl_->tasks.run(emit);
  }
}

void SurfaceVolume::finish(bool open) {
  impl_->tasks.wait();
  for (LevelGrid& level : impl_->levels) {
    impl_->emit(level, true);
    level.band.free_spare();  // the tiles' signs want the room
  }
  impl_->leaves = std::vector<BrickLeaves>();
  VolumeExportStats& stats = impl_->stats;
  if (!impl_->files.empty()) {
    impl_->set_open(open || impl_->files.size() > 1);
    impl_->files.back()->finish();
  }
  for (const auto& file : impl_->files) stats.bytes += file->bytes();
  if (impl_->points != nullptr) {
    impl_->points->finish();
    stats.points = impl_->points->count();
    stats.bytes += impl_->points->bytes();
  }
}

void SurfaceVolume::commit() {
  std::vector<std::string>& names = impl_->stats.files;
  const auto& files = impl_->files;
  for (std::size_t i = 0; i < files.size(); ++i) {
    names.push_back(files.size() == 1 ? impl_->settings.path : numbered(impl_->settings.path, i + 1));
    files[i]->commit(names.back());
  }
  if (impl_->points == nullptr) return;
  for (const std::string& name : impl_->points->commit()) names.push_back(name);
}

const VolumeExportStats& SurfaceVolume::stats() const {
  return impl_->stats;
}

}  // namespace lamina
