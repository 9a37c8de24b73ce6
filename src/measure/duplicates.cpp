#include "measure/duplicates.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "measure/edge_table.h"

namespace lamina::measure {
namespace {

/// Table of slots for n entries: a power of two at least twice n, entry 0 free.
std::size_t table_size(std::size_t n) {
  return std::bit_ceil(std::max<std::size_t>(16, 2 * n));
}

std::uint64_t mix(std::uint64_t h, std::uint64_t v) {
  h = (h ^ v) * 0x9E3779B97F4A7C15ull;
  return h ^ (h >> 29);
}

/// Counts entries equal to an earlier one by open addressing; `hash(i)`, `equal(i, j)`.
template <class Hash, class Equal>
class DuplicateCounter {
 public:
  DuplicateCounter(std::size_t n, Hash hash, Equal equal) : slots_(table_size(n)), hash_(hash), equal_(equal) {}
  void add(std::uint32_t i) {
    const std::size_t mask = slots_.size() - 1;
    for (std::size_t s = hash_(i) & mask;; s = (s + 1) & mask) {
      if (slots_[s] == 0) {
        slots_[s] = i + 1;
        return;
      }
      if (equal_(slots_[s] - 1, i)) {
        ++count;
        return;
      }
    }
  }
  std::uint64_t count = 0;

 private:
  std::vector<std::uint32_t> slots_;  ///< index + 1
  Hash hash_;
  Equal equal_;
};

}  // namespace

std::uint64_t count_duplicate_vertices(const TriangleMesh& mesh) {
  const auto& p = mesh.positions;
  const auto hash = [&](std::uint32_t i) {
    std::uint64_t h = 0;
    for (const double c : p[i]) h = mix(h, std::bit_cast<std::uint64_t>(c + 0.0));  // -0 becomes 0
    return h;
  };
  const auto is_nan = [&](std::uint32_t i) {
    return std::any_of(p[i].begin(), p[i].end(), [](double c) { return std::isnan(c); });
  };
  DuplicateCounter counter(p.size(), hash, [&](std::uint32_t a, std::uint32_t b) { return p[a] == p[b]; });
  for (std::uint32_t i = 0; i < p.size(); ++i)
    if (!is_nan(i)) counter.add(i);
  return counter.count;
}

std::uint64_t count_duplicate_triangles(const TriangleMesh& mesh) {
  const auto sorted = [&](std::uint32_t i) {
    auto t = mesh.triangles[i];
    std::sort(t.begin(), t.end());
    return t;
  };
  const auto hash = [&](std::uint32_t i) {
    std::uint64_t h = 0;
    for (const auto v : sorted(i)) h = mix(h, v + 1u);
    return h;
  };
  DuplicateCounter counter(mesh.triangles.size(), hash,
                           [&](std::uint32_t a, std::uint32_t b) { return sorted(a) == sorted(b); });
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i)
    if (!repeats_index(mesh.triangles[i])) counter.add(i);
  return counter.count;
}

}  // namespace lamina::measure
