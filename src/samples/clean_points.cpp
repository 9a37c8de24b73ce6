#include "lamina/clean.h"

#include <mutex>
#include <utility>

#include "base/descriptor.h"
#include "base/run.h"
#include "edit/batch_pipe.h"
#include "lamina/error.h"
#include "samples/cleaning.h"
#include "store/ingest.h"
#include "store/input_survey.h"
#include "store/row_ids.h"

namespace lamina {
namespace {

/// Which rows do not stay, found by the steps that look around.
std::vector<bool> rows_to_drop(PointSource& source, const CleanSettings& settings, BadSamples bad, CleanCounts& counts,
                               const RunContext& run) {
  const std::string directory = run.tmp_dir.empty() ? system_tmp_dir() : run.tmp_dir;
  // Measured: the store's buffers, the samples looked at together and the program; masks and the store's index.
  constexpr std::uint64_t kProgram = std::uint64_t{92} << 20;
  const std::uint64_t masks = source.info().count + source.info().count / 4;
  require_memory(run, kProgram + masks, source.info().path, "cleaning");
  RunContext silent = run;  // what is left out is told by whoever writes the rows
  silent.log = nullptr;
  RowIdSource rows(source);
  const Survey survey = survey_input(rows, bad, silent, settings.pick);
  const Frame frame = choose_frame(survey, FrameMode::pca);
  const Ingested in = ingest(rows, survey, frame, directory, run, {1, settings.pick});
  const KeepMasks keep = choose_samples(in.store, {settings, frame.step, directory}, counts, run);
  std::vector<bool> drop(source.info().count, false);
  LocalSamples samples;
  for (std::size_t b = 0; b < keep.size(); ++b) {
    if (in.store.count(b) == 0) continue;
    in.store.read(b, samples);
    for (std::size_t i = 0; i < keep[b].size(); ++i) {
      if (!keep[b][i]) drop[row_of(samples, i)] = true;
    }
  }
  return drop;
}

}  // namespace

CleanReport clean_points(PointSource& source, PointsWriter& writer, const CleanSettings& settings, BadSamples bad,
                         const RunContext& run) {
  require_sane(settings);
  CleanReport report;
  std::vector<bool> drop;
  if (settings.looks_around()) {
    with_threads(run.threads, [&] { drop = rows_to_drop(source, settings, bad, report.counts, run); });
  }
  std::mutex mutex;
  CleanCounts picked;
  const auto work = [&](SampleBatch& batch) {
    CleanCounts counts;
    std::vector<std::uint8_t> stays(batch.size());
    for (std::size_t i = 0; i < batch.size(); ++i) {
      const std::uint64_t row = batch.first + i;
      const Pick pick = judge(settings.pick, batch, i, row);
      counts.skipped += pick == Pick::skipped ? 1 : 0;
      counts.clipped += pick == Pick::clipped ? 1 : 0;
      stays[i] = pick == Pick::taken && (drop.empty() || !drop[row]) ? 1 : 0;
    }
    const EditReport rows = clean_rows(batch, std::move(stays));
    if (rows.bad_rows > 0 && bad == BadSamples::refuse) refuse_bad_row(rows, source.info().path);
    const std::lock_guard lock(mutex);
    add(report.rows, rows);
    picked.clipped += counts.clipped;
    picked.skipped += counts.skipped;
  };
  edit::for_each_batch(source, "write", run, work, [&](SampleBatch& batch) { writer.append(batch); });
  report.counts.clipped = picked.clipped;
  report.counts.skipped = picked.skipped;
  report.rows.written = writer.rows();
  return report;
}

}  // namespace lamina
