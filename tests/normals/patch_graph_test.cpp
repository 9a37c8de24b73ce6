#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "base/union_find.h"
#include "normals/sample_window.h"
#include "normals/sides.h"

namespace lamina::normals {
namespace {

constexpr InputAxes kAxes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

PatchNode node_at(float x, float outward) {
  PatchNode n;
  n.count = 1;
  n.area = 1;
  n.centre = {x, 0, 0};
  n.outward = {outward, 0, 0};
  return n;
}

void link(PatchGraph& g, std::uint32_t a, std::uint32_t b, float agreement, std::uint32_t same = 1,
          std::uint32_t opposite = 0) {
  g.edges.push_back({a, b, agreement, same, opposite});
}

// Two walls of a body, the second one's normals inward: it must turn.
TEST(PatchSigns, TurnABodyOutsideOut) {
  for (const float side : {1.0F, -1.0F}) {
    PatchGraph g;
    g.nodes.push_back(node_at(1, side));
    g.nodes.push_back(node_at(-1, side));
    link(g, 1, 2, -3);
    const PatchSigns s = find_signs(g, kAxes);
    EXPECT_EQ(s.components, 1);
    EXPECT_EQ(s.sign[1], side);
    EXPECT_EQ(s.sign[2], -side);
    EXPECT_EQ(s.source[1], SignSource::outside);
  }
}

// Hills and bowls alike.
TEST(PatchSigns, TurnAnOpenGroundUp) {
  for (const float bulge : {0.5F, -0.5F}) {
    PatchGraph g;
    g.nodes.push_back(node_at(1, 0));
    g.nodes.push_back(node_at(-1, 0));
    for (std::size_t i : {1, 2}) {
      g.nodes[i].outward = {0.2F, 0, -0.9F};
      g.nodes[i].bulge = bulge;
    }
    link(g, 1, 2, 3);
    const PatchSigns s = find_signs(g, kAxes);
    EXPECT_EQ(s.sign[1], -1);
    EXPECT_EQ(s.source[1], SignSource::unsure);
    EXPECT_EQ(find_signs(g, {{{1, 0, 0}, {0, 1, 0}, {0, 0, -1}}}).sign[1], 1);
    EXPECT_EQ(find_signs(g, {{{1, 0, 0}, {0, 0, 1}, {0, 1, 0}}}).sign[1], bulge > 0 ? 1 : -1);
  }
}

TEST(PatchSigns, FollowVotesAgainstTheOutside) {
  PatchGraph g;
  g.nodes.push_back(node_at(1, 1));
  g.nodes.push_back(node_at(-1, -1));
  g.nodes[2].vote = -2;
  link(g, 1, 2, 3);
  const PatchSigns s = find_signs(g, kAxes);
  EXPECT_EQ(s.sign[1], -1);
  EXPECT_EQ(s.sign[2], -1);
  EXPECT_EQ(s.source[1], SignSource::fixed);
}

// One bad link is not followed where two good ones say otherwise.
TEST(PatchSigns, SumUpWhatClustersSayOfEachOther) {
  PatchGraph g;
  for (int i = 0; i < 4; ++i) g.nodes.push_back(node_at(1, 1));
  g.nodes[1].vote = 10;
  link(g, 1, 2, 8);
  link(g, 3, 4, 8);
  link(g, 1, 3, -3);
  link(g, 2, 4, 2);
  link(g, 2, 3, 2);
  const PatchSigns s = find_signs(g, kAxes);
  for (std::size_t i = 1; i < 5; ++i) EXPECT_EQ(s.sign[i], 1) << i;
}

TEST(PatchSigns, CountsConflictsThatRemain) {
  PatchGraph g;
  for (int i = 0; i < 3; ++i) g.nodes.push_back(node_at(1, 1));
  g.nodes[1].vote = 1;
  link(g, 1, 2, -5, 0, 9);  // all resolved by turning 2
  g.slabs.push_back({10, 2, 1});
  link(g, 1, 3, 5, 8, 1);
  link(g, 2, 3, 1, 4, 0);  // against the odd one
  g.slabs.push_back({0, 0, 3});
  const std::vector<SignConflicts> c = count_conflicts(g, find_signs(g, kAxes));
  ASSERT_EQ(c.size(), 2);
  EXPECT_EQ(c[0].pairs, 21);
  EXPECT_EQ(c[0].conflicts, 2);
  EXPECT_EQ(c[1].pairs, 13);
  EXPECT_EQ(c[1].conflicts, 1 + 4);
}

// Whatever signs are hidden, links that all agree with them give them back, up to one sign for each component.
RC_GTEST_PROP(PatchSigns, FindHiddenSigns, ()) {
  const auto n = *rc::gen::inRange<std::uint32_t>(1, 60);
  const auto hidden = *rc::gen::container<std::vector<int>>(n + 1, rc::gen::element(-1, 1));
  PatchGraph g;
  for (std::uint32_t i = 1; i <= n; ++i) g.nodes.push_back(node_at(1, 1));
  SignedUnionFind joined(n + 1);
  for (const auto& [a, b] : *rc::gen::container<std::vector<std::pair<std::uint32_t, std::uint32_t>>>(
           rc::gen::pair(rc::gen::inRange<std::uint32_t>(1, n + 1), rc::gen::inRange<std::uint32_t>(1, n + 1)))) {
    if (a == b) continue;
    link(g, std::min(a, b), std::max(a, b), static_cast<float>(hidden[a] * hidden[b] * *rc::gen::inRange(1, 20)));
    joined.unite(a, b, 1);
  }
  const PatchSigns s = find_signs(g, kAxes);
  std::uint64_t components = 0;
  for (std::uint32_t i = 1; i <= n; ++i) {
    const std::uint32_t root = joined.find(i);
    components += root == i ? 1 : 0;
    RC_ASSERT(s.sign[i] * hidden[i] == s.sign[root] * hidden[root]);
  }
  RC_ASSERT(s.components == components);
}

constexpr int kSide = 20;  // patches along the ground of what follows

/// Level ground, patch by patch, every second one as if it faced down, and links that tell.
PatchGraph ground() {
  PatchGraph g;
  g.cell = 1;
  const auto outward = [](int i) { return i % 2 == 0 ? 1.0F : -1.0F; };
  const auto agreement = [&](int a, int b) { return 8 * outward(a) * outward(b); };
  for (int i = 0; i < kSide * kSide; ++i) {
    const auto x = static_cast<float>(i % kSide);
    const auto y = static_cast<float>(i / kSide);
    g.nodes.push_back({20, 1, {x, y, 0}, {0, 0, outward(i)}, 0, 0});
    const auto node = static_cast<std::uint32_t>(i + 1);
    if (i % kSide > 0) link(g, node - 1, node, agreement(i - 1, i));
    if (i >= kSide) link(g, node - kSide, node, agreement(i - kSide, i));
  }
  return g;
}

/// Crowns over a third of the ground, which say that they face down; the first of them.
std::uint32_t add_crowns(PatchGraph& g) {
  const auto first = static_cast<std::uint32_t>(g.nodes.size());
  for (std::uint32_t i = 1; i <= kSide * kSide / 3; ++i) {
    PatchNode crown = g.nodes[i];
    crown.centre[2] = 4;
    g.nodes.push_back(crown);
    link(g, i, first + i - 1, -1, 0, 1);
    if (i > 1) link(g, first + i - 2, first + i - 1, -8);
  }
  return first;
}

// Seen from the air all faces up, whatever links say of crowns and the ground below, and birds do not make it high.
TEST(PatchSigns, TurnAllUpThatIsSeenFromAbove) {
  PatchGraph g = ground();
  const std::uint32_t crowns = add_crowns(g);
  const auto birds = static_cast<std::uint32_t>(g.nodes.size());
  for (int i = 0; i < 100; ++i) g.nodes.push_back({1, 50, {static_cast<float>(i % kSide), 3, 200}, {0, 0, 50}, 0, 0});
  const PatchSigns s = find_signs(g, kAxes);
  for (std::uint32_t i = 1; i < birds; ++i) {
    EXPECT_GT(static_cast<float>(s.sign[i]) * g.nodes[i].outward[2], 0) << (i < crowns ? "ground " : "crown ") << i;
    EXPECT_EQ(s.source[i], SignSource::up);
  }
}

// Where scanners or given normals say how most of it faces, they say it: a sheet that they do not reach follows its
// links.
TEST(PatchSigns, AskNotTheSkyWhereMostIsKnown) {
  PatchGraph g = ground();
  const std::uint32_t crowns = add_crowns(g);
  for (std::uint32_t i = 1; i < crowns; ++i) link(g, kFixed, i, -100 * g.nodes[i].outward[2]);
  const PatchSigns s = find_signs(g, kAxes);
  for (std::uint32_t i = 1; i < crowns; ++i) EXPECT_LT(static_cast<float>(s.sign[i]) * g.nodes[i].outward[2], 0);
  for (std::uint32_t i = crowns; i < g.nodes.size(); ++i)
    EXPECT_GT(static_cast<float>(s.sign[i]) * g.nodes[i].outward[2], 0);
}

// Who stands on the ground sees walls, and roofs from below: what links say of them stays.
TEST(PatchSigns, FollowLinksWhereWallsAreSeen) {
  PatchGraph g = ground();
  const std::uint32_t eaves = add_crowns(g);
  const auto walls = static_cast<std::uint32_t>(g.nodes.size());
  for (std::uint32_t i = 0; i < kSide * kSide / 2; ++i) {
    const auto along = static_cast<float>(i % kSide);
    const auto up = static_cast<float>(i / kSide);
    g.nodes.push_back({20, 1, {along, -1, up}, {0, 1, 0}, 0, 0});
    link(g, i % kSide + 1, walls + i, 8 * g.nodes[i % kSide + 1].outward[2]);
  }
  const PatchSigns s = find_signs(g, kAxes);
  for (std::uint32_t i = 1; i < eaves; ++i) EXPECT_GT(static_cast<float>(s.sign[i]) * g.nodes[i].outward[2], 0);
  for (std::uint32_t i = eaves; i < walls; ++i) EXPECT_LT(static_cast<float>(s.sign[i]) * g.nodes[i].outward[2], 0);
}

// Each patch of a small body is looked from; of a large one some, which stand for as many as there are.
TEST(Looks, StandForAllPatchesOfTheirBody) {
  constexpr std::uint32_t kSmall = 100;
  constexpr std::uint32_t kLarge = 50'000;
  std::vector<std::uint32_t> root{0, 0};  // the fixed node, and one that is joined to it
  root.insert(root.end(), kSmall, 2);
  root.insert(root.end(), kLarge, 2 + kSmall);
  const std::vector<float> looks = choose_looks(root);
  ASSERT_EQ(looks.size(), root.size());
  EXPECT_EQ(looks[0], 0);
  EXPECT_EQ(looks[1], 0);
  for (std::size_t i = 2; i < 2 + kSmall; ++i) EXPECT_EQ(looks[i], 1);
  double sum = 0;
  std::size_t looked = 0;
  for (std::size_t i = 2 + kSmall; i < looks.size(); ++i) {
    sum += double{looks[i]};
    looked += looks[i] > 0 ? 1 : 0;
  }
  EXPECT_NEAR(sum, kLarge, 0.001 * kLarge);
  EXPECT_LT(looked, kLarge / 10);
  EXPECT_GT(looked, 2000U);
}

RC_GTEST_PROP(SignedUnionFind, KeepsSignsRelativeToTheRoot, ()) {
  constexpr std::uint32_t kMany = 40;
  const auto hidden = *rc::gen::container<std::vector<int>>(kMany, rc::gen::element(-1, 1));
  SignedUnionFind forest(kMany);
  for (int i = 0; i < 60; ++i) {
    const auto a = *rc::gen::inRange<std::uint32_t>(0, kMany);
    const auto b = *rc::gen::inRange<std::uint32_t>(0, kMany);
    forest.unite(a, b, static_cast<std::int8_t>(hidden[a] * hidden[b]));
    RC_ASSERT(forest.find(a) == forest.find(b));
    const auto c = *rc::gen::inRange<std::uint32_t>(0, kMany);
    const std::uint32_t root = forest.find(c);
    RC_ASSERT(forest.sign(c) == hidden[c] * hidden[root]);
  }
}

}  // namespace
}  // namespace lamina::normals
