// The values of a stream: floats, or integers packed without gaps, the lowest bit first.
#pragma once
#include <cstddef>
#include <cstdint>

#include "e57/contents.h"

namespace lamina::e57 {

/// How many bytes behind a stream's last may be read.
inline constexpr std::size_t kUnpackSlack = 16;

/// `count` values of a field, scaled, from those bytes on, where the first begins at bit `bit` (0 to 7).
template <class Out>
void unpack(const Field& field, const std::byte* bytes, unsigned bit, std::size_t count, Out* out);

extern template void unpack(const Field&, const std::byte*, unsigned, std::size_t, float*);
extern template void unpack(const Field&, const std::byte*, unsigned, std::size_t, double*);

}  // namespace lamina::e57
