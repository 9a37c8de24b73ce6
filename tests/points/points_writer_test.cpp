#include "lamina/points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <fcntl.h>

#include <limits>
#include <random>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "points/ply_files.h"

namespace lamina {
namespace {

using ::testing::HasSubstr;

/// Columns of every kind and finite values that their types can hold.
struct Cloud {
  PointColumns columns;
  SampleBatch rows;
};

double finite_value(ScalarType type, std::mt19937& random) {
  double value = 0;
  do value = test::random_value(type, random);
  while (!std::isfinite(value));
  return value;
}

Cloud random_cloud(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  Cloud cloud;
  PointColumns& columns = cloud.columns;
  columns.double_positions = random() % 2 == 0;
  columns.normals = random() % 2 == 0;
  if (random() % 2 == 0) columns.radius = random() % 2 == 0 ? "radius" : "pscale";
  if (random() % 2 == 0) columns.quality = random() % 2 == 0 ? "quality" : "confidence";
  for (std::size_t a = 0; a < random() % 5; ++a)
    columns.attributes.push_back({"a" + std::to_string(a), test::random_type(random)});
  SampleBatch& rows = cloud.rows;
  const auto fill = [&](auto& values, ScalarType type) {
    for (std::size_t i = 0; i < count; ++i)
      values.push_back(static_cast<typename std::decay_t<decltype(values)>::value_type>(finite_value(type, random)));
  };
  const ScalarType position = columns.double_positions ? ScalarType::float64 : ScalarType::float32;
  for (auto* axis : {&rows.x, &rows.y, &rows.z}) fill(*axis, position);
  if (columns.normals)
    for (auto* axis : {&rows.nx, &rows.ny, &rows.nz}) fill(*axis, ScalarType::float32);
  if (!columns.radius.empty()) fill(rows.radius, ScalarType::float32);
  if (!columns.quality.empty()) fill(rows.quality, ScalarType::float32);
  rows.attributes.resize(columns.attributes.size());
  rows.exact.resize(columns.attributes.size());
  for (std::size_t a = 0; a < columns.attributes.size(); ++a) {
    const ScalarType type = columns.attributes[a].type;
    if (fits_float(type)) {
      fill(rows.attributes[a], type);
    } else {
      fill(rows.exact[a], type);
      rows.attributes[a].assign(rows.exact[a].begin(), rows.exact[a].end());
    }
  }
  return cloud;
}

SampleBatch part(const SampleBatch& rows, std::size_t first, std::size_t count) {
  const auto cut = [&](const auto& values) {
    if (values.empty()) return values;
    return std::decay_t<decltype(values)>(values.begin() + static_cast<long>(first),
                                          values.begin() + static_cast<long>(first + count));
  };
  SampleBatch out;
  out.x = cut(rows.x), out.y = cut(rows.y), out.z = cut(rows.z);
  out.nx = cut(rows.nx), out.ny = cut(rows.ny), out.nz = cut(rows.nz);
  out.radius = cut(rows.radius), out.quality = cut(rows.quality);
  for (const auto& values : rows.attributes) out.attributes.push_back(cut(values));
  for (const auto& values : rows.exact) out.exact.push_back(cut(values));
  return out;
}

void write_in_parts(const Cloud& cloud, const std::string& path, std::size_t step,
                    const PointsWriterSettings& settings) {
  const auto writer = open_points_writer(path, cloud.columns, settings);
  for (std::size_t first = 0; first < cloud.rows.size(); first += step) {
    writer->append(part(cloud.rows, first, std::min(step, cloud.rows.size() - first)));
  }
  writer->commit();
}

RC_GTEST_PROP(PointsWriter, WhatIsWrittenIsReadBackExactly, (unsigned seed)) {
  const auto count = *rc::gen::inRange<std::size_t>(0, 600);
  const Cloud cloud = random_cloud(count, seed);
  const test::TemporaryFolder folder;
  const std::string path = folder / "cloud.ply";
  write_in_parts(cloud, path, *rc::gen::inRange<std::size_t>(1, 300), {});
  const auto source = open_points(path);
  RC_ASSERT(source->info().count == count);
  RC_ASSERT(columns_of(source->info()) == cloud.columns);
  SampleBatch rows;
  source->read(0, count, rows);
  RC_ASSERT(rows.x == cloud.rows.x);
  RC_ASSERT(rows.y == cloud.rows.y);
  RC_ASSERT(rows.z == cloud.rows.z);
  RC_ASSERT(rows.nx == cloud.rows.nx);
  RC_ASSERT(rows.nz == cloud.rows.nz);
  RC_ASSERT(rows.radius == cloud.rows.radius);
  RC_ASSERT(rows.quality == cloud.rows.quality);
  RC_ASSERT(rows.attributes == cloud.rows.attributes);
  RC_ASSERT(rows.exact == cloud.rows.exact);
}

TEST(PointsWriter, BytesDependOnTheRowsAlone) {
  const Cloud cloud = random_cloud(1000, 7);
  const test::TemporaryFolder folder;
  write_in_parts(cloud, folder / "a.ply", 1000, {});
  write_in_parts(cloud, folder / "b.ply", 7, {.count = 1000});
  EXPECT_EQ(test::read_file(folder / "a.ply"), test::read_file(folder / "b.ply"));
}

TEST(PointsWriter, StandardOutputGetsTheSameBytesKnownCountOrNot) {
  const Cloud cloud = random_cloud(700, 11);
  const test::TemporaryFolder folder;
  write_in_parts(cloud, folder / "file.ply", 100, {});
  for (const auto& settings : {PointsWriterSettings{}, PointsWriterSettings{.count = 700}}) {
    const std::string piped = folder / "piped";
    const int fd = ::open(piped.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    {
      const test::Redirected to(1, fd);
      write_in_parts(cloud, "-", 100, settings);
    }
    ::close(fd);
    EXPECT_EQ(test::read_file(piped), test::read_file(folder / "file.ply"));
  }
}

TEST(PointsWriter, RoundsAndClampsToTheType) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "colours.ply";
  SampleBatch rows;
  rows.x = rows.y = rows.z = {0, 0, 0};
  rows.attributes = {{-3, 127.6F, 300}};
  const auto writer = open_points_writer(path, {.attributes = {{"red", ScalarType::uint8}}});
  writer->append(rows);
  writer->commit();
  SampleBatch back;
  open_points(path)->read(0, 3, back);
  EXPECT_EQ(back.attributes[0], (std::vector<float>{0, 128, 255}));
}

TEST(PointsWriter, NothingIsLeftWithoutCommit) {
  const test::TemporaryFolder folder;
  test::write_file(folder / "old.ply", "old");
  { const auto writer = open_points_writer(folder / "old.ply", random_cloud(1, 1).columns); }
  EXPECT_EQ(folder.entries(), 1);
  EXPECT_EQ(test::read_file(folder / "old.ply"), "old");
}

template <class Work>
ExitCode code_of(const Work& work, std::string* message = nullptr) {
  try {
    work();
  } catch (const Error& e) {
    if (message != nullptr) *message = e.what();
    return e.code();
  }
  return ExitCode::ok;
}

TEST(PointsWriter, RefusesWhatItCannotWrite) {
  const test::TemporaryFolder folder;
  std::string message;
  EXPECT_EQ(code_of([&] { open_points_writer(folder / "a.xyzw", {}); }, &message), ExitCode::usage);
  EXPECT_THAT(message, HasSubstr("known are .ply"));
  EXPECT_EQ(code_of([&] { open_points_writer(folder / "no/such/a.ply", {}); }), ExitCode::budget);
  EXPECT_EQ(code_of([&] {
              open_points_writer(folder / "a.ply", {.attributes = {{"two words", ScalarType::int8}}});
            }),
            ExitCode::internal);
  EXPECT_EQ(code_of([&] {
              open_points_writer(folder / "a.ply", {.radius = "radius", .attributes = {{"radius", ScalarType::int8}}});
            }),
            ExitCode::internal);

  SampleBatch rows;
  rows.x = rows.y = {1, 2};
  rows.z = {1, std::numeric_limits<double>::quiet_NaN()};
  const auto writer = open_points_writer(folder / "b.ply", {});
  EXPECT_EQ(code_of([&] { writer->append(rows); }, &message), ExitCode::internal);
  EXPECT_THAT(message, HasSubstr("row 1 would get z = nan"));
  rows.z = {1, 1e300};
  EXPECT_EQ(code_of([&] { writer->append(rows); }), ExitCode::internal) << "infinite as a float";
  const auto needs_normals = open_points_writer(folder / "c.ply", {.normals = true});
  rows.z = {1, 2};
  EXPECT_EQ(code_of([&] { needs_normals->append(rows); }), ExitCode::internal);
  const auto counted = open_points_writer(folder / "d.ply", {}, {.count = 3});
  counted->append(rows);
  EXPECT_EQ(code_of([&] { counted->commit(); }, &message), ExitCode::internal);
  EXPECT_THAT(message, HasSubstr("2 rows came, 3 were announced"));
}

}  // namespace
}  // namespace lamina
