#include "simplify/rounds.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <queue>
#include <span>
#include <utility>

#include "lamina/error.h"
#include "measure/edge_table.h"
#include "simplify/cut.h"

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr std::size_t kPieceTriangles = 24'000;  ///< some 3 MB with queue and quadrics
constexpr double kRoundShrinks = 0.5;            ///< a round leaves no smaller share of the triangles
constexpr double kLastRound = 1.15;              ///< of the wanted ones: what the last round begins with at the most
constexpr double kInTurn = 1.01;  ///< from this many of the wanted ones on, pieces take turns, the cheapest edge of all

constexpr double kHardlyAny =
    0.01;  ///< of the triangles: a round that ends before its goal and takes fewer is the last

constexpr std::uint64_t kPieceKeeps = 8;  ///< one in so many triangles, where a limit of the cost says how far to go

// With a bound:
constexpr double kFirstBound = 0.125;  ///< of the median edge: few triangles lie so near another; no step is less
constexpr double kBoundGrows = 4;      ///< from one step to the next; what a step has used up is missing in the last
constexpr int kRings = 4;              ///< of triangles around what a round may move: proofs look at what lies around
constexpr int kBoundRounds = 3;  ///< of the last step: the first goes as far as it can, others clear what it held fast

/// Where a round cuts: different from the two before it.
double share_of_round(int round) {
  constexpr std::array<double, 3> kShares{0.5, 0.41, 0.59};
  return kShares[static_cast<std::size_t>(round) % kShares.size()];
}

/// Triangles by number: all of them, or, where rounds have gone before, those within kRings of a vertex that has not
/// been tried and may move. Few have not: those that pieces held fast.
std::vector<std::uint32_t> triangles_to_try(const WorkMesh& work) {
  const std::vector<Triangle>& triangles = work.mesh.triangles;
  std::vector<std::uint32_t> chosen;
  if (std::all_of(work.tried.begin(), work.tried.end(), [](std::uint8_t tried) { return tried == 0; })) {
    chosen.resize(triangles.size());
    std::iota(chosen.begin(), chosen.end(), 0U);
    return chosen;
  }
  std::vector<std::uint8_t> near(work.tried.size());
  for (std::size_t v = 0; v < near.size(); ++v) {
    near[v] = work.tried[v] == 0 && (work.locked.empty() || work.locked[v] == 0) ? 1 : 0;
  }
  const auto is_near = [&](const Triangle& t) { return (near[t[0]] | near[t[1]] | near[t[2]]) != 0; };
  for (int ring = 1; ring < kRings; ++ring) {
    std::vector<std::uint8_t> wider = near;
    for (const Triangle& t : triangles) {
      if (is_near(t)) wider[t[0]] = wider[t[1]] = wider[t[2]] = 1;
    }
    near = std::move(wider);
  }
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    if (is_near(triangles[t])) chosen.push_back(t);
  }
  return chosen;
}

class Round {
 public:
  Round(WorkMesh& work, double share) : work_(work), size_(work.mesh.triangles.size()) {
    const std::vector<std::uint32_t> chosen = triangles_to_try(work);
    const auto place = [&](std::size_t number) {
      const auto& [a, b, c] = work.mesh.triangles[chosen[number]];
      return at(a) + at(b) + at(c);
    };
    starts_ = cut_into_boxes(chosen.size(), place, kPieceTriangles, share, order_);
    for (std::uint32_t& triangle : order_) triangle = chosen[triangle];
    pieces_.resize(starts_.size() - 1);
    vertices_.resize(pieces_.size());
    find_owners(chosen);
  }

  [[nodiscard]] std::uint64_t size() const { return size_; }

  /// False when no edge can go any more.
  bool reduce(std::uint64_t goal, bool exactly, const RunContext& run) {
    make_pieces();
    const auto in_parallel = static_cast<std::uint64_t>(kInTurn * static_cast<double>(goal));
    float dearest = 0;
    const std::uint64_t odd = 2 * pieces_.size();  // what rounding up and contractions by two may take beside
    while (size_ > std::max(goal, in_parallel) && size_ - goal > 2 * odd) {
      if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
      const double part = static_cast<double>(size_ - goal - odd) / static_cast<double>(size_);
      tbb::parallel_for(std::size_t{0}, pieces_.size(), [&](std::size_t p) {
        Contractor& c = *pieces_[p];
        const auto some = static_cast<std::uint64_t>(std::ceil(part * static_cast<double>(c.size())));
        c.run(dearest, c.size() - std::min(c.size(), some));
      });
      float next = std::numeric_limits<float>::infinity();
      size_ = 0;
      for (const auto& piece : pieces_) {
        size_ += piece->size();
        next = std::min(next, piece->next_cost());
      }
      if (std::isinf(next)) return false;
      // Errors of smooth surfaces grow with the cube of the area of triangles.
      dearest = std::max(next, dearest * (size_ > goal + goal / 2 ? 2.F : 1.25F));
    }
    return !exactly || in_turn(goal);
  }

