#include "boundary/hole_closer.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <set>

#include "boundary/fill.h"
#include "lamina/error.h"

namespace lamina {

std::string describe(const HoleStats& s) {
  std::string text;
  if (s.closed > 0)
    text = fmt::format("{} holes closed with {} triangles", s.closed, s.triangles - s.invented_triangles);
  if (s.invented > 0) {
    text += fmt::format("{}{} open ends of {} edges closed by invention with {} triangles", text.empty() ? "" : ", ",
                        s.invented, s.invented_edges, s.invented_triangles);
  }
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
          settings.all ? BoundaryPaths::Bounds{std::numeric_limits<double>::infinity(),
                                               std::numeric_limits<std::uint64_t>::max()}
                       : BoundaryPaths::Bounds{bound(), kMostEdges},
          attributes, [this](Loop&& loop, const LoopExtent& extent) { take(std::move(loop), extent); },
          [this](const LoopExtent& extent) { leave(extent, Verdict::too_long); }) {}

double HoleCloser::bound() const {
  return settings_.watertight != Watertight::no ? std::max(settings_.longest, HoleSettings::kWatertight)
                                                : settings_.longest;
}

void HoleCloser::take(Loop&& loop, const LoopExtent& extent) {
  const bool is_long = extent.radii > bound() * BoundaryPaths::kRoundedUp || extent.edges > kMostEdges;
  (is_long ? long_ : loops_).emplace_back(std::move(loop), extent);
}

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

void HoleCloser::fill_all(std::vector<Closing>& closings) const {
  tbb::parallel_for(std::size_t{0}, loops_.size(),
                    [&](std::size_t i) { closings[i].filling = fill_loop(loops_[i].first, settings_.longest); });
}

std::vector<HoleCloser::Occupants> HoleCloser::find_occupants(const std::vector<Closing>& closings) const {
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
  std::vector<Occupants> occupants(loops_.size());
  tbb::parallel_for(std::size_t{0}, loops_.size(), [&](std::size_t l) {
    if (closings[l].filling.verdict != Verdict::filled) return;
    const auto& [loop, extent] = loops_[l];
    const FilledPlace place(loop, closings[l].filling);
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
      if (inside && place.holds(v)) ++occupants[l][seat->loop];
    }
  });
  return occupants;
}

void HoleCloser::pass_over_holes_beside(const std::vector<Closing>& closings, std::vector<Occupants>& occupants) const {
  tbb::parallel_for(std::size_t{0}, loops_.size(), [&](std::size_t l) {
    std::erase_if(occupants[l], [&](const auto& occupant) {
      const std::size_t o = occupant.first;
      return closings[o].filling.verdict == Verdict::filled && lies_beside(loops_[o].first, loops_[l].first);
    });
  });
}

bool HoleCloser::is_occupied(std::size_t gap, const Occupants& occupants) const {
  std::size_t vertices = 0;
  for (const auto& [loop, held] : occupants) vertices += held;
  return static_cast<double>(vertices) > kMostOccupied * static_cast<double>(loops_[gap].first.vertices.size());
}

bool HoleCloser::take_islands(std::size_t outer, const Occupants& occupants, const std::vector<Closing>& closings,
                              Closing& out) const {
  const Loop& loop = loops_[outer].first;
  const FilledPlace place(loop, closings[outer].filling);
  std::vector<const Loop*> islands;
  std::vector<std::size_t> others;
  for (const auto& [o, held] : occupants) {
    if (closings[o].filling.verdict == Verdict::outer_boundary && place.surrounds(loops_[o].first)) {
      islands.push_back(&loops_[o].first);
      out.islands.push_back(o);
    } else {
      others.push_back(o);
    }
  }
  // What else is there must be holes in the islands themselves.
  for (const std::size_t o : others) {
    if (std::none_of(islands.begin(), islands.end(),
                     [&](const Loop* island) { return FilledPlace(*island, {}).surrounds(loops_[o].first); }))
      return false;
  }
  if (islands.empty()) return false;
  out.filling = fill_around(loop, islands);
  return out.filling.verdict == Verdict::filled;
}

