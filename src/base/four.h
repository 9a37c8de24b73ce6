// Four numbers at once, the same bits on every processor.
#pragma once
#include <smmintrin.h>

#include <bit>
#include <cstdint>
#include <cstring>

namespace lamina {

typedef std::int32_t FourInts __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): attributes on typedefs
typedef float FourFloats __attribute__((vector_size(16)));       // NOLINT(modernize-use-using): attributes on typedefs

inline FourInts four_times(std::int32_t v) {
  return FourInts{v, v, v, v};
}
inline FourInts load_four(const std::int32_t* from) {
  FourInts four;
  std::memcpy(&four, from, sizeof(four));
  return four;
}
inline FourFloats to_floats(const FourInts& v) {
  return __builtin_convertvector(v, FourFloats);
}
inline FourFloats floor_of(const FourFloats& v) {
  return std::bit_cast<FourFloats>(_mm_floor_ps(std::bit_cast<__m128>(v)));
}
/// To the nearest whole numbers, of two as near to the even one.
inline FourInts rounded(const FourFloats& v) {
  return std::bit_cast<FourInts>(_mm_cvtps_epi32(std::bit_cast<__m128>(v)));
}
/// A bit for each of the four that a comparison holds for.
inline unsigned bits_of(const FourInts& mask) {
  return static_cast<unsigned>(_mm_movemask_ps(std::bit_cast<__m128>(mask)));
}
/// Where a comparison holds, else 0.
inline FourFloats where(const FourInts& mask, const FourFloats& v) {
  return std::bit_cast<FourFloats>(mask & std::bit_cast<FourInts>(v));
}
inline float sum_of(const FourFloats& v) {
  return (v[0] + v[1]) + (v[2] + v[3]);
}

}  // namespace lamina
