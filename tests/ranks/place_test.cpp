// Where a rank's part lies in the mesh, for counts that no test could make; and messages.
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <numeric>

#include "lamina/error.h"
#include "ranks/ranks.h"
#include "ranks/together.h"

namespace lamina::ranks {
namespace {

Border border(std::uint64_t vertices, std::uint64_t triangles, SlabMark below, SlabMark last) {
  return {{0, 1}, true, below, last, vertices, triangles};
}

TEST(RankPlace, CountsBeyond32Bits) {
  const SlabMark a{7, 1}, b{9, 2};
  const std::vector<Border> parts{border(1'500'000'000, 9'000'000'000, {}, a),
                                  border(1'400'000'000, 3'000'000'000, a, b), Border{},
                                  border(1'300'000'000, 5, b, {})};
  const Place last = find_place(parts, 3, "mesh");
  EXPECT_EQ(last.first_vertex, 2'900'000'000u);
  EXPECT_EQ(last.first_triangle, 12'000'000'000u);
  EXPECT_EQ(last.vertices, 4'200'000'000u);
  EXPECT_EQ(last.triangles, 12'000'000'005u);
  EXPECT_EQ(find_place(parts, 0, "mesh").first_vertex, 0u);
}

TEST(RankPlace, MoreVerticesThanIndicesCanName) {
  const std::vector<Border> parts{border(4'000'000'000, 1, {}, {}), border(300'000'000, 1, {}, {})};
  try {
    find_place(parts, 1, "mesh.ply");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::budget);
    EXPECT_NE(std::string(error.what()).find("mesh.ply: the mesh has 4300000000 vertices"), std::string::npos);
  }
}

TEST(RankPlace, PartsThatDisagree) {
  const std::vector<Border> parts{border(5, 5, {}, {3, 17}), border(5, 5, {3, 18}, {})};
  EXPECT_THROW(find_place(parts, 0, "mesh"), Error);
}

TEST(RankMessages, AreCutWhereAnIntEnds) {
  rc::check("lengths add up and none is longer than it may be", [] {
    const auto bytes = *rc::gen::inRange<std::size_t>(0, std::size_t{1} << 40);
    const std::size_t most = std::size_t{1} << 30;
    const std::vector<std::size_t> lengths = message_lengths(bytes, most);
    RC_ASSERT(std::accumulate(lengths.begin(), lengths.end(), std::size_t{0}) == bytes);
    for (std::size_t i = 0; i < lengths.size(); ++i)
      RC_ASSERT(lengths[i] > 0 && (i + 1 == lengths.size() ? lengths[i] <= most : lengths[i] == most));
  });
}

TEST(RankMessages, ComeOutAsTheyWentIn) {
  Packer out;
  out.put(42);
  out.put(std::string("a word"));
  out.put(std::vector<double>{1.5, -2});
  const Bytes bytes = out.take();
  Unpacker in(bytes);
  EXPECT_EQ(in.get<int>(), 42);
  EXPECT_EQ(in.get_text(), "a word");
  EXPECT_EQ(in.get_list<double>(), (std::vector<double>{1.5, -2}));
  EXPECT_THROW(in.get<char>(), Error);
}

}  // namespace
}  // namespace lamina::ranks
