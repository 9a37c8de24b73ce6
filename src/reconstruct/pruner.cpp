#include "reconstruct/pruner.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <utility>

#include "lamina/error.h"
#include "meshes/vec3.h"

namespace lamina {
namespace {

constexpr std::uint32_t kGone = std::numeric_limits<std::uint32_t>::max();

/// Calls visit(data, bytes) for every array of a slab of n vertices.
template <class Vertices, class Triangles, class Visit>
void for_arrays(Vertices& v, Triangles& t, const Visit& visit) {
  const auto all = [&](auto& values) { visit(values.data(), values.size() * sizeof(*values.data())); };
  all(v.x), all(v.y), all(v.z);
  all(v.nx), all(v.ny), all(v.nz);
  for (auto& values : v.attributes) all(values);
  all(v.radius), all(v.fitted);
  all(t);
}

void resize(VertexBatch& v, std::size_t n) {
  for (auto* values : {&v.x, &v.y, &v.z}) values->resize(n);
  for (auto* values : {&v.nx, &v.ny, &v.nz}) values->resize(n);
  for (auto& values : v.attributes) values.resize(n);
  if (!v.radius.empty()) v.radius.resize(n);
  if (!v.fitted.empty()) v.fitted.resize(n);
}

}  // namespace

Pruner::Pruner(const PruneRule& rule, std::string tmp_dir, SlabSink& sink, std::uint64_t memory_bytes)
    : rule_(rule), tmp_dir_(std::move(tmp_dir)), sink_(sink), memory_(memory_bytes) {}

std::uint64_t Pruner::root(std::uint64_t id) {
  while (part(id).parent != id) {
    part(id).parent = part(part(id).parent).parent;
    id = part(id).parent;
  }
  return id;
}

void Pruner::join(std::uint64_t a, std::uint64_t b) {
  a = root(a);
  b = root(b);
  if (a == b) return;
  // The youngest stays: older ones are forgotten once their slabs have been passed on.
  if (a > b) std::swap(a, b);
  const Part& old = part(a);
  Part& stays = part(b);
  part(a).parent = b;
  stays.triangles += old.triangles;
  stays.samples += old.samples;
  for (std::size_t k = 0; k < 3; ++k) {
    stays.low[k] = std::min(stays.low[k], old.low[k]);
    stays.high[k] = std::max(stays.high[k], old.high[k]);
  }
  if (old.fate == Fate::stays) stays.fate = Fate::stays;
}

/// Every vertex begins as a part of its own among the slab's; these are then counted through.
void Pruner::find_parts(Slab& slab) {
  const auto n = static_cast<std::uint32_t>(slab.vertices.size());
  // Parts of the slab's own triangles first, then what the slab before joins.
  std::vector<std::uint32_t> parent(n);
  std::iota(parent.begin(), parent.end(), 0U);
  const auto find = [&](std::uint32_t i) {
    i = parent[parent[i]];  // nearly always there
    while (parent[i] != i) i = parent[i];
    return i;
  };
  for (const auto& t : slab.triangles) {
    const auto [least, most] = std::minmax({t[0], t[1], t[2]});
    if (least < live_first_ || most >= vertices_)
      throw Error(ExitCode::internal, "a triangle names a vertex of none of the last two slabs");
    if (most < slab.first) continue;
    // One of the slab before counts as one of the slab's own here. All of them are led to one root, whether or not they
    // were before: chance decides.
    std::array<std::uint32_t, 3> own{}, root{};
    for (std::size_t k = 0; k < 3; ++k) {
      own[k] = static_cast<std::uint32_t>((t[k] < slab.first ? most : t[k]) - slab.first);
      root[k] = find(own[k]);
    }
    const std::uint32_t first = std::min({root[0], root[1], root[2]});
    for (std::size_t k = 0; k < 3; ++k) parent[root[k]] = parent[own[k]] = first;
  }
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  slab.first_part = first_id_ + parts_.size();
  slab.part.assign(n, 0);
  Part* part_here = nullptr;
  std::uint32_t root_here = kGone;
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t r = find(i);
    if (r == i) {
      const std::uint64_t id = first_id_ + parts_.size();
      slab.part[i] = static_cast<std::uint32_t>(id - slab.first_part);
      parts_.push_back({id, 0, 0, {kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}});
    } else {
      slab.part[i] = slab.part[r];  // the least vertex of a part is its root
    }
    if (r != root_here) {
      root_here = r;
      part_here = &part(slab.first_part + slab.part[i]);
    }
    const std::array<double, 3> at{slab.vertices.x[i], slab.vertices.y[i], slab.vertices.z[i]};
    for (std::size_t k = 0; k < 3; ++k) {
      part_here->low[k] = std::min(part_here->low[k], at[k]);
      part_here->high[k] = std::max(part_here->high[k], at[k]);
    }
  }
  slab.end_part = first_id_ + parts_.size();
  count_triangles(slab);
}

