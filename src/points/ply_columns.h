// The hot loop of the binary reader: one column of rows of fixed size becomes one array.
#pragma once
#include <cstddef>

#include "lamina/attributes.h"

namespace lamina {

/// out[i] = the value of `type` at row + i * stride, for i < count. `swapped`: bytes stand in the other order than this
/// machine's.
template <class Out>
void convert_column(ScalarType type, bool swapped, const std::byte* row, std::size_t stride, std::size_t count,
                    Out* out);

extern template void convert_column(ScalarType, bool, const std::byte*, std::size_t, std::size_t, float*);
extern template void convert_column(ScalarType, bool, const std::byte*, std::size_t, std::size_t, double*);

/// One integer of `type` at `bytes`, for the lengths of lists.
long long read_integer(ScalarType type, bool swapped, const std::byte* bytes);

}  // namespace lamina
