#include "reconstruct/mesh_output.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include "base/number.h"
#include "base/vectors.h"
#include "lamina/error.h"
#include "lamina/mesh_receiver.h"
#include "meshes/mesh_sink.h"
#include "mls/sheets.h"
#include "reconstruct/plan.h"
#include "reconstruct/stages.h"

namespace lamina {

static_assert(kFlipSlabs == kFlipReach && kSettleSlabs == kSettleReach);

namespace {

struct Corner {
  const SurfaceCorner* corner;
  const std::vector<std::vector<float>>* attributes;
  std::size_t index;
};

using Vec3 = Eigen::Vector3d;

Vec3 position(const SurfaceCorner& c) {
  return Eigen::Vector3i(c.position[0], c.position[1], c.position[2]).cast<double>();
}
Vec3 to_vec(const std::array<float, 3>& v) {
  return {double{v[0]}, double{v[1]}, double{v[2]}};
}

Vec3 clustered(const SurfaceCorner& c, float chord) {
  const float shift = std::clamp(chord * c.curvature * c.cell * c.cell, -0.25F * c.cell, 0.25F * c.cell);
  return position(c) + to_vec(c.offset) + static_cast<double>(shift) * to_vec(c.normal);
}

void place_points(const ClusteredSlab& from, const Frame& frame, float chord, VertexBatch& out) {
  const FinalSlab& slab = from.slab;
  const IsoSlab& here = from.here;
  const IsoSlab* const next = from.next;
  const std::size_t n = slab.vertices.size();
  const std::size_t attributes = here.corner_attributes.size();
  for (auto* v : {&out.x, &out.y, &out.z}) resize_anew(*v, n);
  for (auto* v : {&out.nx, &out.ny, &out.nz}) resize_anew(*v, n);
  out.attributes.resize(attributes);
  for (auto& a : out.attributes) resize_anew(a, n);
  const auto look_up = [&](SlabIndex i) {
    const IsoSlab& s = i.next() ? *next : here;
    return Corner{&s.corners[i.index()], &s.corner_attributes, i.index()};
  };
  const Eigen::Matrix3d back = frame.rotation.transpose();
  tbb::parallel_for(std::size_t{0}, (n + 4095) / 4096, [&](std::size_t piece) {
    for (std::size_t i = piece * 4096; i < std::min(n, (piece + 1) * 4096); ++i) {
      const FinalVertex& v = slab.vertices[i];
      const Corner a = look_up(v.corner);
      Vec3 p;
      Vec3 normal = to_vec(a.corner->normal);
      if (v.kind == FinalVertex::Kind::isovertex) {
        const Corner b = look_up(v.other);
        const double t = v.t;
        p = (1 - t) * position(*a.corner) + t * position(*b.corner);
        // Where a corner is not trusted its point keeps to the samples, which the edge may not.
        if (!a.corner->trusted || !b.corner->trusted)
          p = (1 - t) * clustered(*a.corner, chord) + t * clustered(*b.corner, chord);
        const Vec3 blended = (1 - t) * normal + t * to_vec(b.corner->normal);
        if (blended.squaredNorm() > 1e-12) normal = blended.normalized();
        for (std::size_t c = 0; c < attributes; ++c) {
          out.attributes[c][i] = (1 - v.t) * (*a.attributes)[c][a.index] + v.t * (*b.attributes)[c][b.index];
        }
      } else {
        p = v.kind == FinalVertex::Kind::corner ? clustered(*a.corner, chord)
                                                : Vec3(position(*a.corner) + to_vec(slab.patches[v.other.index()]));
        for (std::size_t c = 0; c < attributes; ++c) out.attributes[c][i] = (*a.attributes)[c][a.index];
      }
      const Vec3 world = frame.to_world(p);
      const Vec3 turned = back * normal;
      out.x[i] = world.x();
      out.y[i] = world.y();
      out.z[i] = world.z();
      out.nx[i] = static_cast<float>(turned.x());
      out.ny[i] = static_cast<float>(turned.y());
      out.nz[i] = static_cast<float>(turned.z());
    }
  });
}

void place_levels(const ClusteredSlab& from, double finest, VertexBatch& out) {
  std::vector<float>& levels = out.attributes.emplace_back();
  levels.reserve(from.slab.vertices.size());
  for (const FinalVertex& v : from.slab.vertices) {
    const IsoSlab& s = v.corner.next() ? *from.next : from.here;
    levels.push_back(static_cast<float>(std::lround(std::log2(s.corners[v.corner.index()].cell / finest))));
  }
}

void place_curvatures(const ClusteredSlab& from, double step, VertexBatch& out) {
  std::vector<float>& curvatures = out.attributes.emplace_back();
  curvatures.reserve(from.slab.vertices.size());
  const auto of = [&](SlabIndex i) { return (i.next() ? *from.next : from.here).corners[i.index()].curvature; };
  for (const FinalVertex& v : from.slab.vertices) {
    float curvature = of(v.corner);
    if (v.kind == FinalVertex::Kind::isovertex) curvature = (1 - v.t) * curvature + v.t * of(v.other);
    curvatures.push_back(static_cast<float>(static_cast<double>(curvature) / step));
  }
}

void place_overhangs(const ClusteredSlab& from, VertexBatch& out) {
  out.overhang.clear();
  out.overhang.reserve(from.slab.vertices.size());
  const auto of = [&](SlabIndex i) { return (i.next() ? *from.next : from.here).rare[i.index()].overhang; };
  for (const FinalVertex& v : from.slab.vertices) {
    float overhang = of(v.corner);
    if (v.kind == FinalVertex::Kind::isovertex) overhang = (1 - v.t) * overhang + v.t * of(v.other);
    out.overhang.push_back(overhang);
  }
}

void place_densities(const ClusteredSlab& from, double step, VertexBatch& out) {
  out.density.clear();
  out.density.reserve(from.slab.vertices.size());
  const auto of = [&](SlabIndex i) { return (i.next() ? *from.next : from.here).rare[i.index()].density; };
  for (const FinalVertex& v : from.slab.vertices) {
    float density = of(v.corner);
    if (v.kind == FinalVertex::Kind::isovertex) density = std::max(density, of(v.other));
    out.density.push_back(static_cast<float>(static_cast<double>(density) / (step * step)));
  }
}

void place_radii(const ClusteredSlab& from, const RadiusRule& rule, VertexBatch& out) {
  out.radius.clear();
  out.radius.reserve(from.slab.vertices.size());
  for (const FinalVertex& v : from.slab.vertices) {
    const IsoSlab& s = v.corner.next() ? *from.next : from.here;
    const double by_cell = rule.per_cell * static_cast<double>(s.corners[v.corner.index()].cell);
    out.radius.push_back(static_cast<float>(std::max(rule.least, by_cell)));
  }
}

}  // namespace

void place_vertices(const ClusteredSlab& slab, const ReconstructionPlan& plan, VertexBatch& out) {
  place_points(slab, plan.frame, plan.chord, out);
  if (plan.vertex_levels) place_levels(slab, plan.lattice.cell_size(0), out);
  if (plan.vertex_curvature) place_curvatures(slab, plan.frame.step, out);
  if (plan.holes.mark) out.attributes.emplace_back(out.size(), 0.0F);
  if (plan.holes.all) out.attributes.emplace_back(out.size(), 0.0F);
  if (plan.pruning.samples > 0) place_densities(slab, plan.frame.step, out);
  if (plan.trim > 0) place_overhangs(slab, out);
  place_radii(slab, plan.vertex_radii, out);
}

MeshOutput::MeshOutput(const ReconstructionPlan& plan, SlabSink& sink)
    : plan_(plan), sink_(sink), clusterer_(ClusterSettings{plan.cluster}), distinct_(plan.double_positions) {
  const auto level = static_cast<float>(plan.trim);
  if (plan.projection.creases) flips_.emplace(kLeastBend);
  if (plan.settle_normals) settler_.emplace();
  if (level > 0) rims_.emplace(Rims{RimSmoother(level), RimTrimmer(level), {}});
}

MeshOutput::~MeshOutput() {
  tasks_.cancel();
  try {
    tasks_.wait();
  } catch (...) {  // the caller has its own reason to leave
  }
}

void MeshOutput::push(std::shared_ptr<IsoSlab> slab) {
  queued_.push_back(std::move(slab));
}

void MeshOutput::start() {
  tasks_.wait();
  if (queued_.empty()) return;
  if (tbb::this_task_arena::max_concurrency() == 1) {
    work(std::exchange(queued_, {}), false);
    return;
  }
  tasks_.run([this, slabs = std::exchange(queued_, {})] { work(slabs, false); });
}

void MeshOutput::wait() {
  tasks_.wait();
  work(std::exchange(queued_, {}), false);
}

void MeshOutput::finish() {
  tasks_.wait();
  work(std::exchange(queued_, {}), true);
}

std::shared_ptr<IsoSlab> MeshOutput::spare() {
  const std::lock_guard lock(mutex_);
  if (spares_.empty()) return std::make_shared<IsoSlab>();
  std::shared_ptr<IsoSlab> slab = std::move(spares_.back());
  spares_.pop_back();
  return slab;
}

std::vector<IsoTriangle> MeshOutput::spare_triangles() {
  const std::lock_guard lock(mutex_);
  if (triangle_spares_.empty()) return {};
  std::vector<IsoTriangle> triangles = std::move(triangle_spares_.back());
  triangle_spares_.pop_back();
  return triangles;
}

void MeshOutput::work(std::vector<std::shared_ptr<IsoSlab>> slabs, bool last) {
  for (std::shared_ptr<IsoSlab>& slab : slabs) {
    clusterer_.push(slab);
    clustered_.push_back(std::move(slab));
  }
  if (last) clusterer_.finish();
  while (clusterer_.pop(done_)) {
    const IsoSlab* next = clustered_.size() > 1 ? clustered_[1].get() : nullptr;
    mesh_.slab = done_.slab;
    place_vertices({done_, *clustered_.front(), next}, plan_, mesh_.vertices);
    std::swap(mesh_.triangles, done_.triangles);
    if (flips_) {
      flips_->push(std::exchange(mesh_, {}));
    } else {
      hand_to_rims(mesh_);
    }
    std::swap(mesh_.triangles, done_.triangles);  // their storage goes back where it came from
    if (clustered_.front().use_count() == 1) {
      const std::lock_guard lock(mutex_);
      triangle_spares_.push_back(std::move(clustered_.front()->triangles));
      spares_.push_back(std::move(clustered_.front()));
    }
    clustered_.pop_front();
  }
  if (flips_) {
    if (last) flips_->finish();
    while (flips_->pop(mesh_)) hand_to_rims(mesh_);
  }
  if (rims_) trim(last);
  if (settler_ && last) {
    settler_->finish();
    while (settler_->pop(mesh_)) pass_on(mesh_);
  }
}

/// Which pass it on where there are none.
void MeshOutput::hand_to_rims(MeshSlab& slab) {
  if (rims_) {
    rims_->smoother.push(std::exchange(slab, rims_->trimmer.spare()));
  } else {
    settle(slab);
  }
}

void MeshOutput::trim(bool last) {
  if (last) rims_->smoother.finish();
  MeshSlab smoothed;
  while (rims_->smoother.pop(smoothed)) rims_->trimmer.push(std::move(smoothed));
  if (last) rims_->trimmer.finish();
  while (rims_->trimmer.pop(trimmed_)) rims_->fairer.push(std::exchange(trimmed_, std::exchange(faired_, {})));
  if (last) rims_->fairer.finish();
  while (rims_->fairer.pop(faired_)) settle(faired_);
}

/// Passes a slab on, with settled normals later.
void MeshOutput::settle(MeshSlab& slab) {
  if (!settler_) {
    pass_on(slab);
    return;
  }
  settler_->push(std::exchange(slab, {}));
  while (settler_->pop(slab)) pass_on(slab);
}

void MeshOutput::pass_on(MeshSlab& slab) {
  distinct_.separate(slab.vertices);
  sink_.write(slab);
  written_ += slab.vertices.size();
  triangles_ += slab.triangles.size();
}

void ClosingSlabs::write(const MeshSlab& slab) {
  boundary_.clear();
  finder_.add(slab.vertices, slab.triangles, boundary_);
  closer_.add(boundary_);
  vertices_ += slab.vertices.size();
  to_.write(slab);
}

boundary::Addition ClosingSlabs::finish() {
  boundary_.clear();
  finder_.finish(/*more=*/false, boundary_);
  closer_.add(boundary_);
  return closer_.finish(vertices_);
}

HoleStats close_holes(ClosingSlabs& slabs, SlabSink& mesh) {
  boundary::Addition addition = slabs.finish();
  mesh.write({0, std::move(addition.vertices), std::move(addition.triangles)});
  return slabs.stats();
}

namespace {

class MeshInFiles final : public WholeMesh {
 public:
  explicit MeshInFiles(const MeshSinkSettings& settings) : sink_(settings) {}
  void write(const MeshSlab& slab) override {
    sink_.append_vertices(slab.vertices);
    sink_.append_triangles(slab.triangles);
  }
  MeshSink* files() override { return &sink_; }
  void commit(const RunContext& run) override { sink_.commit(run); }
  [[nodiscard]] std::uint64_t vertices() const override { return sink_.vertices(); }
  [[nodiscard]] std::uint64_t triangles() const override { return sink_.triangles(); }

