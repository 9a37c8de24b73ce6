#include "boundary/hole_closer.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <map>

#include "lamina/error.h"

namespace lamina {

std::string describe(const HoleStats& s) {
  std::string text;
  if (s.closed > 0) text = fmt::format("{} holes closed with {} triangles", s.closed, s.triangles);
  if (s.open > 0) {
    text += fmt::format("{}{} boundary loops of {} edges left open", text.empty() ? "" : ", ", s.open, s.open_edges);
  } else if (!text.empty()) {
    text += ", none left open";
  }
  return text.empty() ? "no holes" : text;
}

namespace boundary {

HoleCloser::HoleCloser(const HoleSettings& settings, std::size_t attributes, bool double_positions)
    : settings_(settings),
      attributes_(attributes),
      distinct_(double_positions),
      paths_(
          settings.longest * (settings.watertight ? HoleSettings::kWatertight : 1), attributes,
          [this](Loop&& loop, const LoopExtent& extent) { loops_.emplace_back(std::move(loop), extent); },
          [this](const LoopExtent& extent) { leave(extent, Verdict::too_long); }) {}

void HoleCloser::leave(const LoopExtent& extent, Verdict why) {
  ++stats_.open;
  stats_.open_edges += extent.edges;
  stats_.open_length += extent.length;
  const auto longer = [](const OpenLoop& a, const OpenLoop& b) {
    return a.length != b.length ? a.length > b.length : a.position < b.position;
  };
  OpenLoop loop{extent.middle(), extent.length, extent.radii, extent.edges, describe(why)};
  auto& list = stats_.longest;
  list.insert(std::upper_bound(list.begin(), list.end(), loop, longer), loop);
  if (list.size() > HoleStats::kListed) list.pop_back();
}

void HoleCloser::add(const BoundaryBatch& batch, std::uint64_t first) {
  paths_.add(batch, static_cast<Number>(first));
}

void HoleCloser::add_part(const BoundaryBatch& batch, std::uint64_t first) {
  const auto shift = static_cast<Number>(first);
  paths_.add(batch, shift);
  // What both parts lack a triangle for is a boundary loop; where each has one it is an edge inside.
  std::map<std::pair<Number, Number>, BoundaryEdge> waiting;
  for (const BoundaryEdge& e : loose_) waiting[{e.from, e.to}] = e;
  BoundaryBatch met;
  loose_.clear();
  for (BoundaryEdge e : batch.loose) {
    e.from += shift;
    e.to += shift;
    if (e.from >= shift || e.to >= shift) {
      loose_.push_back(e);
      continue;
    }
    const auto other = waiting.find({e.to, e.from});
    if (other == waiting.end()) {
      met.edges.push_back(e);
    } else {
      met.inner.push_back({e.from, e.to});
      waiting.erase(other);
    }
  }
  for (const auto& [ends, e] : waiting) met.edges.push_back(e);
  paths_.add(met, 0);
  Number needed = shift;
  for (const BoundaryEdge& e : loose_) needed = std::min({needed, e.from, e.to});
  paths_.forget_below(needed);
}

void HoleCloser::fill_all(std::vector<Filling>& fillings) const {
  tbb::parallel_for(std::size_t{0}, loops_.size(),
                    [&](std::size_t i) { fillings[i] = fill_loop(loops_[i].first, settings_.longest); });
}

void HoleCloser::refuse_occupied(std::vector<Filling>& fillings) const {
  struct Seat {
    double x;
    std::size_t loop, vertex;
  };
  std::vector<Seat> seats;
  for (std::size_t l = 0; l < loops_.size(); ++l) {
    const auto& vertices = loops_[l].first.vertices;
    for (std::size_t v = 0; v < vertices.size(); ++v) seats.push_back({vertices[v].position[0], l, v});
  }
  std::sort(seats.begin(), seats.end(), [](const Seat& a, const Seat& b) { return a.x < b.x; });
  std::vector<std::uint8_t> occupied(loops_.size(), 0);
  tbb::parallel_for(std::size_t{0}, loops_.size(), [&](std::size_t l) {
    if (fillings[l].verdict != Verdict::filled) return;
    const auto& [loop, extent] = loops_[l];
    float radius = 0;
    for (const BoundaryVertex& v : loop.vertices) radius = std::max(radius, v.radius);
    const double margin = static_cast<double>(radius);
    auto seat = std::lower_bound(seats.begin(), seats.end(), extent.low[0] - margin,
                                 [](const Seat& s, double x) { return s.x < x; });
    for (; seat != seats.end() && seat->x <= extent.high[0] + margin; ++seat) {
      if (seat->loop == l) continue;
      const BoundaryVertex& v = loops_[seat->loop].first.vertices[seat->vertex];
      bool inside = true;
      for (std::size_t k = 1; k < 3; ++k)
        inside = inside && v.position[k] >= extent.low[k] - margin && v.position[k] <= extent.high[k] + margin;
      if (inside && occupies(v, loop, fillings[l])) {
        occupied[l] = 1;
        return;
      }
    }
  });
  for (std::size_t l = 0; l < loops_.size(); ++l) {
    if (occupied[l] != 0) fillings[l].verdict = Verdict::occupied;
  }
}

bool HoleCloser::is_closed_thing(std::uint64_t vertices) const {
  std::uint64_t edges = 0;
  for (const auto& [loop, extent] : loops_) edges += extent.edges;
  return settings_.watertight && stats_.open == 0 && edges * kLeastVerticesPerEdge <= vertices;
}

void HoleCloser::fill_rest(std::vector<Filling>& fillings) const {
  tbb::parallel_for(std::size_t{0}, loops_.size(), [&](std::size_t i) {
    if (fillings[i].verdict != Verdict::filled) fillings[i] = fill_any(loops_[i].first);
  });
}

void HoleCloser::append(const Loop& loop, const Filling& filling, std::uint64_t vertices, Addition& out) const {
  const std::uint64_t fresh = vertices + out.vertices.size();
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (fresh + filling.positions.size() > kMost) {
    throw Error(ExitCode::budget,
                fmt::format("holes: the mesh has more than {} vertices, the most 32-bit indices can name; use a larger "
                            "cell or cut the cloud",
                            kMost));
  }
  const std::size_t n = loop.vertices.size();
  for (const auto& t : filling.triangles) {
    std::array<std::uint32_t, 3> triangle{};
    for (std::size_t k = 0; k < 3; ++k) {
      triangle[k] = t[k] < n ? static_cast<std::uint32_t>(loop.vertices[t[k]].number)
                             : static_cast<std::uint32_t>(fresh + t[k] - n);
    }
    out.triangles.push_back(triangle);
  }
  VertexBatch& v = out.vertices;
  for (std::size_t i = 0; i < filling.positions.size(); ++i) {
    v.x.push_back(filling.positions[i][0]);
    v.y.push_back(filling.positions[i][1]);
    v.z.push_back(filling.positions[i][2]);
    v.nx.push_back(filling.normals[i][0]);
    v.ny.push_back(filling.normals[i][1]);
    v.nz.push_back(filling.normals[i][2]);
    for (std::size_t a = 0; a < attributes_; ++a) v.attributes[a].push_back(filling.attributes[i * attributes_ + a]);
  }
}

Addition HoleCloser::finish(std::uint64_t vertices) {
  BoundaryBatch last;
  last.edges = std::move(loose_);
  loose_.clear();
  paths_.add(last, 0);
  paths_.finish();
  std::sort(loops_.begin(), loops_.end(), [](const auto& a, const auto& b) {
    return a.first.vertices.front().number < b.first.vertices.front().number;
  });
  std::vector<Filling> fillings(loops_.size());
  fill_all(fillings);
  refuse_occupied(fillings);
  if (is_closed_thing(vertices)) fill_rest(fillings);
  Addition out;
  out.vertices.attributes.resize(attributes_);
  for (std::size_t l = 0; l < loops_.size(); ++l) {
    const auto& [loop, extent] = loops_[l];
    if (fillings[l].verdict != Verdict::filled) {
      leave(extent, fillings[l].verdict);
      continue;
    }
    append(loop, fillings[l], vertices, out);
    for (const BoundaryVertex& v : loop.vertices) distinct_.occupy(v.position[0], v.position[1], v.position[2]);
    ++stats_.closed;
    stats_.closed_edges += extent.edges;
  }
  distinct_.separate(out.vertices);
  stats_.vertices = out.vertices.size();
  stats_.triangles = out.triangles.size();
  loops_.clear();
  return out;
}

}  // namespace boundary
}  // namespace lamina
