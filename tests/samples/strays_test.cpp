#include "samples/cleaning.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "support/streamed_cloud.h"

namespace lamina::test {
namespace {

constexpr std::int32_t kGap = 4096;  ///< steps between samples

/// A rectangle of samples in the plane z = height, jittered by a third of their spacing, facing up.
void add_plane(LocalSamples& s, int side, double height, std::int32_t gap, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> jitter(-0.33, 0.33);
  for (int i = 0; i < side; ++i) {
    for (int j = 0; j < side; ++j) {
      s.x.push_back(static_cast<std::int32_t>((i + jitter(random)) * gap));
      s.z.push_back(static_cast<std::int32_t>((j + jitter(random)) * gap));
      s.y.push_back(static_cast<std::int32_t>(height * gap));
      s.nx.push_back(0);
      s.ny.push_back(1);
      s.nz.push_back(0);
    }
  }
}

/// Single samples all over the box above a plane, facing anywhere.
void add_dust(LocalSamples& s, int count, int side, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> at(0, side);
  std::normal_distribution<float> towards;
  for (int i = 0; i < count; ++i) {
    s.x.push_back(static_cast<std::int32_t>(at(random) * kGap));
    s.z.push_back(static_cast<std::int32_t>(at(random) * kGap));
    s.y.push_back(static_cast<std::int32_t>((6 + 0.5 * at(random)) * kGap));
    const float x = towards(random), y = towards(random), z = towards(random);
    const float length = std::sqrt(x * x + y * y + z * z);
    s.nx.push_back(x / length);
    s.ny.push_back(y / length);
    s.nz.push_back(z / length);
  }
}

struct Dropped {
  StrayCounts counts;
  std::uint64_t high = 0, low = 0;  ///< above and below y = 3 spacings
};

Dropped drop(const LocalSamples& s, std::int32_t bucket_height, SampleNormals normals = SampleNormals::given) {
  const SlabStore store = make_store(s, bucket_height);
  KeepMasks masks(store.buckets());
  for (std::size_t b = 0; b < masks.size(); ++b) masks[b].assign(store.count(b), true);
  Dropped out;
  out.counts = drop_strays(store, masks, normals, {});
  LocalSamples read;
  for (std::size_t b = 0; b < masks.size(); ++b) {
    if (store.count(b) == 0) continue;
    store.read(b, read);
    for (std::size_t i = 0; i < read.size(); ++i) {
      if (!masks[b][i]) ++(read.y[i] > 3 * kGap ? out.high : out.low);
    }
  }
  EXPECT_EQ(out.high + out.low, out.counts.all());
  return out;
}

TEST(Strays, ASurfaceKeepsItsSamples) {
  LocalSamples s;
  add_plane(s, 100, 0, kGap, 1);
  EXPECT_EQ(drop(s, 1 << 16).counts.all(), 0u);
}

TEST(Strays, DustGoesAndTheSurfaceUnderItStays) {
  LocalSamples s;
  add_plane(s, 100, 0, kGap, 2);
  add_dust(s, 100, 100, 3);
  const Dropped dropped = drop(s, 1 << 16);
  EXPECT_GE(dropped.high, 80u) << "chance makes a tenth of them look like a surface";
  EXPECT_LE(dropped.low, 5u);
}

TEST(Strays, ManyOutliersFarFromEachOtherGo) {
  LocalSamples s;
  add_plane(s, 150, 0, kGap, 12);
  add_dust(s, 2000, 150, 13);
  const Dropped dropped = drop(s, 1 << 16);
  EXPECT_GE(dropped.high, 1700u) << "nine in ten; chance has some on a plane";
  EXPECT_LE(dropped.low, 5u);
}

TEST(Strays, AreToldByPositionsAloneWhereThereAreNoNormals) {
  LocalSamples s;
  add_plane(s, 100, 0, kGap, 14);
  const std::size_t surface = s.size();
  add_dust(s, 300, 100, 15);
  s.nx.assign(s.size(), 0);
  s.ny.assign(s.size(), 0);
  s.nz.assign(s.size(), 1);
  const Dropped dropped = drop(s, 1 << 16, SampleNormals::none);
  EXPECT_LE(dropped.low, surface / 1000);
  EXPECT_GE(dropped.high, 200u);
}

// Dust whose normals agree, as those found from its positions do.
LocalSamples plane_in_agreeing_dust() {
  LocalSamples s;
  add_plane(s, 150, 0, kGap, 16);
  const std::size_t surface = s.size();
  add_dust(s, 2000, 150, 17);
  std::fill(s.nx.begin() + static_cast<std::ptrdiff_t>(surface), s.nx.end(), 0.0F);
  std::fill(s.ny.begin() + static_cast<std::ptrdiff_t>(surface), s.ny.end(), 1.0F);
  std::fill(s.nz.begin() + static_cast<std::ptrdiff_t>(surface), s.nz.end(), 0.0F);
  return s;
}

TEST(Strays, FoundNormalsThatAgreeAreNoSurface) {
  const LocalSamples s = plane_in_agreeing_dust();
  const Dropped dropped = drop(s, 1 << 16, SampleNormals::found);
  EXPECT_GE(dropped.high, 1900u);
  EXPECT_LE(dropped.low, 5u);
  EXPECT_LT(drop(s, 1 << 16, SampleNormals::given).high, 1000u) << "measured ones that agree are";
}

TEST(Strays, ClutterGoesWhereThereAreNoNormals) {
  const Dropped dropped = drop(plane_in_agreeing_dust(), 1 << 16, SampleNormals::none);
  EXPECT_GE(dropped.high, 1900u);
  EXPECT_LE(dropped.low, 25u) << "of 22,500";
}

TEST(Strays, AFoundNormalThatIsOffMakesNoStray) {
  LocalSamples s;
  add_plane(s, 100, 0, kGap, 19);
  std::mt19937 random(20);
  std::uniform_real_distribution<float> turn(0, 6.2831853F);
  for (std::size_t i = 0; i < s.size(); i += 10) {
    const float by = turn(random);
    s.nx[i] = 0.985F * std::cos(by);  // 80 degrees off
    s.ny[i] = 0.174F;
    s.nz[i] = 0.985F * std::sin(by);
  }
  const auto given = drop(s, 1 << 16, SampleNormals::given).counts.all();
  const auto found = drop(s, 1 << 16, SampleNormals::found).counts.all();
  EXPECT_GT(given, 300u) << "of 1000 that are off";
  EXPECT_LT(found, given / 10);
}

TEST(Strays, AmongDustASparseSurfaceStays) {
  LocalSamples s = plane_in_agreeing_dust();
  LocalSamples sheet;
  add_plane(sheet, 40, -20, 8 * kGap, 18);
  for (std::size_t i = 0; i < sheet.size(); ++i) {
    s.x.push_back(sheet.x[i]);
    s.y.push_back(sheet.y[i]);
    s.z.push_back(sheet.z[i]);
    s.nx.push_back(0);
    s.ny.push_back(1);
    s.nz.push_back(0);
  }
  const Dropped dropped = drop(s, 1 << 16, SampleNormals::found);
  EXPECT_GE(dropped.high, 1900u);
  EXPECT_LE(dropped.low, 16u) << "of 1600";
}

TEST(Strays, ClutterDoesNotDependOnHowTheStoreIsCut) {
  const LocalSamples s = plane_in_agreeing_dust();
  const Dropped a = drop(s, 1 << 14, SampleNormals::found);
  const Dropped b = drop(s, 1 << 20, SampleNormals::found);
  EXPECT_EQ(a.high, b.high);
  EXPECT_EQ(a.low, b.low);
}

TEST(Strays, ASparseSurfaceBesideADenseOneIsNoStray) {
  LocalSamples s;
  add_plane(s, 100, 0, kGap, 4);
  add_plane(s, 30, 40, 4 * kGap, 5);
  EXPECT_LE(drop(s, 1 << 16).counts.all(), 5u);
}

TEST(Strays, BothFacesOfAThinWallStay) {
  LocalSamples s;
  add_plane(s, 80, 0, kGap, 6);
  const std::size_t one = s.size();
  add_plane(s, 80, 0.5, kGap, 7);
  for (std::size_t i = one; i < s.size(); ++i) s.ny[i] = -1;
  EXPECT_LE(drop(s, 1 << 16).counts.all(), 10u);
}

TEST(Strays, NormalsWithSignsByChanceDropLittle) {
  LocalSamples s;
  add_plane(s, 100, 0, kGap, 8);
  std::mt19937 random(9);
  for (float& n : s.ny) n = (random() & 1) != 0 ? 1.0F : -1.0F;
  EXPECT_LE(drop(s, 1 << 16).counts.all(), 300u) << "of 10,000";
}

TEST(Strays, DoNotDependOnHowTheStoreIsCut) {
  LocalSamples s;
  add_plane(s, 60, 0, kGap, 10);
  add_dust(s, 200, 60, 11);
  const Dropped a = drop(s, 1 << 14);
  const Dropped b = drop(s, 1 << 20);
  EXPECT_EQ(a.high, b.high);
  EXPECT_EQ(a.low, b.low);
}

}  // namespace
}  // namespace lamina::test
