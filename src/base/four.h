// Four numbers at once, the same bits on every processor.
#pragma once
#include <smmintrin.h>

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

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
inline FourInts load_four(const std::uint32_t* from) {
  FourInts four;
  std::memcpy(&four, from, sizeof(four));
  return four;
}
/// The values with four numbers; what is no float becomes an int of 32 bits.
template <class T>
auto four_at(const std::vector<T>& values, const std::uint32_t* numbers) {
  using Four = std::conditional_t<std::is_same_v<T, float>, FourFloats, FourInts>;
  using One = std::conditional_t<std::is_same_v<T, float>, float, std::int32_t>;
  const auto value = [&](std::size_t lane) { return static_cast<One>(values[numbers[lane]]); };
  return Four{value(0), value(1), value(2), value(3)};
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
