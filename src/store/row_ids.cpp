#include "store/row_ids.h"

#include <fmt/format.h>

#include <cmath>

#include "store/input_survey.h"

namespace lamina {
namespace {

constexpr std::size_t kDigits = RowIdSource::kDigits;
constexpr std::uint64_t kGiven = 1ULL << 47;  ///< no file has so many rows

bool is_usable(float x, float y, float z) {
  const double squared = double{x} * double{x} + double{y} * double{y} + double{z} * double{z};
  return std::isfinite(squared) && squared >= kLeastNormalSquared;
}

std::uint64_t id_of(const LocalSamples& samples, std::size_t i) {
  std::uint64_t id = 0;
  for (std::size_t d = 0; d < kDigits; ++d) id |= static_cast<std::uint64_t>(samples.attributes[d][i]) << (16 * d);
  return id;
}

}  // namespace

RowIdSource::RowIdSource(PointSource& source, bool with_normals)
    : source_(source), with_normals_(with_normals && source.info().has_normals) {
  info_.path = source.info().path;
  info_.count = source.info().count;
  info_.random_access = source.info().random_access;
  info_.has_normals = true;
  for (std::size_t d = 0; d < kDigits; ++d) info_.attributes.push_back({fmt::format("row{}", d), ScalarType::uint16});
}

void RowIdSource::read(std::uint64_t first, std::size_t count, SampleBatch& out) {
  source_.read(first, count, out);
  const std::size_t n = out.size();
  if (!with_normals_) {
    out.nx.assign(n, 0);
    out.ny.assign(n, 0);
    out.nz.assign(n, 0);
  }
  out.radius.clear();
  out.quality.clear();
  out.exact.clear();
  out.attributes.resize(kDigits);
  for (auto& digits : out.attributes) digits.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    std::uint64_t id = first + i;
    if (is_usable(out.nx[i], out.ny[i], out.nz[i])) {
      id |= kGiven;
    } else {
      out.nx[i] = 0;
      out.ny[i] = 0;
      out.nz[i] = 1;
    }
    for (std::size_t d = 0; d < kDigits; ++d) out.attributes[d][i] = static_cast<float>((id >> (16 * d)) & 0xFFFFU);
  }
}

std::uint64_t row_of(const LocalSamples& samples, std::size_t i) {
  return id_of(samples, i) & ~kGiven;
}

bool has_given_normal(const LocalSamples& samples, std::size_t i) {
  return (id_of(samples, i) & kGiven) != 0;
}

}  // namespace lamina
