#include "edit/batch_pipe.h"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <memory>

#include "base/run.h"
#include "lamina/error.h"

namespace lamina::edit {
namespace {

constexpr std::size_t kRows = 1u << 15;
constexpr std::size_t kInFlight = 8;

}  // namespace

void for_each_batch(PointSource& source, std::string_view stage, const RunContext& run,
                    const std::function<void(SampleBatch&)>& work, const std::function<void(SampleBatch&)>& take) {
  const PointSourceInfo& info = source.info();
  using Piece = std::shared_ptr<SampleBatch>;
  std::uint64_t next = 0;
  const auto begin = [&](tbb::flow_control& flow) -> Piece {
    if (next >= info.count || run.cancelled()) {
      flow.stop();
      return nullptr;
    }
    auto piece = std::make_shared<SampleBatch>();
    piece->first = next;
    if (!info.random_access) source.read(next, kRows, *piece);
    next += kRows;
    return piece;
  };
  const auto middle = [&](const Piece& piece) {
    if (info.random_access) source.read(piece->first, kRows, *piece);
    work(*piece);
    return piece;
  };
  const auto end = [&](const Piece& piece) {
    const std::uint64_t done = std::min(piece->first + kRows, info.count);
    take(*piece);
    if (run.progress) run.progress({stage, done, info.count, 0, 0});
  };
  with_threads(run.threads, [&] {
    tbb::parallel_pipeline(kInFlight, tbb::make_filter<void, Piece>(tbb::filter_mode::serial_in_order, begin) &
                                          tbb::make_filter<Piece, Piece>(tbb::filter_mode::parallel, middle) &
                                          tbb::make_filter<Piece, void>(tbb::filter_mode::serial_in_order, end));
  });
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
}

}  // namespace lamina::edit
