#include "lamina/point_radii.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <vector>

#include "base/descriptor.h"
#include "base/run.h"
#include "edit/rows.h"
#include "lamina/error.h"
#include "reconstruct/plan.h"
#include "store/ingest.h"

namespace lamina {
namespace {

constexpr std::size_t kPiece = std::size_t{1} << 15;  ///< rows written at a time

/// Counts of radii by size, a hundredth of an octave wide.
class Distribution {
 public:
  void add(float radius) {
    const double place = (std::log2(static_cast<double>(radius)) + kOctaves) * kPerOctave;
    ++bins_.at(static_cast<std::size_t>(std::clamp(place, 0.0, static_cast<double>(bins_.size() - 1))));
    ++total_;
  }
  [[nodiscard]] double quantile(double share) const {
    const auto wanted = static_cast<std::uint64_t>(share * static_cast<double>(total_));
    std::uint64_t seen = 0;
    for (std::size_t b = 0; b < bins_.size(); ++b) {
      seen += bins_[b];
      if (seen > wanted) return std::exp2((static_cast<double>(b) + 0.5) / kPerOctave - kOctaves);
    }
    return 0;
  }

 private:
  static constexpr int kOctaves = 140, kPerOctave = 100;
  std::vector<std::uint64_t> bins_ = std::vector<std::uint64_t>(2 * kOctaves * kPerOctave);
  std::uint64_t total_ = 0;
};

void require_sane(const PointRadiiSettings& s, const PointsWriter& writer) {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw Error(ExitCode::usage, what);
  };
  require(s.density >= 2 && s.density <= 4096, "--density must be in 2..4096");
  require(s.particlescale > 0 && s.particlescale <= 1000, "--particlescale must be in (0, 1000]");
  require(s.minradius >= 0 && std::isfinite(s.minradius), "--minradius must be 0 or more");
  require(s.maxradius >= 0 && std::isfinite(s.maxradius), "--maxradius must be 0 (no limit) or more");
  require(s.maxradius == 0 || s.maxradius >= s.minradius, "--maxradius must not be smaller than --minradius");
  require(!writer.columns().radius.empty(), "radius: the file to write has no column for it");
}

/// Radii (steps) of the store's samples, sorted by row.
void estimate(const SlabStore& store, const RadiiSettings& settings, edit::RecordSorter& by_row,
              const RunContext& run) {
  RadiusEstimator estimator(settings);
  LocalSamples samples;
  std::vector<float> radii;
  std::deque<std::vector<std::uint64_t>> waiting;  // rows of the buckets pushed and not popped
  const auto pop_all = [&] {
    while (!waiting.empty() && estimator.pop(radii)) {
      by_row.add(waiting.front(), reinterpret_cast<const std::byte*>(radii.data()));
      waiting.pop_front();
    }
  };
  for (std::size_t b = 0; b < store.buckets(); ++b) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    store.read(b, samples);
    std::vector<std::uint64_t>& rows = waiting.emplace_back(samples.size());
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = row_of(samples, i);
    estimator.push(samples);
    pop_all();
    if (run.progress) run.progress({"radii", by_row.size(), store.total(), 0, 0});
  }
  estimator.finish();
  pop_all();
}

/// Copies the source's rows with their radii, which come by ascending row.
class RadiusWriter {
 public:
  RadiusWriter(PointSource& source, PointsWriter& writer, const PointRadiiSettings& settings, double scale,
               PointRadiiReport& report, const RunContext& run)
      : source_(source), writer_(writer), settings_(settings), scale_(scale), report_(report), run_(run) {}

  void take(std::span<const std::uint64_t> rows, const float* steps) {
    for (std::size_t i = 0; i < rows.size();) {
      const std::size_t piece = begin_piece();
      for (; i < rows.size() && rows[i] < next_ + piece; ++i) batch_.radius[rows[i] - next_] = world_radius(steps[i]);
      // Radii of the piece's later rows may still come.
      const std::uint64_t end = i == rows.size() ? rows.back() + 1 : next_ + piece;
      end_piece(end);
    }
  }
  /// After the last radius: rows that got none.
  void finish() {
    while (next_ < source_.info().count) end_piece(next_ + begin_piece());
    report_.low = distribution_.quantile(0.01);
    report_.median = distribution_.quantile(0.5);
    report_.high = distribution_.quantile(0.99);
    report_.rows.written = writer_.rows();
  }