 private:
  MeshSink sink_;
};

/// What a file of the type gives back.
std::vector<float> as_stored(ScalarType type, const std::vector<float>& values) {
  if (type == ScalarType::float32 || type == ScalarType::float64) return values;
  std::vector<float> stored(values.size());
  with_scalar_type(type, [&](auto zero) {
    for (std::size_t i = 0; i < values.size(); ++i)
      stored[i] = static_cast<float>(to_scalar<decltype(zero)>(values[i]));
  });
  return stored;
}

class HandedMesh final : public WholeMesh {
 public:
  HandedMesh(const MeshSinkSettings& settings, MeshReceiver& receiver)
      : attributes_(settings.attributes), wide_(settings.double_positions), receiver_(receiver) {
    receiver_.begin({attributes_, wide_, settings.comments});
  }

  void write(const MeshSlab& slab) override {
    const VertexBatch& from = slab.vertices;
    require_writable(from, attributes_, wide_, vertices_);
    if (from.size() > std::numeric_limits<std::uint32_t>::max() - vertices_)
      throw Error(ExitCode::budget, "the mesh has more vertices than 32-bit indices can name; cut the cloud");
    if (from.size() == 0 && slab.triangles.empty()) return;
    TriangleMesh piece;
    const auto stored = [this](double c) { return wide_ ? c : static_cast<double>(static_cast<float>(c)); };
    piece.positions.reserve(from.size());
    piece.normals.reserve(from.size());
    for (std::size_t v = 0; v < from.size(); ++v) {
      piece.positions.push_back({stored(from.x[v]), stored(from.y[v]), stored(from.z[v])});
      piece.normals.push_back({from.nx[v], from.ny[v], from.nz[v]});
    }
    piece.layout = attributes_;
    for (std::size_t a = 0; a < attributes_.size(); ++a)
      piece.attributes.push_back(as_stored(attributes_[a].type, from.attributes[a]));
    piece.triangles = slab.triangles;
    vertices_ += from.size();
    triangles_ += slab.triangles.size();
    receiver_.take(std::move(piece));
  }
  void commit(const RunContext&) override {}
  [[nodiscard]] std::uint64_t vertices() const override { return vertices_; }
  [[nodiscard]] std::uint64_t triangles() const override { return triangles_; }

 private:
  AttributeLayout attributes_;
  bool wide_;
  MeshReceiver& receiver_;
  std::uint64_t vertices_ = 0, triangles_ = 0;
};

}  // namespace

std::unique_ptr<WholeMesh> open_whole_mesh(const MeshSinkSettings& settings, MeshReceiver* receiver) {
  if (receiver != nullptr) return std::make_unique<HandedMesh>(settings, *receiver);
  return std::make_unique<MeshInFiles>(settings);
}

}  // namespace lamina