void HoleCloser::settle_occupied(std::vector<Closing>& closings) const {
  std::vector<Occupants> occupants = find_occupants(closings);
  pass_over_holes_beside(closings, occupants);
  const std::vector<Closing> before = closings;
  tbb::parallel_for(std::size_t{0}, loops_.size(), [&](std::size_t l) {
    if (occupants[l].empty()) return;
    Closing with;
    if (take_islands(l, occupants[l], before, with)) {
      closings[l] = std::move(with);
    } else if (is_occupied(l, occupants[l])) {
      closings[l].filling = {};
      closings[l].filling.verdict = Verdict::occupied;
    }
  });
  // An island belongs to the first gap that has it.
  std::set<std::size_t> taken;
  for (Closing& closing : closings) {
    const bool free = std::none_of(closing.islands.begin(), closing.islands.end(),
                                   [&](std::size_t island) { return taken.contains(island); });
    if (free) {
      taken.insert(closing.islands.begin(), closing.islands.end());
    } else {
      closing = {};
      closing.filling.verdict = Verdict::occupied;
    }
  }
  for (const std::size_t island : taken) closings[island].filling.verdict = Verdict::joined;
}

namespace {

bool is_slit(const Closure& closure) {
  return closure.width >= kLeastSlit && closure.width <= kSlit && closure.leads_in >= kLiesBack;
}

}  // namespace

void HoleCloser::bridge_gaps(std::vector<Closing>& closings) const {
  std::vector<Closing> bridges(loops_.size());
  tbb::parallel_for(std::size_t{0}, loops_.size(), [&](std::size_t l) {
    const Verdict verdict = closings[l].filling.verdict;
    if (verdict != Verdict::bent && verdict != Verdict::outer_boundary) return;
    const auto& [loop, extent] = loops_[l];
    Closure closure = close_loop(loop);
    const double least = kBridgeLeadsIn + kBridgePerRadius * extent.radii;
    const bool leads_in = verdict == Verdict::bent && closure.leads_in >= least;
    if (!leads_in && !is_slit(closure)) return;
    bridges[l].filling = std::move(closure.filling);
    bridges[l].filling.verdict = Verdict::filled;
  });
  std::vector<Occupants> occupants = find_occupants(bridges);
  pass_over_holes_beside(closings, occupants);
  for (std::size_t l = 0; l < loops_.size(); ++l) {
    if (bridges[l].is_closed() && !is_occupied(l, occupants[l])) closings[l] = std::move(bridges[l]);
  }
}

bool HoleCloser::may_be_closed_thing(std::uint64_t vertices, const std::vector<Closing>& closings) const {
  std::uint64_t edges = 0;
  for (std::size_t l = 0; l < loops_.size(); ++l) {
    if (!closings[l].is_closed() && !is_wide(l)) edges += loops_[l].second.edges;
  }
  return settings_.watertight != Watertight::no && stats_.open == 0 && long_.empty() &&
         edges * kLeastVerticesPerEdge <= vertices;
}

bool HoleCloser::close_wide(std::vector<Closing>& closings) const {
  std::vector<std::size_t> wide;
  for (std::size_t l = 0; l < loops_.size(); ++l) {
    if (!closings[l].is_closed() && is_wide(l)) wide.push_back(l);
  }
  if (wide.empty()) return true;
  if (settings_.watertight != Watertight::any_loops) return false;
  std::vector<Closure> closures(wide.size());
  tbb::parallel_for(std::size_t{0}, wide.size(),
                    [&](std::size_t i) { closures[i] = close_loop(loops_[wide[i]].first); });
  double all = 0, away = 0;
  for (std::size_t i = 0; i < wide.size(); ++i) {
    const double length = loops_[wide[i]].second.radii;
    all += length;
    away += closures[i].leads_in >= kLeadsIn ? 0 : length;
  }
  if (away > kMostLeadsAway * all) return false;
  for (std::size_t i = 0; i < wide.size(); ++i) {
    Filling& filling = closings[wide[i]].filling;
    filling = std::move(closures[i].filling);
    filling.verdict = Verdict::filled;
  }
  return true;
}

void HoleCloser::fill_rest(std::vector<Closing>& closings) const {
  tbb::parallel_for(std::size_t{0}, loops_.size(), [&](std::size_t i) {
    if (!closings[i].is_closed()) closings[i].filling = fill_any(loops_[i].first);
  });
}

