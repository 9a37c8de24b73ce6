#include "normals/row_normals.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "base/spill_file.h"
#include "lamina/error.h"
#include "points/formats.h"

namespace lamina::normals {
namespace {

constexpr std::size_t kRowsAtOnce = std::size_t{1} << 15;

class WithRowNormals final : public WithNormals {
 public:
  WithRowNormals(std::unique_ptr<PointSource> source, std::unique_ptr<RowNormals> normals)
      : WithNormals(std::move(source)), normals_(std::move(normals)) {}

 private:
  void give_normals(SampleBatch& rows) const override { normals_->apply(rows); }

  std::unique_ptr<RowNormals> normals_;
};

}  // namespace

RowNormals::RowNormals(RowRecords& records, const PatchSigns& signs, std::uint64_t rows, const std::string& directory,
                       const RunContext& run) {
  if (records.on_disk()) {
    file_.emplace(directory);
    write_file(records, signs, rows, run);
  } else {
    by_row_ = records.take();
    apply_signs(by_row_, signs);
  }
}

void RowNormals::write_file(RowRecords& records, const PatchSigns& signs, std::uint64_t rows, const RunContext& run) {
  BackgroundWriter writer(SpillFile::kBufferBytes, 4);
  std::vector<NormalCode> codes;
  std::uint64_t next = 0;
  const auto write = [&] {
    file_->append(std::as_bytes(std::span(codes)), writer);
    next += codes.size();
    codes.clear();
  };
  const auto skip_to = [&](std::uint64_t row) {
    while (next + codes.size() < row) {
      codes.push_back(kKeep);
      if (codes.size() == kRowsAtOnce) write();
    }
  };
  records.drain(kRowsAtOnce, [&](std::span<const std::uint64_t> keys, std::span<RowRecord> batch) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    apply_signs(batch, signs);
    for (std::size_t i = 0; i < keys.size(); ++i) {
      skip_to(keys[i]);
      codes.push_back(batch[i].code);
      if (codes.size() == kRowsAtOnce) write();
    }
    if (run.progress) run.progress({"signs", next, rows, 0, 0});
  });
  skip_to(rows);
  write();
  file_->flush(writer);
  file_->check(writer.drain());
}

void RowNormals::codes_of(std::uint64_t first, std::span<NormalCode> codes) const {
  if (file_) {
    if (!codes.empty()) file_->read(first * sizeof(NormalCode), std::as_writable_bytes(codes));
    return;
  }
  for (std::size_t i = 0; i < codes.size(); ++i) codes[i] = by_row_.empty() ? kKeep : by_row_[first + i].code;
}

void RowNormals::apply(SampleBatch& batch) const {
  const std::size_t n = batch.size();
  std::vector<NormalCode> codes(n);
  codes_of(batch.first, codes);
  std::array<std::vector<float>, 3> found{std::vector<float>(n), std::vector<float>(n), std::vector<float>(n)};
  unpack_codes(codes, {found[0].data(), found[1].data(), found[2].data()});
  const bool has = !batch.nx.empty();
  for (std::size_t i = 0; i < n; ++i) {
    const bool own = codes[i] == kKeep || codes[i] == kTurn;
    if (!own && codes[i] != kNoNormal) continue;
    std::array<float, 3> normal{};
    if (own && has) {
      normal = {batch.nx[i], batch.ny[i], batch.nz[i]};
      const bool finite = std::isfinite(normal[0]) && std::isfinite(normal[1]) && std::isfinite(normal[2]);
      if (!finite) normal = {};
      if (codes[i] == kTurn) normal = {-normal[0], -normal[1], -normal[2]};
    }
    for (std::size_t a = 0; a < 3; ++a) found[a][i] = normal[a];
  }
  batch.nx.swap(found[0]);
  batch.ny.swap(found[1]);
  batch.nz.swap(found[2]);
}

std::unique_ptr<PointSource> give_normals(std::unique_ptr<PointSource> source, std::unique_ptr<RowNormals> normals) {
  return std::make_unique<WithRowNormals>(std::move(source), std::move(normals));
}

namespace {

constexpr std::size_t kEnough = 3;   ///< of the four faces around a sample
constexpr double kGrazing = 0.17;    ///< cosine of 80 degrees
constexpr double kNearPlane = 0.5;   ///< of a face of the second ring: its slope out of the first ring's plane
constexpr double kSameFacing = 0.5;  ///< cosine between the two

}  // namespace

