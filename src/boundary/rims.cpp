#include "boundary/rims.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

namespace lamina {
namespace {

constexpr std::uint32_t kGone = ~0U;

/// A vertex of one of two slabs.
struct VertexAt {
  const VertexBatch* batch;
  std::size_t i;
  [[nodiscard]] float overhang() const { return batch->overhang[i]; }
};

/// With room for the vertices of another batch and a few more.
void make_empty(VertexBatch& batch, const VertexBatch& other) {
  const std::size_t room = other.size() + other.size() / 16;
  const auto clear = [room](auto& values) {
    values.clear();
    values.reserve(room);
  };
  for (auto* values : {&batch.x, &batch.y, &batch.z}) clear(*values);
  for (auto* values : {&batch.nx, &batch.ny, &batch.nz}) clear(*values);
  batch.attributes.resize(other.attributes.size());
  for (auto& values : batch.attributes) clear(values);
  batch.radius.clear();
  if (!other.radius.empty()) batch.radius.reserve(room);
  batch.density.clear();
  if (!other.density.empty()) batch.density.reserve(room);
  batch.overhang.clear();
}

/// Vertices [begin, end).
void append_copies(const VertexBatch& from, std::size_t begin, std::size_t end, VertexBatch& to) {
  const auto append = [&](const auto& values, auto& out) {
    if (values.empty()) return;
    const auto first = values.begin();
    out.insert(out.end(), first + static_cast<std::ptrdiff_t>(begin), first + static_cast<std::ptrdiff_t>(end));
  };
  append(from.x, to.x);
  append(from.y, to.y);
  append(from.z, to.z);
  append(from.nx, to.nx);
  append(from.ny, to.ny);
  append(from.nz, to.nz);
  for (std::size_t a = 0; a < from.attributes.size(); ++a) append(from.attributes[a], to.attributes[a]);
  append(from.radius, to.radius);
  append(from.density, to.density);
}

/// The point at t between two vertices.
void append_between(const VertexAt& a, const VertexAt& b, float t, VertexBatch& to) {
  const double u = double{t};
  const auto mix = [u](double p, double q) { return p + u * (q - p); };
  const auto blend = [t](float p, float q) { return (1 - t) * p + t * q; };
  to.x.push_back(mix(a.batch->x[a.i], b.batch->x[b.i]));
  to.y.push_back(mix(a.batch->y[a.i], b.batch->y[b.i]));
  to.z.push_back(mix(a.batch->z[a.i], b.batch->z[b.i]));
  float nx = blend(a.batch->nx[a.i], b.batch->nx[b.i]);
  float ny = blend(a.batch->ny[a.i], b.batch->ny[b.i]);
  float nz = blend(a.batch->nz[a.i], b.batch->nz[b.i]);
  const float length = std::sqrt(nx * nx + ny * ny + nz * nz);
  if (length > 1e-6F) {
    nx /= length;
    ny /= length;
    nz /= length;
  } else {  // opposite ones: the first vertex's will do
    nx = a.batch->nx[a.i];
    ny = a.batch->ny[a.i];
    nz = a.batch->nz[a.i];
  }
  to.nx.push_back(nx);
  to.ny.push_back(ny);
  to.nz.push_back(nz);
  for (std::size_t c = 0; c < a.batch->attributes.size(); ++c)
    to.attributes[c].push_back(blend(a.batch->attributes[c][a.i], b.batch->attributes[c][b.i]));
  if (!a.batch->radius.empty()) to.radius.push_back(blend(a.batch->radius[a.i], b.batch->radius[b.i]));
  if (!a.batch->density.empty()) to.density.push_back(std::max(a.batch->density[a.i], b.batch->density[b.i]));
}

}  // namespace

void RimTrimmer::push(MeshSlab slab) {
  Held& held = held_.emplace_back();
  held.first = pushed_;
  pushed_ += static_cast<std::uint32_t>(slab.vertices.size());
  held.mesh = std::move(slab);
  const std::vector<float>& overhang = held.mesh.vertices.overhang;
  held.rim = std::any_of(overhang.begin(), overhang.end(), [&](float o) { return !(o < level_); });
}

void RimTrimmer::finish() {
  finished_ = true;
}

bool RimTrimmer::pop(MeshSlab& out) {
  const std::size_t at = below_ ? 1 : 0;
  if (held_.size() <= at || (held_.size() == at + 1 && !finished_)) return false;
  const Held* const below = below_ ? &held_.front() : nullptr;
  const Held* const above = held_.size() > at + 1 ? &held_[at + 1] : nullptr;
  // An edge of the slab that is cut has an end in it or below that does not stay.
  if ((below != nullptr && below->rim) || held_[at].rim) {
    trim(below, held_[at], above, out);
  } else {
    pass(below, held_[at], above != nullptr && above->rim, out);
  }
  if (below_) {
    spare_ = std::move(held_.front().mesh);
    held_.pop_front();
  }
  below_ = true;
  return true;
}

/// An edge belongs to the slab of its upper vertex: that slab's triangles and those of the slab above have it.
void RimTrimmer::find_cuts(const Held* below, Held& here, const Held* above) const {
  const auto inside = [&](std::uint32_t v) {
    const Held& h = v >= here.first ? here : *below;
    return h.mesh.vertices.overhang[v - h.first] < level_;
  };
  const auto look = [&](const std::vector<std::array<std::uint32_t, 3>>& triangles) {
    for (const auto& t : triangles) {
      // Nearly all: they have no edge of the slab, or none that is cut.
      if ((t[0] < here.end()) + (t[1] < here.end()) + (t[2] < here.end()) < 2) continue;
      if (std::max({t[0], t[1], t[2]}) < here.end() && inside(t[0]) == inside(t[1]) && inside(t[1]) == inside(t[2]))
        continue;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto [low, high] = std::minmax(t[k], t[(k + 1) % 3]);
        if (high < here.first || high >= here.end() || inside(low) == inside(high)) continue;
        here.cuts.emplace_back(low, high);
      }
    }
  };
  look(here.mesh.triangles);
  if (above != nullptr && here.rim) look(above->mesh.triangles);
  std::sort(here.cuts.begin(), here.cuts.end());
  here.cuts.erase(std::unique(here.cuts.begin(), here.cuts.end()), here.cuts.end());
}

