#include "reconstruct/stages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "support/paths.h"

namespace lamina {
namespace {

TEST(Stages, ArchitectureShowsThePictureOfTheTable) {
  std::ifstream file(LAMINA_SOURCE_DIR "/docs/architecture.md");
  const std::string page{std::istreambuf_iterator<char>(file), {}};
  EXPECT_THAT(page, ::testing::HasSubstr(draw_stages()));
}

TEST(Stages, SpansGrowByTheTableAndEndWithTheCloud) {
  const SlabSpan all{-3, 40};
  const StageSpans inner({15, 20}, all, {});
  for (std::size_t s = 0; s < kStages; ++s) {
    const SlabSpan& span = inner.of(static_cast<Stage>(s));
    EXPECT_EQ(span, (SlabSpan{15 - kStageReach[s].below, 20 + kStageReach[s].above})) << kStageReach[s].name;
  }
  const StageSpans whole(all, all, {.diffuse = true, .creases = true});
  for (std::size_t s = 0; s < kStages; ++s) EXPECT_EQ(whole.of(static_cast<Stage>(s)), all);
  EXPECT_EQ(StageSpans({15, 20}, all, {.diffuse = true}).of(Stage::project).begin, inner.of(Stage::project).begin - 1);
  const SlabSpan turned = StageSpans({15, 20}, all, {.creases = true}).of(Stage::triangulate);
  const SlabSpan plain = inner.of(Stage::triangulate);
  EXPECT_EQ(turned, (SlabSpan{plain.begin - kFlipSlabs, plain.end + kFlipSlabs}));
  const SlabSpan settled = StageSpans({15, 20}, all, {.settles = true}).of(Stage::triangulate);
  EXPECT_EQ(settled, (SlabSpan{plain.begin - kSettleSlabs, plain.end + kSettleSlabs}));
}

TEST(Stages, EachStageCoversWhatTheNextOneNeeds) {
  for (std::size_t s = 1; s < kStages; ++s) {
    EXPECT_GE(kStageReach[s - 1].ahead, kStageReach[s].ahead) << kStageReach[s].name;
    EXPECT_GE(kStageReach[s - 1].below, kStageReach[s].below) << kStageReach[s].name;
    EXPECT_GE(kStageReach[s - 1].above, kStageReach[s].above) << kStageReach[s].name;
  }
}

}  // namespace
}  // namespace lamina