GridFaces::Face GridFaces::face(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) const {
  Face f;
  f.centre = (a + b + c) / 3;
  f.normal = (b - a).cross(c - a);
  const Eigen::Vector3d at(scanner_.at[0], scanner_.at[1], scanner_.at[2]);
  const Eigen::Vector3d sight = scanner_.direction ? at : Eigen::Vector3d(at - f.centre);
  const double cosine = f.normal.dot(sight) / (f.normal.norm() * sight.norm());
  // Not-a-number, of missing samples or of no area, is not more.
  if (!(std::abs(cosine) > kGrazing)) return {};
  if (cosine < 0) f.normal = -f.normal;
  return f;
}

GridFaces::Face GridFaces::quad(const GridLine& low, const GridLine& high, std::size_t at) const {
  const std::array corners{low[at], low[at + 1], high[at + 1], high[at]};
  std::size_t missing = 4;
  for (std::size_t k = 0; k < 4; ++k) {
    if (corners[k].allFinite()) continue;
    if (missing != 4) return {};
    missing = k;
  }
  const auto triangle = [&](std::size_t first) {
    return face(corners[first], corners[(first + 1) % 4], corners[(first + 2) % 4]);
  };
  if (missing != 4) return triangle((missing + 1) % 4);
  // Cut along the shorter diagonal; where one half is no face, the other is.
  const std::size_t cut = (corners[0] - corners[2]).squaredNorm() <= (corners[1] - corners[3]).squaredNorm() ? 0 : 1;
  const Face one = triangle(cut);
  const Face other = triangle(cut + 2);
  if (one.normal.isZero() || other.normal.isZero()) return one.normal.isZero() ? other : one;
  return {one.normal + other.normal, 0.5 * (one.centre + other.centre)};
}

void GridFaces::add(GridLine line) {
  if (!lines_.empty()) {
    std::vector<Face> strip(length_ > 0 ? length_ - 1 : 0);
    for (std::size_t at = 0; at < strip.size(); ++at) strip[at] = quad(lines_.back(), line, at);
    strips_.push_back(std::move(strip));
  }
  lines_.push_back(std::move(line));
  if (lines_.size() > 2 * kRing + 1) lines_.pop_front();
  if (strips_.size() > 2 * kRing) strips_.pop_front();
}

std::array<float, 3> GridFaces::normal_at(std::size_t at) const {
  const std::size_t line = lines_.size() - 1 - kRing;
  const Eigen::Vector3d& p = lines_[line][at];
  if (!p.allFinite()) return {};
  // Calls use(face) for those at most `ring` away: strips line - ring ... line + ring - 1, places likewise.
  const auto for_faces = [&](std::size_t ring, const auto& use) {
    for (std::size_t s = line >= ring ? line - ring : 0; s < line + ring && s < strips_.size(); ++s) {
      for (std::size_t f = at >= ring ? at - ring : 0; f < at + ring && f < strips_[s].size(); ++f) {
        if (!strips_[s][f].normal.isZero()) use(strips_[s][f]);
      }
    }
  };
  Eigen::Vector3d sum(0, 0, 0);
  std::size_t faces = 0;
  for_faces(1, [&](const Face& f) {
    sum += f.normal;
    ++faces;
  });
  // At rims faces lie on one side, and curved surfaces seen at a grazing angle lean away there.
  if (faces < kEnough || sum.isZero()) return {};
  const Eigen::Vector3d first = sum.normalized();
  sum.setZero();
  for_faces(kRing, [&](const Face& f) {
    const Eigen::Vector3d way = f.centre - p;
    const bool level = std::abs(way.dot(first)) <= kNearPlane * way.norm();
    if (level && f.normal.dot(first) > kSameFacing * f.normal.norm()) sum += f.normal;
  });
  const Eigen::Vector3d n = sum.isZero() ? first : Eigen::Vector3d(sum.normalized());
  return {static_cast<float>(n.x()), static_cast<float>(n.y()), static_cast<float>(n.z())};
}

std::vector<std::array<float, 3>> GridFaces::finished() const {
  if (lines_.size() <= kRing) return {};
  std::vector<std::array<float, 3>> normals(length_);
  for (std::size_t at = 0; at < length_; ++at) normals[at] = normal_at(at);
  return normals;
}

