#include "store/unit_normal.h"

#include <algorithm>
#include <cmath>

namespace lamina {
namespace {

// The octahedron |x| + |y| + |z| = 1 seen from above, its lower half folded over the edges of the upper one (Meyer,
// Suessmuth, Sussner, Stamminger and Greiner, "On floating-point normal vectors", 2010). Zero and one are on the grid.
constexpr float kScale = 8388606.0F;  // 2^23 - 2: integers up to here are floats, and its half is one
constexpr std::int32_t kMiddle = 1 << 23;

}  // namespace

void pack_normals(const float* nx, const float* ny, const float* nz, std::size_t count, std::uint16_t* u,
                  std::uint16_t* v, std::uint16_t* low) {
  for (std::size_t i = 0; i < count; ++i) {
    const float sum = std::abs(nx[i]) + std::abs(ny[i]) + std::abs(nz[i]);
    const float inverse = sum > 0 ? kScale / sum : 0.0F;
    const float x = nx[i] * inverse;
    const float y = ny[i] * inverse;
    const float folded_x = std::copysign(kScale - std::abs(y), x);
    const float folded_y = std::copysign(kScale - std::abs(x), y);
    const bool below = nz[i] < 0;
    const float a = below ? folded_x : x;
    const float b = below ? folded_y : y;
    // Rounded away from zero by truncation, which unlike a call to lrint() is vector code; at most one above the scale.
    const auto p =
        std::clamp(static_cast<std::int32_t>(a + std::copysign(0.5F, a)), 1 - kMiddle, kMiddle - 1) + kMiddle;
    const auto q =
        std::clamp(static_cast<std::int32_t>(b + std::copysign(0.5F, b)), 1 - kMiddle, kMiddle - 1) + kMiddle;
    u[i] = static_cast<std::uint16_t>(p >> 8);
    v[i] = static_cast<std::uint16_t>(q >> 8);
    low[i] = static_cast<std::uint16_t>((p & 0xFF) | (q & 0xFF) << 8);
  }
}

void unpack_normals(const std::uint16_t* u, const std::uint16_t* v, const std::uint16_t* low, std::size_t count,
                    float* nx, float* ny, float* nz) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::int32_t p = (std::int32_t{u[i]} << 8 | (low[i] & 0xFF)) - kMiddle;
    const std::int32_t q = (std::int32_t{v[i]} << 8 | low[i] >> 8) - kMiddle;
    float x = static_cast<float>(p);
    float y = static_cast<float>(q);
    // Sums of integers below 2^24: exact.
    const float z = kScale - std::abs(x) - std::abs(y);
    const float fold = std::max(-z, 0.0F);
    x -= std::copysign(fold, x);
    y -= std::copysign(fold, y);
    const float inverse = 1.0F / std::sqrt(x * x + y * y + z * z);
    nx[i] = x * inverse;
    ny[i] = y * inverse;
    nz[i] = z * inverse;
  }
}

}  // namespace lamina
