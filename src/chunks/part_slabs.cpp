#include "chunks/part_slabs.h"

#include <fmt/format.h>

#include <limits>
#include <utility>

#include "lamina/error.h"

namespace lamina {

void make_relative(const std::vector<std::array<std::uint32_t, 3>>& triangles, std::uint64_t first, std::uint64_t below,
                   std::vector<PartTriangle>& out) {
  out.resize(triangles.size());
  // Clusterers count in 32 bits, whatever number the part begins with.
  const auto origin = static_cast<std::int64_t>(first);
  std::int64_t least = 0, most = 0;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int64_t number = static_cast<std::int64_t>(triangles[t][k]) - origin;
      least = std::min(least, number);
      most = std::max(most, number);
      out[t][k] = static_cast<std::int32_t>(number);
    }
  }
  if (most > std::numeric_limits<std::int32_t>::max()) {
    throw Error(ExitCode::budget, fmt::format("a part of the mesh has more than {} vertices; cut it into more chunks",
                                              std::numeric_limits<std::int32_t>::max()));
  }
  if (least < -static_cast<std::int64_t>(below)) {
    throw Error(ExitCode::internal,
                "chunk: a triangle reaches back farther than the slab below; this is a defect of "
                "the program, please report it with the command line");
  }
}

PartSlabs::PartSlabs(std::vector<Part> parts, int count, std::uint64_t job, const HoleSettings& holes, double deviation,
                     MeshSinkSettings layout)
    : parts_(std::move(parts)),
      count_(count),
      job_(job),
      holes_(holes),
      deviation_(deviation),
      layout_(std::move(layout)) {}

void PartSlabs::open() {
  writer_.emplace(parts_[at_].path, layout_);
  info_ = {};
  info_.job = job_;
  info_.number = parts_[at_].number;
  info_.count = count_;
  info_.span = parts_[at_].span;
  info_.holes = holes_;
  info_.deviation = deviation_;
  info_.below = previous_;
  first_ = numbered_;
  finder_ = boundary::BoundaryFinder(first_, below_);
}

void PartSlabs::close() {
  if (!writer_) open();  // no slab of it had surface
  boundary_.clear();
  finder_.finish(/*more=*/true, boundary_);
  writer_->add(boundary_);
  writer_->commit(info_);
  vertices_ += writer_->vertices();
  triangles_ += writer_->triangles();
  writer_.reset();
  ++at_;
}

void PartSlabs::finish_below(std::int64_t slab) {
  while (at_ < parts_.size() && parts_[at_].span.end <= slab) close();
}

void PartSlabs::write(const MeshSlab& slab) {
  finish_below(slab.slab);
  if (at_ == parts_.size()) return;
  if (slab.slab >= parts_[at_].span.begin) {
    if (!writer_) open();
    make_relative(slab.triangles, first_, info_.below.vertices, relative_);
    writer_->add(slab.vertices, relative_);
    previous_ = writer_->last();
    boundary_.clear();
    finder_.add(slab.vertices, slab.triangles, boundary_);
    writer_->add(boundary_);
  } else {
    previous_ = mark_of(slab.vertices, layout_);
  }
  below_ = slab.vertices;
  numbered_ += slab.vertices.size();
}

void PartSlabs::finish() {
  finish_below(std::numeric_limits<std::int64_t>::max());
}

}  // namespace lamina
