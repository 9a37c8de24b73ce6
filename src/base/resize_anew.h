// Storage that is used again and again for slabs of ever other sizes.
#pragma once
#include <cstddef>
#include <vector>

namespace lamina {

/// Sizes a vector whose contents are about to be written anew (they are unspecified afterwards). Grows by a sixteenth
/// at most and copies nothing, where resize() doubles and copies.
template <typename T>
void resize_anew(std::vector<T>& values, std::size_t size) {
  if (size > values.capacity()) {
    values = {};
    values.reserve(size + size / 16);
  }
  values.resize(size);
}

}  // namespace lamina
