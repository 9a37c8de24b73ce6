#include "lamina/check.h"

#include <gtest/gtest.h>

namespace lamina {
namespace {

TriangleMesh tetrahedron() {
  TriangleMesh m;
  m.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  m.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return m;
}

TEST(Check, TetrahedronIsClosed) {
  const CheckReport r = check_mesh(tetrahedron());
  EXPECT_TRUE(r.closed());
  EXPECT_EQ(r.edges, 6u);
  EXPECT_EQ(r.euler_characteristic, 2);
  EXPECT_EQ(r.genus, 0);
  EXPECT_EQ(r.components, 1u);
}

}  // namespace
}  // namespace lamina