/// What nothing tells how to close, behind the loops that were closed otherwise.
void HoleCloser::invent_rest(std::vector<Closing>& closings) {
  std::move(long_.begin(), long_.end(), std::back_inserter(loops_));
  long_.clear();
  closings.resize(loops_.size());
  tbb::parallel_for(std::size_t{0}, loops_.size(), [&](std::size_t i) {
    if (!closings[i].is_closed()) closings[i].filling = close_loop(loops_[i].first).filling;
  });
}

void HoleCloser::require_all_closed() const {
  if (stats_.open == 0) return;
  const std::array<double, 3>& at = stats_.longest.front().position;
  throw Error(
      ExitCode::internal,
      fmt::format("fill all: {} boundary loops cannot be closed, since several meet in a vertex; the longest is "
                  "at {:g}, {:g}, {:g}; --fill auto leaves them open",
                  stats_.open, at[0], at[1], at[2]));
}

void HoleCloser::append(std::size_t l, const Closing& closing, std::uint64_t vertices, Addition& out) {
  const Filling& filling = closing.filling;
  const std::uint64_t fresh = vertices + out.vertices.size();
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (fresh + filling.positions.size() > kMost) {
    throw Error(ExitCode::budget,
                fmt::format("holes: the mesh has more than {} vertices, the most 32-bit indices can name; use a larger "
                            "cell or cut the cloud",
                            kMost));
  }
  std::vector<std::size_t> loops{l};
  loops.insert(loops.end(), closing.islands.begin(), closing.islands.end());
  std::vector<std::uint32_t> rim;
  for (const std::size_t one : loops) {
    for (const BoundaryVertex& v : loops_[one].first.vertices) {
      rim.push_back(static_cast<std::uint32_t>(v.number));
      distinct_.occupy(v.position[0], v.position[1], v.position[2]);
    }
    const bool invented = filling.verdict == Verdict::invented;
    ++(invented ? stats_.invented : stats_.closed);
    (invented ? stats_.invented_edges : stats_.closed_edges) += loops_[one].second.edges;
  }
  if (filling.verdict == Verdict::invented) {
    stats_.invented_vertices += filling.positions.size();
    stats_.invented_triangles += filling.triangles.size();
  }
  const std::size_t n = rim.size();
  for (const auto& t : filling.triangles) {
    std::array<std::uint32_t, 3> triangle{};
    for (std::size_t k = 0; k < 3; ++k)
      triangle[k] = t[k] < n ? rim[t[k]] : static_cast<std::uint32_t>(fresh + t[k] - n);
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
    if (settings_.all) {
      v.attributes.back().back() = filling.verdict == Verdict::invented ? 1 : 0;
      if (settings_.mark) v.attributes[attributes_ - 2].back() = filling.verdict == Verdict::invented ? 0 : 1;
    } else if (settings_.mark) {
      v.attributes.back().back() = 1;
    }
  }
}

Addition HoleCloser::finish(std::uint64_t vertices) {
  BoundaryBatch last;
  last.edges = std::move(loose_);
  loose_.clear();
  paths_.add(last, 0);
  paths_.finish();
  const auto sort_loops = [](auto& loops) {
    std::sort(loops.begin(), loops.end(), [](const auto& a, const auto& b) {
      return a.first.vertices.front().number < b.first.vertices.front().number;
    });
  };
  sort_loops(loops_);
  std::vector<Closing> closings(loops_.size());
  fill_all(closings);
  settle_occupied(closings);
  if (settings_.bridge) bridge_gaps(closings);
  if (may_be_closed_thing(vertices, closings) && close_wide(closings)) fill_rest(closings);
  if (settings_.all) {
    sort_loops(long_);
    invent_rest(closings);
  }
  Addition out;
  out.vertices.attributes.resize(attributes_);
  for (std::size_t l = 0; l < loops_.size(); ++l) {
    const Verdict verdict = closings[l].filling.verdict;
    if (verdict == Verdict::filled || verdict == Verdict::invented) {
      append(l, closings[l], vertices, out);
    } else if (verdict != Verdict::joined) {
      leave(loops_[l].second, verdict);
    }
  }
  if (settings_.all) require_all_closed();
  distinct_.separate(out.vertices);
  stats_.vertices = out.vertices.size();
  stats_.triangles = out.triangles.size();
  loops_.clear();
  return out;
}

}  // namespace boundary
}  // namespace lamina
