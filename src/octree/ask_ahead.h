// Blocks lie anywhere in memory, and a stage that goes from one to the next would wait for its first look at each.
#pragma once
#include <cstddef>

#include "octree/corner_block.h"

namespace lamina {

/// Asks for an object that is looked at soon. Always inlined, as all here: the compiler takes a function that does
/// nothing else for one without effect.
template <typename T>
[[gnu::always_inline]] inline void ask_for(const T& object) {
  constexpr std::size_t kLine = 64;  // bytes
  const char* const bytes = reinterpret_cast<const char*>(&object);
  for (std::size_t at = 0; at < sizeof(object); at += kLine) __builtin_prefetch(bytes + at);
}

/// The parts of a block that a stage looks at.
template <auto... kMembers>
struct BlockParts {
  [[gnu::always_inline]] static inline void ask_for(const CornerBlock& block) {
    (lamina::ask_for(block.*kMembers), ...);
  }
};

/// Stages ask for the block of the tile that comes so many later: far enough ahead to be there in time, near enough not
/// to be lost again.
inline constexpr std::size_t kAskedAhead = 16;

}  // namespace lamina
