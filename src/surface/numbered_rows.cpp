#include "surface/numbered_rows.h"

#include <fmt/format.h>

#include <cmath>

namespace lamina {
namespace {

void replace_unusable_normals(SampleBatch& b) {
  for (std::size_t i = 0; i < b.size(); ++i) {
    const float square = b.nx[i] * b.nx[i] + b.ny[i] * b.ny[i] + b.nz[i] * b.nz[i];
    if (std::isfinite(square) && square > 1e-20F) continue;
    b.nx[i] = b.ny[i] = 0;
    b.nz[i] = 1;
  }
}

}  // namespace

NumberedRows::NumberedRows(PointSource& source) : source_(source) {
  info_.path = source.info().path;
  info_.count = source.info().count;
  info_.random_access = source.info().random_access;
  info_.has_normals = true;
  for (std::size_t d = 0; d < kDigits; ++d) info_.attributes.push_back({fmt::format("row{}", d), ScalarType::uint16});
}

void NumberedRows::read(std::uint64_t first, std::size_t count, SampleBatch& out) {
  source_.read(first, count, out);
  const std::size_t n = out.size();
  if (source_.info().has_normals) {
    replace_unusable_normals(out);
  } else {
    out.nx.assign(n, 0);
    out.ny.assign(n, 0);
    out.nz.assign(n, 1);
  }
  out.radius.clear();
  out.quality.clear();
  out.exact.clear();
  out.attributes.resize(kDigits);
  for (std::size_t d = 0; d < kDigits; ++d) {
    out.attributes[d].resize(n);
    for (std::size_t i = 0; i < n; ++i) out.attributes[d][i] = static_cast<float>(((first + i) >> (16 * d)) & 0xFFFFU);
  }
}

std::uint64_t row_of(const std::vector<std::vector<float>>& attributes, std::size_t i) {
  std::uint64_t row = 0;
  for (std::size_t d = 0; d < NumberedRows::kDigits; ++d)
    row |= static_cast<std::uint64_t>(attributes[d][i]) << (16 * d);
  return row;
}

}  // namespace lamina
