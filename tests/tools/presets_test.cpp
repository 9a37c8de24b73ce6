// --preset: options as if they had been typed.
#include "common/presets.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class Presets : public ::testing::Test {
 protected:
  Outcome surface(std::vector<std::string> options, const std::string& mesh = "mesh.ply") const {
    options.insert(options.begin(), {"surface", cloud_, "-o", folder_ / mesh});
    return run_lamina(options);
  }
  /// What a preset stands for, typed.
  static std::vector<std::string> typed(std::size_t trade) {
    std::vector<std::string> words;
    for (const PresetRow& row : preset_table()) {
      const std::string value(row.values.at(trade));
      if (value.empty()) continue;
      words.emplace_back(row.option);
      if (value != "true") words.push_back(value);
    }
    return words;
  }

  TemporaryFolder folder_;
  std::string cloud_ = write_points(folder_ / "cloud.ply", sphere_rows(3000, 5), sphere_columns());
};

TEST_F(Presets, AreTheOptionsTheyPrint) {
  for (std::size_t trade = 0; trade < kTradeNames.size(); ++trade) {
    const std::string name(kTradeNames[trade]);
    const Outcome preset = surface({"--preset", name}, "preset.ply");
    ASSERT_EQ(preset.code, 0) << preset.err;
    EXPECT_THAT(preset.err, AllOf(HasSubstr("preset " + name + ": --"), Not(HasSubstr("taken for"))));
    for (const PresetRow& row : preset_table()) {
      const std::string value(row.values[trade]);
      const std::string typed_as = std::string(row.option) + (value == "true" ? "" : " " + value);
      if (value.empty()) {
        EXPECT_THAT(preset.err, Not(HasSubstr(typed_as)));
      } else {
        EXPECT_THAT(preset.err, HasSubstr(typed_as));
      }
    }
    const Outcome by_hand = surface(typed(trade), "by_hand.ply");
    ASSERT_EQ(by_hand.code, 0) << by_hand.err;
    EXPECT_EQ(read_file(folder_ / "preset.ply"), read_file(folder_ / "by_hand.ply")) << name;
  }
}

TEST_F(Presets, AreAsDocumented) {
  const std::string page = read_text(LAMINA_SOURCE_DIR "/docs/presets.md");
  for (const PresetRow& row : preset_table()) {
    std::string line = fmt::format("\n| `{}` |", row.option);
    for (const std::string_view value : row.values)
      line += value.empty() ? " |" : value == "true" ? " yes |" : fmt::format(" `{}` |", value);
    EXPECT_THAT(page, HasSubstr(line + "\n"));
  }
  for (const std::string_view name : kTradeNames) EXPECT_THAT(page, HasSubstr(fmt::format("\n| `{}` | ", name)));
}

TEST_F(Presets, YieldToWhatIsGivenByHand) {
  const Outcome run = surface({"--preset", "terrestrial", "--close-holes", "5", "--up", "0,0,1", "--keep-strays"});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(run.err, AllOf(HasSubstr("; by hand: --up --strays --close-holes\n"), Not(HasSubstr("--viewpoint")),
                             Not(HasSubstr("--close-holes 60")), HasSubstr("--max-radius 30r")));
  ASSERT_EQ(surface({"--preset", "object", "--close-holes", "0", "--watertight", "no", "--prune", "7"}, "a.ply").code,
            0);
  ASSERT_EQ(surface({"--close-holes", "0", "--watertight", "no", "--prune", "7"}, "b.ply").code, 0);
  EXPECT_EQ(read_file(folder_ / "a.ply"), read_file(folder_ / "b.ply"));
}

TEST_F(Presets, BadNamesAreToldTheGoodOnes) {
  for (const char* tool : {"surface", "normal"}) {
    const Outcome run = run_lamina({tool, cloud_, "-o", folder_ / "x.ply", "--preset", "drone"});
    EXPECT_EQ(run.code, 2);
    for (const std::string_view name : kTradeNames) EXPECT_THAT(run.err, HasSubstr(std::string(name)));
  }
  EXPECT_EQ(surface({"--preset", "object", "--raw"}).code, 2);
}

TEST_F(Presets, WithoutOneTheGuessIsSaidAndChangesNoCloudWithNormals) {
  const Outcome run = surface({}, "guessed.ply");
  EXPECT_THAT(run.err, AllOf(HasSubstr("taken for --preset photogrammetry"), HasSubstr("handheld")));
  EXPECT_THAT(surface({"--raw"}).err, Not(HasSubstr("taken for")));
  EXPECT_THAT(run_lamina({"normal", cloud_, "-o", folder_ / "n.ply"}).err, HasSubstr("taken for --preset"));
}

TEST_F(Presets, ServeNormalsAndStoresAndRunsInParts) {
  const Outcome normal = run_lamina({"normal", cloud_, "-o", folder_ / "n.ply", "--preset", "aerial"});
  ASSERT_EQ(normal.code, 0) << normal.err;
  EXPECT_THAT(normal.err, HasSubstr("preset aerial: --up 0,0,1 --drop-class 7,13,14,18\n"));
  const SampleBatch rows = read_points(folder_ / "n.ply");
  std::size_t up = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) up += rows.z[i] > 0.5 && rows.nz[i] > 0 ? 1 : 0;
  EXPECT_GT(up, rows.size() / 5);
  for (const std::string_view trade : kTradeNames) {
    const std::string name(trade), store = folder_ / (name + ".store"), part = folder_ / "part.lmesh";
    const Outcome sort = run_lamina({"sort", cloud_, "--store", store, "--preset", name});
    ASSERT_EQ(sort.code, 0) << sort.err;
    EXPECT_THAT(sort.err, AllOf(HasSubstr("--strays"), Not(HasSubstr("--watertight"))));
    const Outcome chunk = run_lamina({"surface", store, "-o", part, "--chunk", "1/2", "--preset", name});
    ASSERT_EQ(chunk.code, 0) << chunk.err;
    EXPECT_THAT(chunk.err, AllOf(HasSubstr("--watertight"), Not(HasSubstr("--prune")), Not(HasSubstr("--strays"))));
  }
}

}  // namespace
}  // namespace lamina::tools