void RimTrimmer::add_cut_vertices(const Held* below, const Held& here, VertexBatch& out) const {
  const auto at = [&](std::uint32_t v) {
    const Held& h = v >= here.first ? here : *below;
    return VertexAt{&h.mesh.vertices, v - h.first};
  };
  for (const auto& [low, high] : here.cuts) {
    VertexAt in = at(low);
    VertexAt beyond = at(high);
    if (in.overhang() >= level_) std::swap(in, beyond);
    const float t = (level_ - in.overhang()) / (beyond.overhang() - in.overhang());
    append_between(in, beyond, std::clamp(t, kLeastCut, 1 - kLeastCut), out);
  }
}

void RimTrimmer::cut_triangles(const Held* below, const Held& here, MeshSlab& out) const {
  const auto kept = [&](std::uint32_t v) {
    const Held& h = v >= here.first ? here : *below;
    const std::uint32_t n = h.number[v - h.first];
    return n == kGone ? kGone : h.trimmed_first + n;
  };
  const auto cut = [&](std::uint32_t a, std::uint32_t b) {
    const Edge edge = std::minmax(a, b);
    const Held& h = edge.second >= here.first ? here : *below;
    const auto found = std::lower_bound(h.cuts.begin(), h.cuts.end(), edge);
    return h.trimmed_first + h.kept + static_cast<std::uint32_t>(found - h.cuts.begin());
  };
  for (std::array<std::uint32_t, 3> t : here.mesh.triangles) {
    std::array<std::uint32_t, 3> to{kept(t[0]), kept(t[1]), kept(t[2])};
    const auto gone = std::count(to.begin(), to.end(), kGone);
    if (gone == 0) out.triangles.push_back(to);
    if (gone == 0 || gone == 3) continue;
    // The vertex that is alone on its side comes first.
    while ((to[0] == kGone) != (gone == 1)) {
      std::rotate(t.begin(), t.begin() + 1, t.end());
      std::rotate(to.begin(), to.begin() + 1, to.end());
    }
    const std::uint32_t next = cut(t[0], t[1]);
    const std::uint32_t before = cut(t[2], t[0]);
    if (gone == 2) {
      out.triangles.push_back({to[0], next, before});
    } else {
      // A quadrilateral next, to[1], to[2], before: it does not matter to the rim which way it is halved.
      out.triangles.push_back({next, to[1], to[2]});
      out.triangles.push_back({next, to[2], before});
    }
  }
}

/// Neither its edges nor those to the slab below are cut. `stays`: those to the one above may be.
void RimTrimmer::pass(const Held* below, Held& here, bool stays, MeshSlab& out) {
  const auto size = static_cast<std::uint32_t>(here.mesh.vertices.size());
  here.trimmed_first = trimmed_;
  here.kept = size;
  trimmed_ += size;
  here.number.resize(size);
  std::iota(here.number.begin(), here.number.end(), 0U);
  out.slab = here.mesh.slab;
  out.triangles.clear();
  out.triangles.reserve(here.mesh.triangles.size());
  for (const std::array<std::uint32_t, 3>& t : here.mesh.triangles) {
    std::array<std::uint32_t, 3>& to = out.triangles.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      const Held& h = t[k] >= here.first ? here : *below;
      to[k] = h.trimmed_first + h.number[t[k] - h.first];
    }
  }
  if (stays) {
    out.vertices = here.mesh.vertices;
    out.vertices.overhang.clear();
  } else {
    std::swap(out.vertices, here.mesh.vertices);
    here.mesh.vertices.overhang = std::exchange(out.vertices.overhang, {});
  }
}