namespace {

using Normal = std::array<float, 3>;
constexpr std::size_t kPiece = std::size_t{1} << 15;  ///< rows

/// The source's rows with the normals of a file that holds one for each.
class WithGridNormals final : public WithNormals {
 public:
  WithGridNormals(std::unique_ptr<PointSource> source, SpillFile file)
      : WithNormals(std::move(source)), file_(std::move(file)) {}

 private:
  void give_normals(SampleBatch& out) const override {
    std::vector<Normal> normals(out.size());
    file_.read(out.first * sizeof(Normal), std::as_writable_bytes(std::span(normals)));
    for (auto* axis : {&out.nx, &out.ny, &out.nz}) axis->resize(out.size());
    for (std::size_t i = 0; i < normals.size(); ++i) {
      out.nx[i] = normals[i][0];
      out.ny[i] = normals[i][1];
      out.nz[i] = normals[i][2];
    }
  }

  SpillFile file_;
};

/// The source's rows one by one, in order.
class Rows {
 public:
  Rows(PointSource& source, const RunContext& run) : source_(source), run_(run) {}
  Eigen::Vector3d next() {
    if (at_ == batch_.size()) {
      if (run_.cancelled()) throw Error(ExitCode::internal, "cancelled");
      source_.read(row_, kPiece, batch_);
      at_ = 0;
      if (run_.progress) run_.progress({"grid normals", row_, source_.info().count, 0, 0});
      if (batch_.size() == 0) throw Error(ExitCode::internal, "grid normals: the source ends too early");
    }
    ++row_;
    const std::size_t i = at_++;
    return {batch_.x[i], batch_.y[i], batch_.z[i]};
  }
  [[nodiscard]] std::uint64_t row() const { return row_; }

 private:
  PointSource& source_;
  const RunContext& run_;
  SampleBatch batch_;
  std::size_t at_ = 0;
  std::uint64_t row_ = 0;
};

class GridJob {
 public:
  GridJob(PointSource& source, const std::string& directory, const RunContext& run)
      : rows_(source, run), file_(directory) {}

  void skip_to(std::uint64_t row) {
    for (; rows_.row() < row; rows_.next()) put({});
  }

  void take(const ScanGrid& grid, const Viewpoint& scanner) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    const auto length = static_cast<std::size_t>(grid.length());
    GridFaces faces(length, scanner);
    const std::uint64_t lines = grid.lines();
    for (std::uint64_t l = 0; l < lines + GridFaces::kRing; ++l) {
      GridLine line(length, {kNone, kNone, kNone});
      for (std::size_t at = 0; l < lines && at < length; ++at) {
        if (grid.has(l, at)) line[at] = rows_.next();
      }
      faces.add(std::move(line));
      if (l < GridFaces::kRing) continue;
      const std::vector<Normal> normals = faces.finished();
      for (std::size_t at = 0; at < length; ++at) {
        if (grid.has(l - GridFaces::kRing, at)) put(normals[at]);
      }
    }
  }

  SpillFile finish(std::uint64_t& found) {
    file_.flush();
    found = found_;
    return std::move(file_);
  }

 private:
  void put(const Normal& n) {
    file_.append(std::as_bytes(std::span(n)));
    if (n != Normal{}) ++found_;
  }

  Rows rows_;
  SpillFile file_;
  std::uint64_t found_ = 0;
};

const SeenFrom* scanner_of(const std::vector<SeenFrom>& seen, std::uint64_t row) {
  const auto after =
      std::upper_bound(seen.begin(), seen.end(), row, [](std::uint64_t r, const SeenFrom& s) { return r < s.first; });
  return after != seen.begin() && std::prev(after)->known ? &*std::prev(after) : nullptr;
}

}  // namespace

GridNormals grid_normals(std::unique_ptr<PointSource> source, const std::vector<PlacedGrid>& grids,
                         const std::vector<SeenFrom>& seen, const std::string& directory, const RunContext& run) {
  GridJob job(*source, directory, run);
  for (const PlacedGrid& placed : grids) {
    const SeenFrom* const from = scanner_of(seen, placed.first);
    if (from == nullptr) continue;
    job.skip_to(placed.first);
    job.take(*placed.grid, from->viewpoint);
  }
  job.skip_to(source->info().count);
  GridNormals out;
  SpillFile file = job.finish(out.found);
  out.source = std::make_unique<WithGridNormals>(std::move(source), std::move(file));
  return out;
}

}  // namespace lamina::normals
