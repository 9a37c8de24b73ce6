#include "clustering/shape.h"

#include <bit>

namespace lamina::clustering {
namespace {

constexpr std::size_t kDirections = 6;
using Adjacency = std::array<unsigned, kDirections>;

Adjacency unpack(unsigned edges) {
  Adjacency out{};
  unsigned bit = 1;
  for (std::size_t a = 0; a < kDirections; ++a) {
    for (std::size_t b = a + 1; b < kDirections; ++b, bit <<= 1) {
      if ((edges & bit) == 0) continue;
      out[a] |= 1U << b;
      out[b] |= 1U << a;
    }
  }
  return out;
}

/// The component of `seed` within `set`.
unsigned flood(const Adjacency& adjacency, unsigned set, unsigned seed) {
  unsigned reached = 0, front = seed;
  while (front != 0) {
    reached |= front;
    unsigned next = 0;
    for (unsigned f = front; f != 0; f &= f - 1) next |= adjacency[static_cast<std::size_t>(std::countr_zero(f))];
    front = next & set & ~reached;
  }
  return reached;
}

unsigned lowest(unsigned set) {
  return set & (0U - set);
}

}  // namespace

bool plain_shape(const CornerNote& note) {
  const unsigned members = note.members, idle = note.idle;
  const int count = std::popcount(members);
  if (count + note.inner_triangles != std::popcount(note.edges) + 1) return false;
  // With V - E + F = 1, up to three members are connected: a second component would need one that holds an open cycle.
  if (count <= 3 && idle == 0) return true;
  const Adjacency adjacency = unpack(note.edges);
  if (flood(adjacency, members, lowest(members)) != members) return false;
  for (unsigned left = idle != 0 ? members : 0; left != 0; left &= left - 1) {
    const unsigned rest = members & ~lowest(left);
    for (unsigned open = rest; open != 0;) {
      const unsigned component = flood(adjacency, rest, lowest(open));
      if ((component & ~idle) == 0) return false;
      open &= ~component;
    }
  }
  return true;
}

}  // namespace lamina::clustering
