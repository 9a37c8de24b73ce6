#include "reconstruct/mesh_output.h"

#include <tbb/task_arena.h>
#include <utility>

#include "reconstruct/final_vertices.h"

namespace lamina {

MeshOutput::MeshOutput(ClusterMode mode, const VertexSettings& vertices, const Frame& frame, SlabSink& sink)
    : settings_(vertices),
      frame_(frame),
      sink_(sink),
      clusterer_(ClusterSettings{mode}),
      distinct_(vertices.double_positions) {
  const auto level = static_cast<float>(vertices.trim);
  if (level > 0) rims_ = Rims{RimSmoother(level), RimTrimmer(level)};
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

void MeshOutput::work(std::vector<std::shared_ptr<IsoSlab>> slabs, bool last) {
  for (std::shared_ptr<IsoSlab>& slab : slabs) {
    clusterer_.push(slab);
    clustered_.push_back(std::move(slab));
  }
  if (last) clusterer_.finish();
  while (clusterer_.pop(done_)) {
    const IsoSlab* next = clustered_.size() > 1 ? clustered_[1].get() : nullptr;
    mesh_.slab = done_.slab;
    place_vertices({done_, *clustered_.front(), next}, frame_, settings_, mesh_.vertices);
    std::swap(mesh_.triangles, done_.triangles);
    if (rims_) {
      rims_->smoother.push(std::exchange(mesh_, rims_->trimmer.spare()));
    } else {
      pass_on(mesh_);
    }
    if (clustered_.front().use_count() == 1) {
      const std::lock_guard lock(mutex_);
      spares_.push_back(std::move(clustered_.front()));
    }
    clustered_.pop_front();
  }
  if (rims_) trim(last);
}

void MeshOutput::trim(bool last) {
  if (last) rims_->smoother.finish();
  MeshSlab smoothed;
  while (rims_->smoother.pop(smoothed)) rims_->trimmer.push(std::move(smoothed));
  if (last) rims_->trimmer.finish();
  while (rims_->trimmer.pop(trimmed_)) pass_on(trimmed_);
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

}  // namespace lamina