  /// What costs no more than `limit`; of a piece at least a small share stays.
  void reduce_below(float limit, const RunContext& run) {
    make_pieces();
    tbb::parallel_for(std::size_t{0}, pieces_.size(), [&](std::size_t p) {
      Contractor& c = *pieces_[p];
      const std::uint64_t keep = c.size() / kPieceKeeps;
      for (float dearest = 0; !run.cancelled() && c.size() > keep && c.next_cost() <= limit;) {
        dearest = std::min(limit, std::max(c.next_cost(), 2 * dearest));
        c.run(dearest, keep);
      }
    });
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
  }

  /// Of every so manieth piece.
  CostCurve costs(std::size_t stride) {
    std::vector<CostCurve> curves(pieces_.size());
    tbb::parallel_for(std::size_t{0}, pieces_.size(), [&](std::size_t p) {
      if (p % stride != stride / 2 && pieces_.size() > stride / 2) return;
      make_piece(p);
      Contractor& c = *pieces_[p];
      const auto& fixed = c.piece().fixed;
      curves[p].expect(2 * static_cast<std::uint64_t>(std::count(fixed.begin(), fixed.end(), 0)));
      const std::uint64_t keep = c.size() / kPieceKeeps;
      for (float step = 0; c.size() > keep && !std::isinf(c.next_cost());) {
        step = CostCurve::step_above(std::max(c.next_cost(), 1.01F * step));
        curves[p].add(step, c.run(step, keep));
      }
    });
    CostCurve all;
    for (const CostCurve& curve : curves) all.add(curve);
    return all;
  }

  /// As far as a bound goes. Pieces are made one after the other: proofs take memory.
  void exhaust(double bound, const RunContext& run) {
    tbb::parallel_for(std::size_t{0}, pieces_.size(), [&](std::size_t p) {
      if (run.cancelled()) return;
      make_piece(p, bound);
      Contractor& c = *pieces_[p];
      for (float dearest = 0; !run.cancelled() && !std::isinf(c.next_cost());) {
        dearest = std::max(c.next_cost(), 2 * dearest);
        c.run(dearest, 0);
      }
      c.prove();
    });
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
  }

