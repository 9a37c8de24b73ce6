#include <fmt/format.h>

#include <cmath>

#include "lamina/clean.h"
#include "lamina/error.h"

namespace lamina {

void require_sane(const CleanSettings& s) {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw Error(ExitCode::usage, what);
  };
  if (s.pick.clip) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double low = s.pick.clip->low[k];
      const double high = s.pick.clip->high[k];
      if (!std::isfinite(low) || !std::isfinite(high) || low > high)
        throw Error(ExitCode::usage, fmt::format("--clip: the box ends at {} = {} before it begins at {}; the lower "
                                                 "corner comes first",
                                                 "xyz"[k], high, low));
    }
  }
  require(s.pick.every >= 1, "--every must be 1 or more");
  require(!s.merge || (*s.merge >= 0 && std::isfinite(*s.merge)), "--merge must be 0 (equal positions) or a length");
  require(s.sigma >= 0 && std::isfinite(s.sigma), "--outliers must be 0 (none) or a positive number of deviations");
  require(s.neighbours >= 1 && s.neighbours <= 256, "--neighbours must be in 1..256");
  require(s.spacing >= 0 && std::isfinite(s.spacing), "--spacing must be 0 (none) or a length");
}

std::string describe(const CleanCounts& c) {
  std::string text;
  const auto add = [&](std::uint64_t count, const std::string& what) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, what);
  };
  add(c.clipped, "outside the box");
  add(c.skipped, "skipped");
  add(c.merged, "duplicates merged");
  add(c.outliers, fmt::format("outliers (mean distance above {:.4g})", c.outlier_distance));
  add(c.thinned, "thinned out");
  return text;
}

}  // namespace lamina