 private:
  /// Rows that get no radius must not be written, and what is not finite is not.
  std::size_t begin_piece() {
    const auto piece = static_cast<std::size_t>(std::min<std::uint64_t>(kPiece, source_.info().count - next_));
    batch_.radius.assign(piece, std::numeric_limits<float>::quiet_NaN());
    return piece;
  }
  void end_piece(std::uint64_t end) {
    if (run_.cancelled()) throw Error(ExitCode::internal, "cancelled");
    std::vector<float> radii = std::move(batch_.radius);
    radii.resize(static_cast<std::size_t>(end - next_));
    source_.read(next_, radii.size(), batch_);
    batch_.radius = std::move(radii);
    next_ = end;
    const EditReport part = clean_rows(batch_);
    if (part.bad_rows > 0 && settings_.bad_samples == BadSamples::refuse) refuse_bad_row(part, source_.info().path);
    add(report_.rows, part);
    writer_.append(batch_);
    if (run_.progress) run_.progress({"write", next_, source_.info().count, 0, 0});
  }

  float world_radius(float steps) {
    double r = steps * scale_;
    if (r < settings_.minradius) {
      r = settings_.minradius;
      ++report_.raised;
    } else if (settings_.maxradius > 0 && r > settings_.maxradius) {
      r = settings_.maxradius;
      ++report_.lowered;
    }
    const auto radius = static_cast<float>(
        std::clamp(r, double{std::numeric_limits<float>::min()}, double{std::numeric_limits<float>::max()}));
    distribution_.add(radius);
    return radius;
  }

  PointSource& source_;
  PointsWriter& writer_;
  PointRadiiSettings settings_;
  double scale_;
  PointRadiiReport& report_;
  const RunContext& run_;
  std::uint64_t next_ = 0;  ///< row
  SampleBatch batch_;
  Distribution distribution_;
};

PointRadiiReport write_radii(PointSource& source, PointsWriter& writer, const PointRadiiSettings& settings,
                             const RunContext& run) {
  const std::string directory = run.tmp_dir.empty() ? system_tmp_dir() : run.tmp_dir;
  const std::size_t memory = run.max_memory > 0 ? std::min(settings.memory, run.max_memory / 4) : settings.memory;
  constexpr std::uint64_t kProgram = std::uint64_t{80} << 20;  // measured: the store's buffers, the window, the program
  constexpr std::uint64_t kRecord = sizeof(float) + 12;
  const std::uint64_t records = std::min<std::uint64_t>(memory, source.info().count * kRecord);
  require_memory(run, kProgram + records, source.info().path, "finding radii");
  RunContext silent = run;  // what is left out is told by whoever writes the rows
  silent.log = nullptr;
  RowIdSource positions(source);
  const Survey survey = survey_input(positions, settings.bad_samples, silent);
  const Frame frame = choose_frame(survey, FrameMode::pca);
  StoredCloud cloud{positions.info(), frame, ingest(positions, survey, frame, directory, run)};
  cloud.info.has_radius = false;
  const SlabStore& store = cloud.ingested.store;
  SurfaceSettings as_reconstructed;
  as_reconstructed.input = source.info().path;
  as_reconstructed.density = settings.density;
  const RadiusSurvey surveyed = survey_radii(store, kSurveySamples, settings.density);
  const ReconstructionPlan plan = make_plan(as_reconstructed, cloud, {surveyed, is_noisy(surveyed, {}), {}});

  const std::uint64_t whole = store.total() * kRecord;
  edit::RecordSorter by_row(sizeof(float), static_cast<std::size_t>(std::min<std::uint64_t>(memory, whole)), directory);
  estimate(store, plan.radii, by_row, run);

  PointRadiiReport report;
  RadiusWriter out(source, writer, settings, frame.step * settings.particlescale, report, run);
  by_row.drain(kPiece, [&](std::span<const std::uint64_t> rows, const std::byte* radii) {
    out.take(rows, reinterpret_cast<const float*>(radii));
  });
  out.finish();
  return report;
}

}  // namespace

PointRadiiReport write_point_radii(PointSource& source, PointsWriter& writer, const PointRadiiSettings& settings,
                                   const RunContext& run) {
  require_sane(settings, writer);
  PointRadiiReport report;
  with_threads(run.threads, [&] { report = write_radii(source, writer, settings, run); });
  return report;
}

}  // namespace lamina