void RimTrimmer::trim(const Held* below, Held& here, const Held* above, MeshSlab& out) {
  const VertexBatch& from = here.mesh.vertices;
  find_cuts(below, here, above);
  here.trimmed_first = trimmed_;
  here.number.assign(from.size(), kGone);
  out.slab = here.mesh.slab;
  out.triangles.clear();
  out.triangles.reserve(here.mesh.triangles.size() + here.cuts.size());
  make_empty(out.vertices, from);
  for (std::size_t i = 0, end = 0; i < from.size(); i = end) {  // run by run of those that stay, or go
    const bool goes = from.overhang[i] >= level_;
    for (end = i + 1; end < from.size() && (from.overhang[end] >= level_) == goes;) ++end;
    if (goes) continue;
    const auto numbers = here.number.begin();
    std::iota(numbers + static_cast<std::ptrdiff_t>(i), numbers + static_cast<std::ptrdiff_t>(end), here.kept);
    here.kept += static_cast<std::uint32_t>(end - i);
    append_copies(from, i, end, out.vertices);
  }
  add_cut_vertices(below, here, out.vertices);
  trimmed_ += static_cast<std::uint32_t>(out.vertices.size());
  cut_triangles(below, here, out);
}

namespace {

/// Sums of whole numbers do not depend on their order.
constexpr float kUnits = 1 << 20;

}  // namespace

void RimSmoother::push(MeshSlab slab) {
  Held held;
  held.first = pushed_;
  held.overhang = slab.vertices.overhang;
  held.mesh = std::move(slab);
  held.fans.assign(held.overhang.size(), 0);
  pushed_ += static_cast<std::uint32_t>(held.overhang.size());
  FanHashes none;
  add_fans(held.mesh, held.first, held.fans, held_.empty() ? none : held_.back().fans);
  // Vertices have triangles in their own slab and in the one above.
  if (!held_.empty()) find_boundary(held_.back());
  held_.push_back(std::move(held));
}

void RimSmoother::finish() {
  finished_ = true;
  if (!held_.empty()) find_boundary(held_.back());
}

bool RimSmoother::pop(MeshSlab& out) {
  const std::size_t at = below_ ? 1 : 0;
  if (held_.size() <= at || (!finished_ && held_.size() < at + 3)) return false;
  const Held* const below = below_ ? &held_.front() : nullptr;
  const Held* const above = held_.size() > at + 1 ? &held_[at + 1] : nullptr;
  Held& here = held_[at];
  if (here.rim || (below != nullptr && below->rim) || (above != nullptr && above->rim)) smooth(here, below, above);
  out = std::move(here.mesh);
  if (below_) held_.pop_front();
  below_ = true;
  return true;
}

void RimSmoother::find_boundary(Held& here) const {
  here.boundary.resize(here.overhang.size());
  here.raised.resize(here.overhang.size());
  for (std::size_t i = 0; i < here.overhang.size(); ++i) {
    here.boundary[i] = here.fans[i] != 0 ? 1 : 0;
    here.rim = here.rim || here.boundary[i] != 0 || here.overhang[i] >= level_;
    here.raised[i] = static_cast<std::uint32_t>(raised(here, i) * kUnits);
  }
  here.fans = {};
}

void RimSmoother::smooth(Held& here, const Held* below, const Held* above) {
  around_.assign(here.overhang.size(), {});
  const auto add = [&](const MeshSlab& mesh) {
    for (const auto& t : mesh.triangles) {
      if (std::min({t[0], t[1], t[2]}) >= here.end()) continue;  // most of those above
      std::array<std::uint32_t, 3> overhang, inside;
      for (std::size_t k = 0; k < 3; ++k) {
        const Held& of = t[k] < here.first ? *below : t[k] < here.end() ? here : *above;
        overhang[k] = of.raised[t[k] - of.first];
        inside[k] = 1U - of.boundary[t[k] - of.first];
      }
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t v = t[k] - here.first;  // of one of another slab: beyond this one's
        if (v >= around_.size()) continue;
        Around& a = around_[v];
        a.sum += std::uint64_t{overhang[(k + 1) % 3]} + overhang[(k + 2) % 3];
        a.neighbours += 2;
        a.inside += inside[(k + 1) % 3] + inside[(k + 2) % 3];
      }
    }
  };
  add(here.mesh);
  if (above != nullptr) add(above->mesh);
  std::vector<float>& out = here.mesh.vertices.overhang;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Around& a = around_[i];
    if (a.neighbours == 0 || (here.boundary[i] != 0 && a.inside == 0)) continue;
    const float mean = static_cast<float>(a.sum) / (kUnits * static_cast<float>(a.neighbours));
    out[i] = 0.5F * (raised(here, i) + mean);
  }
}

}  // namespace lamina