  /// Everything back into the mesh. Returns the number of contractions.
  std::uint64_t finish() {
    tbb::parallel_for(std::size_t{0}, pieces_.size(), [&](std::size_t p) { put_back(p); });
    std::uint64_t contractions = 0;
    for (const auto& piece : pieces_) {
      contractions += piece->merges().size();
      work_.deviation = std::max(work_.deviation, piece->deviation());
    }
    auto& triangles = work_.mesh.triangles;
    std::size_t kept = 0;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      if (triangles[t][0] == kNone) continue;
      if (work_.bound > 0) work_.errors[kept] = work_.errors[t];
      triangles[kept++] = triangles[t];
    }
    triangles.resize(kept);
    if (work_.bound > 0) work_.errors.resize(kept);
    return contractions;
  }

 private:
  static constexpr std::uint32_t kSeveral = kNone - 1;

  [[nodiscard]] const Vec3& at(std::uint32_t v) const { return work_.mesh.positions[v]; }
  [[nodiscard]] std::span<const std::uint32_t> triangles_of(std::size_t piece) const {
    return {order_.data() + starts_[piece], starts_[piece + 1] - starts_[piece]};
  }

  /// Which piece has all triangles of a vertex.
  void find_owners(const std::vector<std::uint32_t>& chosen) {
    owner_.assign(work_.mesh.positions.size(), kNone);
    std::size_t next = 0;
    for (std::uint32_t t = 0; chosen.size() < size_ && t < size_; ++t) {
      if (next < chosen.size() && chosen[next] == t) {
        ++next;
        continue;
      }
      for (const std::uint32_t v : work_.mesh.triangles[t]) owner_[v] = kSeveral;
    }
    for (std::uint32_t p = 0; p + 1 < starts_.size(); ++p) {
      for (const std::uint32_t t : triangles_of(p)) {
        for (const std::uint32_t v : work_.mesh.triangles[t])
          owner_[v] = owner_[v] == kNone || owner_[v] == p ? p : kSeveral;
      }
    }
  }

  void make_pieces() {
    tbb::parallel_for(std::size_t{0}, pieces_.size(), [&](std::size_t p) { make_piece(p); });
  }

  void make_piece(std::size_t p, double bound = 0) {
    std::vector<std::uint32_t>& number = numbers_.local();
    if (number.empty()) number.resize(owner_.size(), kNone);
    std::vector<std::uint32_t>& vertices = vertices_[p];
    Piece piece;
    piece.centre = work_.centre;
    piece.floats = work_.floats;
    piece.bound = bound;
    piece.triangles.reserve(triangles_of(p).size());
    for (const std::uint32_t t : triangles_of(p)) {
      Triangle local = work_.mesh.triangles[t];
      for (std::uint32_t& v : local) {
        if (number[v] == kNone) {
          number[v] = static_cast<std::uint32_t>(vertices.size());
          vertices.push_back(v);
        }
        v = number[v];
      }
      piece.triangles.push_back(local);
      if (work_.bound > 0) piece.errors.push_back(work_.errors[t]);
    }
    piece.positions.reserve(vertices.size());
    piece.quadrics.reserve(vertices.size());
    piece.fixed.reserve(vertices.size());
    for (const std::uint32_t v : vertices) {
      number[v] = kNone;
      piece.positions.push_back(at(v));
      piece.quadrics.push_back(work_.quadrics[v]);
      if (!work_.tried.empty()) piece.tried.push_back(work_.tried[v]);
      piece.fixed.push_back(owner_[v] == kSeveral || (!work_.locked.empty() && work_.locked[v] != 0) ? 1 : 0);
    }
    pieces_[p] = std::make_unique<Contractor>(std::move(piece));
  }

  /// One contraction after the other, the cheapest of all pieces.
  bool in_turn(std::uint64_t goal) {
    using Turn = std::pair<float, std::size_t>;
    std::priority_queue<Turn, std::vector<Turn>, std::greater<>> queue;
    tbb::parallel_for(std::size_t{0}, pieces_.size(), [&](std::size_t p) { pieces_[p]->expect_all(); });
    for (std::size_t p = 0; p < pieces_.size(); ++p) queue.emplace(pieces_[p]->next_cost(), p);
    while (size_ > goal && !queue.empty() && !std::isinf(queue.top().first)) {
      const std::size_t p = queue.top().second;
      queue.pop();
      Contractor& c = *pieces_[p];
      const float dearest = queue.empty() ? std::numeric_limits<float>::max() : queue.top().first;
      const std::uint64_t others = size_ - c.size();
      size_ -= c.run(dearest, goal > others ? goal - others : 0);
      queue.emplace(c.next_cost(), p);
    }
    return size_ <= goal;
  }

  void put_back(std::size_t p) {
    TriangleMesh& mesh = work_.mesh;
    const Contractor& c = *pieces_[p];
    const std::vector<std::uint32_t>& vertices = vertices_[p];
    for (const Merge& merge : c.merges()) {
      const std::uint32_t u = vertices[merge.u], v = vertices[merge.v];
      if (!mesh.normals.empty()) {
        const double s = static_cast<double>(merge.share);
        const Vec3 mixed = (1 - s) * to_double(mesh.normals[u]) + s * to_double(mesh.normals[v]);
        if (norm(mixed) > 0) mesh.normals[u] = to_float(unit(mixed));
      }
      for (auto& values : mesh.attributes) values[u] += merge.share * (values[v] - values[u]);
    }
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      if (c.piece().fixed[v] != 0) continue;
      mesh.positions[vertices[v]] = c.piece().positions[v];
      work_.quadrics[vertices[v]] = c.piece().quadrics[v];
      if (work_.bound > 0) work_.tried[vertices[v]] = 1;
    }
    const auto where = triangles_of(p);
    if (work_.bound > 0) {
      const std::vector<Errors> errors = c.errors();
      for (std::size_t t = 0; t < where.size(); ++t) work_.errors[where[t]] = errors[t];
    }
    for (std::size_t t = 0; t < where.size(); ++t) {
      const Triangle& local = c.stars().triangles()[t];
      mesh.triangles[where[t]] = local[0] == kNone
                                     ? Triangle{kNone, kNone, kNone}
                                     : Triangle{vertices[local[0]], vertices[local[1]], vertices[local[2]]};
    }
  }

  WorkMesh& work_;
  std::uint64_t size_;
  std::vector<std::size_t> starts_;                   ///< of the pieces in `order_`
  std::vector<std::uint32_t> order_;                  ///< triangles by piece
  std::vector<std::uint32_t> owner_;                  ///< of vertices, a piece or kSeveral
  std::vector<std::vector<std::uint32_t>> vertices_;  ///< of each piece
  std::vector<std::unique_ptr<Contractor>> pieces_;
  tbb::enumerable_thread_specific<std::vector<std::uint32_t>> numbers_;  ///< of vertices in a piece; kNone between
};

}  // namespace

