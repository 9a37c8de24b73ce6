#include "vdb/vdb_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/points/PointAttribute.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/points/PointGroup.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <fstream>
#include <random>
#include <sstream>

#include "lamina/error.h"
#include "lamina/volume_points.h"
#include "support/program.h"

namespace lamina::volume {
namespace {

using ::testing::HasSubstr;

/// Made by the library, as a file's are: types that only files bring are not compiled here (grids.h).
template <class Grid>
typename Grid::Ptr grid_of(const std::string& name, const typename Grid::ValueType& value) {
  const auto grid = openvdb::gridPtrCast<Grid>(openvdb::GridBase::createGrid(Grid::gridType()));
  grid->setName(name);
  auto values = grid->getAccessor();
  for (int i = 0; i < 40; ++i) values.setValue(openvdb::Coord(3 * i, -i * i, 500 * (i % 2)), value);
  grid->tree().addTile(2, openvdb::Coord(4096, 0, 0), value, true);
  return grid;
}

std::string every_kind(bool half) {
  openvdb::initialize();
  const auto sphere = openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(6, openvdb::Vec3f(0), 1);
  sphere->setName("surface");
  openvdb::GridPtrVec grids{sphere,
                            grid_of<openvdb::DoubleGrid>("double", 0.5),
                            grid_of<openvdb::Vec3SGrid>("vector", openvdb::Vec3s(1, 2, 3)),
                            grid_of<openvdb::Vec3DGrid>("vector64", openvdb::Vec3d(1, 2, 3)),
                            grid_of<openvdb::Int32Grid>("int", 7),
                            grid_of<openvdb::Int64Grid>("long", 8),
                            grid_of<openvdb::BoolGrid>("bool", true),
                            grid_of<openvdb::MaskGrid>("mask", true)};
  grids[1]->setTransform(
      openvdb::math::Transform::createFrustumTransform(openvdb::BBoxd({0, 0, 0}, {9, 9, 9}), 0.5, 2));
  for (const auto& grid : grids) grid->setSaveFloatAsHalf(half);
  return vdb_bytes({grids.begin(), grids.end()});
}

/// Points as other programs write them: packed positions, a group, texts, arrays of one value and of three.
std::string packed_points(int count) {
  using namespace openvdb;
  initialize();
  std::vector<Vec3f> places;
  for (int i = 0; i < count; ++i) places.emplace_back(0.01F * float(i), 0.3F * float(i % 7), float(i % 40));
  const points::PointAttributeVector<Vec3f> wrapped(places);
  const auto transform = math::Transform::createLinearTransform(0.5);
  auto grid = points::createPointDataGrid<points::FixedPointCodec<false>, points::PointDataGrid>(places, *transform);
  grid->setName("points");
  auto& tree = grid->tree();
  points::appendAttribute<float, points::TruncateCodec>(tree, "heat", 0.5F);
  points::appendAttribute<Vec3f, points::UnitVecCodec>(tree, "N", Vec3f(0, 0, 1));
  points::appendAttribute<float>(tree, "three", 1.0F, 3);
  points::appendAttribute<Name, points::StringCodec<false>>(tree, "who");
  points::appendGroup(tree, "some");
  for (auto leaf = tree.beginLeaf(); leaf; ++leaf) {
    points::AttributeWriteHandle<float> heat(leaf->attributeArray("heat"));
    points::AttributeWriteHandle<float> three(leaf->attributeArray("three"));
    for (Index i = 0; i < leaf->getLastValue(); ++i) {
      heat.set(i, float(i));
      three.set(i, i % 3, float(i));
    }
  }
  return vdb_bytes({grid});
}

void check(const std::string& bytes) {
  std::istringstream stream(bytes);
  stream.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
  check_vdb(stream);
}

TEST(VdbCheck, TakesEveryKindOfGrid) {
  for (const bool half : {false, true}) EXPECT_NO_THROW(check(every_kind(half)));
  for (const int count : {1, 30, 20'000, 400'000}) EXPECT_NO_THROW(check(packed_points(count))) << count;
}

TEST(VdbCheck, SeesWhereAFileEndsTooEarly) {
  const std::string bytes = every_kind(true);
  for (std::size_t size = 0; size < bytes.size(); size += 389)
    EXPECT_THROW(check(bytes.substr(0, size)), std::exception) << size;
  EXPECT_THROW(check(bytes.substr(0, bytes.size() - 1)), std::ios::failure);
  const std::string points = packed_points(500);
  for (std::size_t size = 0; size < points.size(); size += 29)
    EXPECT_THROW(check(points.substr(0, size)), std::exception) << size;
}

class DamagedVdb : public ::testing::Test {
 protected:
  /// What reading it comes to: nothing, or one line.
  std::string read(const std::string& bytes) {
    const std::string path = folder_ / "damaged.vdb";
    std::ofstream(path, std::ios::binary) << bytes;
    try {
      points_ ? read_point_volume(path).points.samples.size() : read_vdb(path).grids.size();
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ExitCode::unreadable);
      return e.what();
    }
    return {};
  }
  bool points_ = false;
  test::TemporaryFolder folder_;
};

TEST_F(DamagedVdb, IsReadOrRefusedWithOneLine) {
  const std::string whole = every_kind(true);
  EXPECT_EQ(read(whole), "");
  std::mt19937 random(7);
  int refused = 0;
  for (int i = 0; i < 100; ++i) {
    std::string bytes = whole;
    for (int k = 0; k < 1 + i % 3; ++k) bytes[random() % bytes.size()] ^= static_cast<char>(1 << random() % 8);
    const std::string what = read(bytes);
    EXPECT_EQ(what.find('\n'), std::string::npos);
    refused += what.empty() ? 0 : 1;
  }
  EXPECT_GT(refused, 20);
}

TEST_F(DamagedVdb, OfPointsIsReadOrRefusedWithOneLine) {
  points_ = true;
  const std::string whole = packed_points(30);
  EXPECT_EQ(read(whole), "");
  std::mt19937 random(8);
  for (int i = 0; i < 1000; ++i) {
    std::string bytes = whole;
    // The attributes are at the end.
    const std::size_t from = i % 2 == 0 ? 0 : bytes.size() / 2;
    for (int k = 0; k < 1 + i % 3; ++k)
      bytes[from + random() % (bytes.size() - from)] ^= static_cast<char>(1 << random() % 8);
    EXPECT_EQ(read(bytes).find('\n'), std::string::npos);
  }
}

TEST_F(DamagedVdb, IsNotBelievedAboutItsLengths) {
  const std::string whole = every_kind(true);
  std::string bytes = whole;
  const std::size_t name = bytes.find("surface");
  const std::uint32_t huge = 0xF0000000;
  bytes.replace(name - 4, 4, reinterpret_cast<const char*>(&huge), 4);
  EXPECT_THAT(read(bytes), HasSubstr("a text of 4026531840 bytes"));
  bytes = whole;
  const std::size_t half = bytes.find("_HalfFloat");
  bytes[half] = 'x';
  EXPECT_NE(read(bytes), "");
}

TEST_F(DamagedVdb, IsNotBelievedAboutItsPrecision) {
  // OpenVDB asks such an entry of any type whether it holds.
  std::string bytes = every_kind(false);
  const std::size_t name = bytes.find("is_saved_as_half_float");
  ASSERT_NE(name, std::string::npos);
  bytes.replace(bytes.find("bool", name), 4, "int3");
  EXPECT_THAT(read(bytes), HasSubstr("is_saved_as_half_float is of type int3"));
}

}  // namespace
}  // namespace lamina::volume