/// Each of them joins the parts of its vertices.
void Pruner::count_triangles(const Slab& slab) {
  // Of the vertices of the slab before and of this one, counted from live_first_part_.
  std::vector<std::uint32_t> part_of = live_part_;
  part_of.reserve(live_part_.size() + slab.part.size());
  const auto own = static_cast<std::uint32_t>(slab.first_part - live_first_part_);
  for (const std::uint32_t p : slab.part) part_of.push_back(own + p);
  Part* root_here = nullptr;  // of this part, until parts are joined
  std::uint32_t part_here = kGone;
  for (const auto& t : slab.triangles) {
    std::array<std::uint32_t, 3> of{};
    for (std::size_t k = 0; k < 3; ++k) of[k] = part_of[t[k] - live_first_];
    if (of[1] != of[0] || of[2] != of[0]) {
      for (const std::size_t k : {1, 2}) join(live_first_part_ + of[k], live_first_part_ + of[0]);
      part_here = kGone;
    }
    if (of[0] != part_here) {
      part_here = of[0];
      root_here = &part(root(live_first_part_ + part_here));
    }
    ++root_here->triangles;
    if (rule_.samples > 0) root_here->samples += samples_under(slab, t);
  }
}

/// Vertices that see no sample have the density of those that do.
double Pruner::samples_under(const Slab& slab, const std::array<std::uint32_t, 3>& triangle) const {
  std::array<meshes::Vec3, 3> at{};
  double density = 0;
  int seen = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const bool here = triangle[k] >= slab.first;
    const VertexBatch& v = here ? slab.vertices : live_vertices_;
    const std::size_t i = triangle[k] - (here ? slab.first : live_first_);
    at[k] = {v.x[i], v.y[i], v.z[i]};
    density += static_cast<double>(v.density[i]);
    seen += v.density[i] > 0 ? 1 : 0;
  }
  if (seen == 0) return 0;
  using meshes::operator-;
  return meshes::triangle_area(at[0], at[1], at[2]) * density / seen;
}

bool Pruner::is_large(const Part& p) const {
  double square = 0;
  for (std::size_t k = 0; k < 3; ++k) square += (p.high[k] - p.low[k]) * (p.high[k] - p.low[k]);
  return p.triangles >= std::max<std::uint64_t>(1, rule_.triangles) &&
         p.samples >= static_cast<double>(rule_.samples) && std::sqrt(square) >= rule_.size;
}

void Pruner::judge(Part& p) const {
  if (p.fate == Fate::open && is_large(p)) p.fate = Fate::stays;
}

void Pruner::end_part(std::uint64_t id) {
  Part& p = part(id);
  if (p.ended) return;
  p.ended = true;
  judge(p);
  if (p.fate == Fate::open) p.fate = Fate::goes;
  if (p.fate == Fate::stays) {
    ++counts_.kept;
  } else if (p.triangles > 0) {
    ++counts_.removed;
    counts_.removed_triangles += p.triangles;
  }
}

/// Parts of the slab that was live and that have not grown into `live` can never grow again.
void Pruner::end_parts(const Slab& live, std::uint64_t from) {
  for (std::uint64_t id = from; id < live.first_part; ++id) {
    const std::uint64_t r = root(id);
    if (r < live.first_part) end_part(r);
  }
  for (std::uint64_t id = live.first_part; id < live.end_part; ++id) judge(part(root(id)));
}

void Pruner::add(const VertexBatch& vertices, const Triangles& triangles) {
  Slab slab;
  slab.first = vertices_;
  slab.vertices = vertices;
  slab.triangles = triangles;
  for_arrays(slab.vertices, slab.triangles, [&](const void*, std::size_t bytes) { slab.bytes += bytes; });
  vertices_ += vertices.size();
  find_parts(slab);
  end_parts(slab, live_first_part_);
  live_first_ = slab.first;
  live_first_part_ = slab.first_part;
  live_end_part_ = slab.end_part;
  live_part_ = slab.part;
  if (rule_.samples > 0) {
    live_vertices_.x = vertices.x;
    live_vertices_.y = vertices.y;
    live_vertices_.z = vertices.z;
    live_vertices_.density = vertices.density;
  }
  slab.vertices.density = {};
  hold(std::move(slab));
  pass_on_decided();
}

