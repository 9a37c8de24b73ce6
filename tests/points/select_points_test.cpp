// Points by class, return and value, against all rows of the same file and the condition asked one by one.
#include "points/formats.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "base/temporary_folder.h"
#include "points/point_rows.h"
#include "support/paths.h"

namespace lamina {
namespace {

using test::all_rows;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A LAS of a random walk with all classes, returns and times (laz_points_test.cpp).
const std::string kWalk = LAMINA_SOURCE_DIR "/tests/points/laz/f7_x3.las";

PointSettings selecting(const PointSelection& selection) {
  return {.select = selection};
}

PointSelection where(std::initializer_list<const char*> conditions) {
  PointSelection selection;
  selection.drop_classes.clear();
  for (const char* text : conditions) selection.where.push_back(parse_condition(text));
  return selection;
}

/// A file of text, sequential as ascii PLY or random_access as XYZ, of n rows with x = row and value = row * 7 % 100.
std::string rows_file(const test::TemporaryFolder& folder, bool ply, int n) {
  std::string text = ply ? fmt::format(
                               "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\n"
                               "property double z\nproperty double value\nend_header\n",
                               n)
                         : "x y z value\n";
  for (int i = 0; i < n; ++i) text += fmt::format("{} 0.5 -2 {}\n", i, i * 7 % 100);
  return test::write_file(folder / (ply ? "rows.ply" : "rows.xyz"), text);
}

void expect_rows(const SampleBatch& rows, const SampleBatch& all, const std::function<bool(std::size_t)>& stays) {
  std::size_t n = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!stays(i)) continue;
    ASSERT_LT(n, rows.size());
    ASSERT_EQ(rows.x[n], all.x[i]) << i;
    for (std::size_t a = 0; a < all.attributes.size(); ++a) ASSERT_EQ(rows.attributes[a][n], all.attributes[a][i]);
    ++n;
  }
  EXPECT_EQ(n, rows.size());
}

TEST(SelectPoints, ByValuesOfAnyFormatInPiecesOfAnySize) {
  const test::TemporaryFolder folder;
  for (const bool ply : {false, true}) {
    SCOPED_TRACE(ply);
    const std::string path = rows_file(folder, ply, 20'000);
    const SampleBatch all = all_rows(path);
    const auto source = open_points(path, selecting(where({"value>=30", "value != 37", "x<15000"})));
    EXPECT_THAT(source->info().remarks, ElementsAre(HasSubstr("of 20000 points not selected")));
    for (const std::size_t piece : {1U << 16, 613U, 4096U}) {
      expect_rows(all_rows(*source, piece), all, [&](std::size_t i) {
        const std::size_t value = i * 7 % 100;
        return value >= 30 && value != 37 && i < 15'000;
      });
    }
    EXPECT_EQ(open_points(path, selecting(where({"value<0"})))->info().count, 0U);
    EXPECT_THAT(open_points(path, selecting(where({"value>=0"})))->info().remarks, IsEmpty());
  }
}

TEST(SelectPoints, ByClassAndReturn) {
  const SampleBatch all = all_rows(kWalk, selecting(where({})));
  const auto source = open_points(kWalk, selecting(where({})));
  std::vector<std::vector<double>> values;
  dynamic_cast<const HiddenValues&>(*source).read_hidden({"classification", "return_number", "number_of_returns"},
                                                         {0, all.size()}, values);
  const auto [classes, numbers, returns] = std::tie(values[0], values[1], values[2]);
  const auto expect = [&](const PointSelection& selection, const std::function<bool(std::size_t)>& stays) {
    expect_rows(all_rows(kWalk, selecting(selection)), all, stays);
  };
  PointSelection selection;
  expect(selection, [&](std::size_t i) { return classes[i] != 7 && classes[i] != 18; });
  EXPECT_THAT(open_points(kWalk, "")->info().remarks, ElementsAre(HasSubstr("left out as noise")));
  selection.keep_classes = {2, 7};
  expect(selection, [&](std::size_t i) { return classes[i] == 2 || classes[i] == 7; });
  selection.keep_classes.clear();
  selection.drop_classes = {1, 2, 3};
  expect(selection, [&](std::size_t i) { return classes[i] < 1 || classes[i] > 3; });
  selection.drop_classes.clear();
  selection.returns = PointSelection::Returns::first;
  expect(selection, [&](std::size_t i) { return numbers[i] <= 1; });
  selection.returns = PointSelection::Returns::last;
  expect(selection, [&](std::size_t i) { return numbers[i] >= returns[i]; });
  expect(where({"classification=5", "return_number<3"}),
         [&](std::size_t i) { return classes[i] == 5 && numbers[i] < 3; });
}

TEST(SelectPoints, WhatCannotBeMeant) {
  const test::TemporaryFolder folder;
  const std::string path = rows_file(folder, false, 10);
  const auto refused = [&](const PointSelection& selection) { return test::refusal(path, selecting(selection)); };
  EXPECT_THAT(refused(where({"colour>3"})), HasSubstr("no 'colour' to select by; they have x, y, z, value"));
  PointSelection selection;
  selection.keep_classes = {2};
  EXPECT_THAT(refused(selection), HasSubstr("--keep-class asks for"));
  selection = {.returns = PointSelection::Returns::last};
  EXPECT_THAT(refused(selection), HasSubstr("--returns asks for"));
  selection = {.resolution = 0.5};
  EXPECT_THAT(refused(selection), HasSubstr("--resolution is for COPC"));
  for (const char* text : {"", "intensity", ">3", "intensity>", "intensity>a", "intensity><3", "intensity>3 4"}) {
    EXPECT_THROW(parse_condition(text), Error) << text;
  }
}

}  // namespace
}  // namespace lamina
