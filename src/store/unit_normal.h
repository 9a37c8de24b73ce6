// Unit normals at rest: octahedral coordinates of 24 bits, as exact as the floats they come from.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lamina {

/// The two coordinates' high 16 bits, and both their low bytes together.
struct PackedNormals {
  std::vector<std::uint16_t> u, v, low;
  void resize(std::size_t n) {
    for (auto* values : {&u, &v, &low}) values->resize(n);
  }
};

/// Normals of any length but zero (which becomes +z). Axis-aligned ones come back exactly, others within 5e-7.
void pack_normals(const float* nx, const float* ny, const float* nz, std::size_t count, std::uint16_t* u,
                  std::uint16_t* v, std::uint16_t* low);

/// Unit normals.
void unpack_normals(const std::uint16_t* u, const std::uint16_t* v, const std::uint16_t* low, std::size_t count,
                    float* nx, float* ny, float* nz);

}  // namespace lamina