void Pruner::finish() {
  for (std::uint64_t id = live_first_part_; id < live_end_part_; ++id) end_part(root(id));
  pass_on_decided();
  if (!waiting_.empty()) throw Error(ExitCode::internal, "parts of the mesh are still undecided at its end");
}

void Pruner::hold(Slab&& slab) {
  held_bytes_ += slab.bytes;
  waiting_.push_back(std::move(slab));
  if (held_bytes_ > memory_) spill(waiting_.back());
}

void Pruner::spill(Slab& slab) {
  if (!file_) file_.emplace(tmp_dir_);
  for_arrays(slab.vertices, slab.triangles, [&](const void* data, std::size_t bytes) {
    file_->append({static_cast<const std::byte*>(data), bytes});
  });
  file_->flush();
  held_bytes_ -= slab.bytes;
  slab.spilled = true;
  // Only the sizes of the arrays are still wanted.
  const std::size_t triangles = slab.triangles.size();
  const std::size_t attributes = slab.vertices.attributes.size();
  slab.radii = !slab.vertices.radius.empty();
  slab.fitted = !slab.vertices.fitted.empty();
  slab.vertices = {};
  slab.vertices.attributes.resize(attributes);
  slab.triangles = Triangles();  // empty braces would keep the array
  slab.spilled_triangles = triangles;
}

void Pruner::fetch(Slab& slab) {
  resize(slab.vertices, slab.part.size());
  if (slab.radii) slab.vertices.radius.resize(slab.part.size());
  if (slab.fitted) slab.vertices.fitted.resize(slab.part.size());
  slab.triangles.resize(slab.spilled_triangles);
  std::uint64_t at = file_->begin();
  for_arrays(slab.vertices, slab.triangles, [&](void* data, std::size_t bytes) {
    file_->read(at, {static_cast<std::byte*>(data), bytes});
    at += bytes;
  });
  file_->discard_before(at);
}

void Pruner::pass_on_decided() {
  while (!waiting_.empty()) {
    Slab& slab = waiting_.front();
    for (std::uint64_t id = slab.first_part; id < slab.end_part; ++id) {
      if (part(root(id)).fate == Fate::open) return;
    }
    if (slab.spilled) {
      fetch(slab);
    } else {
      held_bytes_ -= slab.bytes;
    }
    pass_on(slab);
    waiting_.pop_front();
    const std::uint64_t wanted =
        std::min(live_first_part_, waiting_.empty() ? live_first_part_ : waiting_.front().first_part);
    for (; first_id_ < wanted; ++first_id_) parts_.pop_front();
  }
}

void Pruner::pass_on(Slab& slab) {
  const std::size_t n = slab.vertices.size();
  std::vector<std::uint8_t> stays(slab.end_part - slab.first_part);
  for (std::size_t i = 0; i < stays.size(); ++i) stays[i] = part(root(slab.first_part + i)).fate == Fate::stays ? 1 : 0;
  std::vector<std::uint32_t> number(n);
  std::size_t kept = 0;
  VertexBatch& v = slab.vertices;
  for (std::size_t i = 0; i < n; ++i) {
    number[i] = kGone;
    if (stays[slab.part[i]] == 0) continue;
    number[i] = static_cast<std::uint32_t>(written_ + kept);
    for (auto* values : {&v.x, &v.y, &v.z}) (*values)[kept] = (*values)[i];
    for (auto* values : {&v.nx, &v.ny, &v.nz}) (*values)[kept] = (*values)[i];
    for (auto& values : v.attributes) values[kept] = values[i];
    if (!v.radius.empty()) v.radius[kept] = v.radius[i];
    if (!v.fitted.empty()) v.fitted[kept] = v.fitted[i];
    ++kept;
  }
  resize(v, kept);
  std::size_t triangles = 0;
  for (const auto& t : slab.triangles) {
    std::array<std::uint32_t, 3> renumbered{};
    for (std::size_t k = 0; k < 3; ++k)
      renumbered[k] = t[k] >= slab.first ? number[t[k] - slab.first] : passed_number_[t[k] - passed_first_];
    if (renumbered[0] != kGone) slab.triangles[triangles++] = renumbered;
  }
  slab.triangles.resize(triangles);
  MeshSlab out;
  out.vertices = std::move(v);
  out.triangles = std::move(slab.triangles);
  sink_.write(out);
  written_ += kept;
  passed_first_ = slab.first;
  passed_number_ = std::move(number);
}

}  // namespace lamina
