#include <algorithm>

#include "ranks/ranks.h"

namespace lamina::ranks {

std::vector<std::size_t> message_lengths(std::size_t bytes, std::size_t most) {
  std::vector<std::size_t> lengths;
  for (; bytes > 0; bytes -= lengths.back()) lengths.push_back(std::min(bytes, most));
  return lengths;
}

}  // namespace lamina::ranks
