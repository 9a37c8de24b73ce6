#include "clustering/steps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace lamina::clustering {
namespace {

using Pair = std::pair<int, int>;

CornerNote note_of(const std::set<int>& members, const std::set<Pair>& edges, int triangles,
                   const std::set<int>& idle = {}) {
  CornerNote note;
  for (const int m : members) note.members |= static_cast<std::uint8_t>(1 << m);
  for (const int m : idle) note.idle |= static_cast<std::uint8_t>(1 << m);
  int bit = 0;
  for (int a = 0; a < 6; ++a) {
    for (int b = a + 1; b < 6; ++b, ++bit) {
      if (edges.contains({a, b})) note.edges |= static_cast<std::uint16_t>(1 << bit);
    }
  }
  note.inner_triangles = static_cast<std::uint8_t>(triangles);
  return note;
}

TEST(Shape, ContractibleComplexesPass) {
  EXPECT_TRUE(plain_shape(note_of({3}, {}, 0)));
  EXPECT_TRUE(plain_shape(note_of({0, 2}, {{0, 2}}, 0)));
  EXPECT_TRUE(plain_shape(note_of({0, 2, 4}, {{0, 2}, {0, 4}}, 0)));
  EXPECT_TRUE(plain_shape(note_of({0, 2, 4}, {{0, 2}, {0, 4}, {2, 4}}, 1)));
  EXPECT_TRUE(plain_shape(note_of({0, 2, 3, 4}, {{0, 2}, {0, 3}, {0, 4}, {2, 4}, {3, 4}}, 2)));
}

TEST(Shape, OthersFail) {
  EXPECT_FALSE(plain_shape(note_of({0, 1}, {}, 0))) << "two components";
  EXPECT_FALSE(plain_shape(note_of({0, 2, 4}, {{0, 2}, {0, 4}, {2, 4}}, 0))) << "an open cycle";
  EXPECT_FALSE(plain_shape(note_of({0, 1, 2, 3, 4}, {{0, 2}, {0, 3}, {1, 2}, {1, 3}}, 0)))
      << "a ring and a lone vertex: V - E + F = 1, but not connected";
}

TEST(Shape, IdleMembersThatCanBeCutOffFail) {
  const std::set<Pair> triangle{{0, 2}, {0, 4}, {2, 4}};
  EXPECT_TRUE(plain_shape(note_of({0, 2, 4}, triangle, 1, {0}))) << "both others hold it";
  EXPECT_FALSE(plain_shape(note_of({0, 2, 4}, triangle, 1, {0, 2}))) << "without 4, idle only";
  EXPECT_FALSE(plain_shape(note_of({0, 2}, {{0, 2}}, 0, {0})));
  EXPECT_TRUE(plain_shape(note_of({0, 2, 4}, {{0, 2}, {0, 4}}, 0, {0}))) << "the middle of a path";
  EXPECT_FALSE(plain_shape(note_of({0, 2, 4}, {{0, 2}, {0, 4}}, 0, {4}))) << "the end of a path";
}

/// Every graph on up to five directions against a plain search.
TEST(Shape, AgreesWithAPlainSearch) {
  for (unsigned edges = 0; edges < 1024; ++edges) {
    for (unsigned idle = 0; idle < 32; ++idle) {
      std::set<Pair> pairs;
      unsigned bit = 0;
      for (int a = 0; a < 5; ++a) {
        for (int b = a + 1; b < 5; ++b, ++bit) {
          if ((edges >> bit & 1) != 0) pairs.insert({a, b});
        }
      }
      std::set<int> idlers;
      for (int m = 0; m < 5; ++m) {
        if ((idle >> m & 1) != 0) idlers.insert(m);
      }
      const auto component = [&](int from, int without) {
        std::set<int> reached{from};
        for (std::size_t size = 0; size != reached.size();) {
          size = reached.size();
          for (const auto& [a, b] : pairs) {
            if (a == without || b == without) continue;
            if (reached.contains(a) || reached.contains(b)) reached.insert({a, b});
          }
        }
        return reached;
      };
      const int triangles = static_cast<int>(pairs.size()) - 4;  // what contractible would need
      if (triangles < 0) continue;
      bool expected = component(0, -1).size() == 5;
      for (int x = 0; x < 5; ++x) {
        for (int from = 0; from < 5; ++from) {
          if (from == x) continue;
          const std::set<int> part = component(from, x);
          if (std::includes(idlers.begin(), idlers.end(), part.begin(), part.end())) expected = false;
        }
      }
      ASSERT_EQ(plain_shape(note_of({0, 1, 2, 3, 4}, pairs, triangles, idlers)), expected) << edges << " " << idle;
    }
  }
}

}  // namespace
}  // namespace lamina::clustering
