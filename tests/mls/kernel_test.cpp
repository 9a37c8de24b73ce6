#include "mls/kernel.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdlib>
#include <random>
#include <string>

#include "lamina/error.h"

namespace lamina {
namespace {

Lanes random_lanes(std::mt19937_64& random, double low, double high) {
  Lanes out{};
  for (float& f : out.v) f = static_cast<float>(std::uniform_real_distribution<double>(low, high)(random));
  return out;
}

TileSamples random_samples(std::mt19937_64& random, std::size_t n, std::size_t attributes) {
  TileSamples s;
  s.resize(n, attributes);
  const auto number = [&](double low, double high) {
    return static_cast<float>(std::uniform_real_distribution<double>(low, high)(random));
  };
  for (std::size_t i = 0; i < n; ++i) {
    TileSample one{};
    for (float* v : {&one.x, &one.y, &one.z}) *v = number(-3, 11);
    for (float* v : {&one.nx, &one.ny, &one.nz}) *v = number(-1, 1);
    one.support = number(1, 4);
    one.inv_support2 = 1.0F / (one.support * one.support);
    one.inv_band2 = 1.0F / (1.75F * 1.75F);
    one.weight = number(0.1, 2);
    s.put(i, one);
    for (auto& a : s.attributes) a[i] = number(0, 255);
  }
  return s;
}

bool same_bits(const Lanes& a, const Lanes& b) {
  for (int l = 0; l < kLanes; ++l) {
    if (std::bit_cast<std::uint32_t>(a[l]) != std::bit_cast<std::uint32_t>(b[l])) return false;
  }
  return true;
}

std::vector<Lanes> sums_of(const Kernel& kernel, const TileSamples& s, const std::vector<SampleRange>& ranges,
                           const Queries& q) {
  std::vector<Lanes> sums(kSums + s.attributes.size(), Lanes{});
  sums[kNearest].v.fill(1e30F);
  kernel.accumulate(s, ranges.data(), static_cast<int>(ranges.size()), q, sums.data());
  return sums;
}

/// Queries in a box of this side: the smaller, the more samples act on none of them.
class KernelSums : public testing::TestWithParam<double> {};

TEST_P(KernelSums, AreTheDefinition) {
  std::mt19937_64 random(1);
  for (const std::size_t attributes : {0U, 1U, 2U, 3U, 5U}) {
    const TileSamples s = random_samples(random, 200, attributes);
    const auto lanes = [&] { return random_lanes(random, 4 - GetParam() / 2, 4 + GetParam() / 2); };
    const Queries q{lanes(), lanes(), lanes()};
    const std::vector<SampleRange> ranges{{3, 50}, {60, 60}, {70, 199}};
    const std::vector<Lanes> sums = sums_of(available_kernels().back(), s, ranges, q);
    for (int l = 0; l < kLanes; ++l) {
      std::vector<double> expected(sums.size(), 0.0);
      std::vector<double> magnitude = expected;
      double nearest = 1e30;
      int seen = 0;
      for (const SampleRange& r : ranges) {
        for (std::uint32_t i = r.begin; i < r.end; ++i) {
          const double dx = static_cast<double>(s.all[i].x) - q.x[l];
          const double dy = static_cast<double>(s.all[i].y) - q.y[l];
          const double dz = static_cast<double>(s.all[i].z) - q.z[l];
          const double d2 = dx * dx + dy * dy + dz * dz;
          const double t = 1 - d2 / (static_cast<double>(s.all[i].support) * s.all[i].support);
          if (t <= 0) continue;
          ++seen;
          const double w = s.all[i].weight * std::pow(t, 4);
          nearest = std::min(nearest, d2 / (1.75 * 1.75));
          const auto add = [&](int sum, double value) {
            expected[sum] += w * value;
            magnitude[sum] +=
                w * std::abs(value) + s.all[i].weight * 1e-2;  // far samples weigh little, with larger errors
          };
          add(kW, 1);
          add(kPx, dx);
          add(kPy, dy);
          add(kPz, dz);
          add(kNx, s.all[i].nx);
          add(kNy, s.all[i].ny);
          add(kNz, s.all[i].nz);
          add(kPP, d2);
          add(kPN, dx * s.all[i].nx + dy * s.all[i].ny + dz * s.all[i].nz);
          add(kWR, s.all[i].support);
          for (std::size_t a = 0; a < attributes; ++a) add(kSums + static_cast<int>(a), s.attributes[a][i]);
        }
      }
      EXPECT_EQ(sums[kSeen][l], static_cast<float>(seen));
      EXPECT_NEAR(sums[kNearest][l], nearest, 1e-5 * nearest + 1e-6);
      for (const int sum : {kW, kPx, kPy, kPz, kNx, kNy, kNz, kPP, kPN, kWR}) {
        EXPECT_NEAR(sums[sum][l], expected[sum], 1e-4 * magnitude[sum]) << "sum " << sum;
      }
      for (std::size_t a = 0; a < attributes; ++a) {
        EXPECT_NEAR(sums[kSums + a][l], expected[kSums + a], 1e-4 * magnitude[kSums + a]) << "attribute " << a;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sides, KernelSums, testing::Values(8.0, 2.0, 0.0));

TEST(Kernel, SheetsAreSumsOverARegionOfNormals) {
  std::mt19937_64 random(7);
  const TileSamples s = random_samples(random, 150, 0);
  const auto axes = [&] {
    return Queries{random_lanes(random, -1, 1), random_lanes(random, -1, 1), random_lanes(random, -1, 1)};
  };
  const Queries q{random_lanes(random, 2, 6), random_lanes(random, 2, 6), random_lanes(random, 2, 6)};
  NormalRegion region{axes(), axes(), random_lanes(random, -1, 0.5), random_lanes(random, -1, 0.5)};
  region.first.x[0] = region.first.y[0] = region.first.z[0] = region.first_least[0] = 0;  // takes all
  const std::vector<SampleRange> ranges{{0, 40}, {50, 150}};
  std::vector<std::vector<Lanes>> of_kernels;
  for (const Kernel& kernel : available_kernels()) {
    std::vector<Lanes> sums(kSheetSums + kMoments + 1, Lanes{});
    kernel.accumulate_sheet(s, ranges.data(), 2, q, region, sums.data());
    kernel.accumulate_moments(s, ranges.data(), 2, q, region, &sums[kSheetSums]);
    of_kernels.push_back(sums);
    for (std::size_t k = 0; k < sums.size(); ++k) EXPECT_TRUE(same_bits(sums[k], of_kernels[0][k])) << kernel.name;
  }
  for (int l = 0; l < kLanes; ++l) {
    std::vector<double> expected(kSheetSums + kMoments + 1, 0.0);
    for (const SampleRange& r : ranges) {
      for (std::uint32_t i = r.begin; i < r.end; ++i) {
        const std::array<double, 3> d{double{s.all[i].x} - q.x[l], double{s.all[i].y} - q.y[l],
                                      double{s.all[i].z} - q.z[l]};
        const std::array<double, 3> n{s.all[i].nx, s.all[i].ny, s.all[i].nz};
        const auto along = [&](const Queries& a) { return n[0] * a.x[l] + n[1] * a.y[l] + n[2] * a.z[l]; };
        const double d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        const double t = 1 - d2 / (double{s.all[i].support} * s.all[i].support);
        if (t <= 0 || along(region.first) < region.first_least[l] || along(region.second) < region.second_least[l])
          continue;
        const double w = s.all[i].weight * std::pow(t, 4);
        const double pn = d[0] * n[0] + d[1] * n[1] + d[2] * n[2];
        const std::array<double, kSheetSums> own{w,        w * d[0], w * d[1],   w * d[2], w * n[0],
                                                 w * n[1], w * n[2], w * d2,     w * pn,   w * s.all[i].support,
                                                 0,        0,        w * pn * pn};
        for (std::size_t k = 0; k < own.size(); ++k) expected[k] += own[k];
        const std::array<double, kMoments + 1> moments{
            w * n[0] * n[0], w * n[0] * n[1], w * n[0] * n[2], w * n[1] * n[1], w * n[1] * n[2], w * n[2] * n[2], w};
        for (std::size_t k = 0; k < moments.size(); ++k) expected[kSheetSums + k] += moments[k];
      }
    }
    for (std::size_t k = 0; k < expected.size(); ++k) {
      EXPECT_NEAR(of_kernels[0][k][l], expected[k], 1e-3 * (1 + std::abs(expected[k]))) << "sum " << k;
    }
  }
}

TEST(Kernel, SamplesThatFaceAwayDoNotCount) {
  std::mt19937_64 random(5);
  const TileSamples s = random_samples(random, 120, 1);
  const Queries q{random_lanes(random, 2, 6), random_lanes(random, 2, 6), random_lanes(random, 2, 6)};
  Queries facing{random_lanes(random, -1, 1), random_lanes(random, -1, 1), random_lanes(random, -1, 1)};
  facing.x[0] = facing.y[0] = facing.z[0] = 0;  // no side: all count
  const SampleRange all{0, 120};
  for (const Kernel& kernel : available_kernels()) {
    std::vector<Lanes> sums(kSums + 1, Lanes{});
    sums[kNearest].v.fill(1e30F);
    kernel.accumulate_facing(s, &all, 1, q, facing, sums.data());
    for (int l = 0; l < kLanes; ++l) {
      TileSamples kept;
      kept.resize(0, 1);
      for (std::uint32_t i = 0; i < 120; ++i) {
        if (s.all[i].nx * facing.x[l] + s.all[i].ny * facing.y[l] + s.all[i].nz * facing.z[l] < 0) continue;
        const auto n = kept.all.size();
        kept.resize(n + 1, 1);
        kept.put(n, s.all[i]);
        kept.attributes[0][n] = s.attributes[0][i];
      }
      const auto expected = sums_of(kernel, kept, {{0, static_cast<std::uint32_t>(kept.all.size())}}, q);
      for (std::size_t c = 0; c < sums.size(); ++c) EXPECT_EQ(sums[c][l], expected[c][l]) << "sum " << c;
    }
  }
}

TEST(Kernel, SamplesOutOfReachChangeNothing) {
  // What tiles and rows bring along beside the samples that contribute must not show in any bit.
  std::mt19937_64 random(2);
  TileSamples s = random_samples(random, 100, 1);
  const Queries q{random_lanes(random, 3, 5), random_lanes(random, 3, 5), random_lanes(random, 3, 5)};
  for (std::size_t i = 50; i < 100; ++i) {
    TileSample one = s.all[i];
    one.x = 4 + (i % 2 == 0 ? 3.0F : -3.0F);  // two to four cells away: in the band at most
    one.support = 1.5F;
    one.inv_support2 = 1.0F / (1.5F * 1.5F);
    one.inv_band2 = 1.0F / 25.0F;
    s.put(i, one);
  }
  for (const Kernel& kernel : available_kernels()) {
    const auto with = sums_of(kernel, s, {{0, 100}}, q);
    const auto without = sums_of(kernel, s, {{0, 50}}, q);
    for (std::size_t i = 0; i < with.size(); ++i) EXPECT_TRUE(same_bits(with[i], without[i])) << "sum " << i;
  }
}

TEST(Kernel, WithoutNarrowBandsWhatContributesIsNear) {
  std::mt19937_64 random(4);
  for (const Kernel& kernel : available_kernels()) {
    TileSamples s = random_samples(random, 60, 3);
    const Queries q{random_lanes(random, -1, 9), random_lanes(random, -1, 9), random_lanes(random, -1, 9)};
    const std::vector<Lanes> banded = sums_of(kernel, s, {{0, 60}}, q);
    s.banded = false;
    const std::vector<Lanes> free = sums_of(kernel, s, {{0, 60}}, q);
    int seen = 0;
    for (int l = 0; l < kLanes; ++l) {
      EXPECT_EQ(free[kNearest][l], banded[kSeen][l] > 0 ? 0.0F : 1e30F);
      seen += banded[kSeen][l] > 0 ? 1 : 0;
    }
    EXPECT_GT(seen, 0);
    for (std::size_t i = 0; i < free.size(); ++i) {
      EXPECT_TRUE(i == kNearest || same_bits(free[i], banded[i])) << "sum " << i;
    }
  }
}

TEST(Kernel, AllKindsGiveTheSameBits) {
  const std::vector<Kernel> kernels = available_kernels();
  std::mt19937_64 random(3);
  for (int round = 0; round < 200; ++round) {
    const auto n = static_cast<std::size_t>(random() % 60);
    TileSamples s = random_samples(random, n, random() % 5);
    s.banded = random() % 2 == 0;
    const Queries q{random_lanes(random, -1, 9), random_lanes(random, -1, 9), random_lanes(random, -1, 9)};
    const auto middle = static_cast<std::uint32_t>(n == 0 ? 0 : random() % n);
    const std::vector<SampleRange> ranges{{0, middle}, {middle, static_cast<std::uint32_t>(n)}};
    const std::vector<Lanes> sums = sums_of(kernels.front(), s, ranges, q);
    const FitInput in{round % 2 == 0,
                      {random_lanes(random, -1, 1), random_lanes(random, -1, 1), random_lanes(random, -1, 1)}};
    FitOutput fit{};
    kernels.front().fit(sums.data(), in, fit);
    for (const Kernel& kernel : kernels) {
      const std::vector<Lanes> other = sums_of(kernel, s, ranges, q);
      for (std::size_t i = 0; i < sums.size(); ++i) ASSERT_TRUE(same_bits(sums[i], other[i])) << kernel.name;
      FitOutput out{};
      kernel.fit(sums.data(), in, out);
      for (const auto member : {&FitOutput::distance, &FitOutput::nx, &FitOutput::ny, &FitOutput::nz,
                                &FitOutput::curvature, &FitOutput::offset_from_mean}) {
        ASSERT_TRUE(same_bits(fit.*member, out.*member)) << kernel.name;
      }
    }
  }
}

/// LAMINA_KERNEL for the life of the object.
class WantedKernel {
 public:
  explicit WantedKernel(const char* name) {
    if (const char* old = std::getenv("LAMINA_KERNEL")) old_ = old;
    ::setenv("LAMINA_KERNEL", name, 1);
  }
  ~WantedKernel() { old_.empty() ? ::unsetenv("LAMINA_KERNEL") : ::setenv("LAMINA_KERNEL", old_.c_str(), 1); }
  WantedKernel(const WantedKernel&) = delete;
  WantedKernel& operator=(const WantedKernel&) = delete;

 private:
  std::string old_;
};

TEST(Kernel, IsChosenByTheEnvironment) {
  const std::vector<Kernel> kernels = available_kernels();
  ASSERT_FALSE(kernels.empty());
  for (const Kernel& k : kernels) {
    const std::string name = k.name;
    const WantedKernel wanted(name.substr(name.size() - 2).c_str());
    EXPECT_EQ(select_kernel().name, name);
  }
  {
    const WantedKernel none("");
    EXPECT_STREQ(select_kernel().name, kernels.back().name);
  }
  const WantedKernel unknown("v9");
  EXPECT_THROW((void)select_kernel(), Error);
}

}  // namespace
}  // namespace lamina