std::uint64_t contract_to(WorkMesh& work, std::uint64_t wanted, const RunContext& run) {
  const auto times_wanted = [&](double factor) {
    return static_cast<std::uint64_t>(factor * static_cast<double>(wanted));
  };
  std::uint64_t contractions = 0;
  bool stuck = false;  // the round before this one found no edge that can go
  for (int number = 0; work.mesh.triangles.size() > wanted; ++number) {
    const std::uint64_t there = work.mesh.triangles.size();
    const bool last = stuck || there <= std::max<std::uint64_t>(times_wanted(kLastRound), kPieceTriangles);
    // A round before the last ends a little above its goal, and has to end where the last one begins.
    const std::uint64_t goal = last ? wanted
                                    : std::max(times_wanted(kLastRound / kInTurn) - 1,
                                               static_cast<std::uint64_t>(kRoundShrinks * static_cast<double>(there)));
    Round round(work, share_of_round(number));
    const bool reached = round.reduce(goal, last, run);
    contractions += round.finish();
    const bool whole = there <= kPieceTriangles;  // nothing was held fast
    if (last && (whole || (stuck && work.mesh.triangles.size() == there))) break;
    const auto gone = static_cast<double>(there - work.mesh.triangles.size());
    if (!work.locked.empty() && !reached && gone < kHardlyAny * static_cast<double>(there)) break;
    stuck = work.mesh.triangles.size() == there;
  }
  return contractions;
}

std::uint64_t contract_below(WorkMesh& work, float limit, const RunContext& run) {
  Round round(work, share_of_round(0));
  round.reduce_below(limit, run);
  return round.finish();
}

std::size_t pieces_of(const WorkMesh& work) {
  return work.mesh.triangles.size() / kPieceTriangles + 1;
}

CostCurve sample_costs(WorkMesh& work, std::size_t stride) {
  return Round(work, share_of_round(0)).costs(stride);
}

namespace {

/// A bound of many edges is approached in steps: each has a mesh of fewer triangles to ask and to prove. The last is
/// the bound itself; one larger than the mesh needs no more steps than its size.
std::vector<double> steps_to_bound(const WorkMesh& work) {
  std::vector<double> lengths;
  lengths.reserve(work.mesh.triangles.size());
  double farthest = 0;
  for (const Triangle& t : work.mesh.triangles) {
    const Vec3& a = work.mesh.positions[t[0]];
    lengths.push_back(norm(work.mesh.positions[t[1]] - a));
    farthest = std::max(farthest, norm(a - work.centre));
  }
  std::vector<double> steps{work.bound};
  if (lengths.empty()) return steps;
  const auto median = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), median, lengths.end());
  const double least = kFirstBound * *median;
  for (double next = std::min(work.bound, farthest) / kBoundGrows; least > 0 && next >= least; next /= kBoundGrows)
    steps.push_back(next);
  std::reverse(steps.begin(), steps.end());
  return steps;
}

}  // namespace

std::uint64_t contract_within(WorkMesh& work, const RunContext& run) {
  if (work.errors.empty()) work.errors.assign(work.mesh.triangles.size(), {});
  if (work.tried.empty()) work.tried.assign(work.mesh.positions.size(), 0);
  const std::vector<std::uint8_t> tried = work.tried;
  std::uint64_t contractions = 0;
  int number = 0;
  for (const double step : steps_to_bound(work)) {
    work.tried = tried;
    for (int more = step < work.bound ? 1 : kBoundRounds; more > 0; --more) {
      const std::size_t there = work.mesh.triangles.size();
      Round round(work, share_of_round(number++));
      round.exhaust(step, run);
      contractions += round.finish();
      const std::size_t gone = there - work.mesh.triangles.size();
      if (there <= kPieceTriangles || gone < there / 200) break;
    }
  }
  return contractions;
}

}  // namespace lamina::simplify
