#include "surface_ranks.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "lamina/error.h"
#include "text.h"

namespace lamina::tools {

RanksStats run_ranks(const SurfaceSettings& settings, const PartsOptions& parts, const RunContext& context) {
  for (const auto& [given, option] :
       {std::pair{parts.chunked, "--chunk"}, std::pair{!parts.checkpoint.directory.empty(), "--checkpoint"}}) {
    if (given) {
      throw Error(ExitCode::usage,
                  fmt::format("{} and mpirun contradict each other: both share out the work; leave one away", option));
    }
  }
  return reconstruct_ranks(settings, context);
}

void report_ranks(const std::vector<RankStats>& ranks, const RunContext& context) {
  for (std::size_t r = 0; r < ranks.size(); ++r) {
    const RankStats& s = ranks[r];
    context.info(fmt::format(
        "rank {}: read {}, held {} samples; {} slabs and {} beside them; {:.1f} s ({:.1f} s sweeping, {:.1f} s "
        "waiting), {:.1f} s CPU, {:.0f} MB, {} sent",
        r, count_text(s.rows_read), count_text(s.samples_held), s.slabs, s.overlap_slabs, s.seconds, s.sweeping,
        s.waited, s.cpu, static_cast<double>(s.peak_memory) * 1e-6, bytes_text(s.sent)));
  }
}

nlohmann::ordered_json ranks_json(const std::vector<RankStats>& ranks) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const RankStats& s : ranks) {
    list.push_back({{"rows_read", s.rows_read},
                    {"samples", s.samples},
                    {"samples_held", s.samples_held},
                    {"first_slab", s.first_slab},
                    {"slabs", s.slabs},
                    {"overlap_slabs", s.overlap_slabs},
                    {"vertices", s.vertices},
                    {"triangles", s.triangles},
                    {"wall_seconds", s.seconds},
                    {"cpu_seconds", s.cpu},
                    {"sweep_seconds", s.sweeping},
                    {"waited_seconds", s.waited},
                    {"peak_memory_bytes", s.peak_memory},
                    {"sent_bytes", s.sent},
                    {"received_bytes", s.received}});
  }
  return list;
}

}  // namespace lamina::tools
