#include "store/slab_store.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <tbb/parallel_for.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <limits>
#include <random>

#include <sys/resource.h>

#include "lamina/error.h"

namespace lamina {
namespace {

std::string temporary() {
  return ::testing::TempDir();
}

/// Random samples for a layout; attribute values are representable in their types, so that they come back exactly.
LocalSamples random_samples(const StoreLayout& layout, std::size_t n, std::int32_t z_low, std::int32_t z_high,
                            std::mt19937& random) {
  LocalSamples s;
  std::uniform_int_distribution<std::int32_t> wide(std::numeric_limits<std::int32_t>::min(),
                                                   std::numeric_limits<std::int32_t>::max());
  std::uniform_int_distribution<std::int32_t> z(z_low, z_high);
  std::normal_distribution<float> normal;
  s.attributes.resize(layout.attributes.size());
  const bool walk = random() % 2 == 0;  // neighbours in a scan line: differences are stored
  std::int32_t x = wide(random);
  for (std::size_t i = 0; i < n; ++i) {
    x = walk ? static_cast<std::int32_t>(static_cast<std::uint32_t>(x) + random() % 100) : wide(random);
    s.x.push_back(x);
    s.y.push_back(wide(random));
    s.z.push_back(z(random));
    std::array<float, 3> d{normal(random), normal(random), normal(random)};
    const float length = std::hypot(d[0], d[1], d[2]);
    for (float& c : d) c /= length;
    s.nx.push_back(d[0]);
    s.ny.push_back(d[1]);
    s.nz.push_back(d[2]);
    if (layout.has_radius) s.radius.push_back(normal(random));
    if (layout.has_quality) s.quality.push_back(normal(random));
    for (std::size_t a = 0; a < layout.attributes.size(); ++a) {
      const auto type = layout.attributes[a].type;
      const bool real = type == ScalarType::float32 || type == ScalarType::float64;
      s.attributes[a].push_back(real ? normal(random) : static_cast<float>(random() % 128));
    }
  }
  return s;
}

void append_row(const LocalSamples& from, std::size_t i, LocalSamples& to) {
  to.attributes.resize(from.attributes.size());
  to.x.push_back(from.x[i]);
  to.y.push_back(from.y[i]);
  to.z.push_back(from.z[i]);
  to.nx.push_back(from.nx[i]);
  to.ny.push_back(from.ny[i]);
  to.nz.push_back(from.nz[i]);
  if (!from.radius.empty()) to.radius.push_back(from.radius[i]);
  if (!from.quality.empty()) to.quality.push_back(from.quality[i]);
  for (std::size_t a = 0; a < from.attributes.size(); ++a) to.attributes[a].push_back(from.attributes[a][i]);
}

bool close(const std::vector<float>& a, const std::vector<float>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](float p, float q) { return std::abs(p - q) < 5e-7F; });
}

/// All as it was, normals as exactly as floats hold them.
bool same(const LocalSamples& a, const LocalSamples& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z && close(a.nx, b.nx) && close(a.ny, b.ny) && close(a.nz, b.nz) &&
         a.radius == b.radius && a.quality == b.quality && (a.size() == 0 || a.attributes == b.attributes);
}

/// What a store should hold, kept in memory.
std::vector<LocalSamples> expected_buckets(const StoreSettings& settings, const std::vector<LocalSamples>& batches) {
  std::vector<LocalSamples> buckets(settings.buckets);
  for (const auto& batch : batches) {
    for (std::size_t i = 0; i < batch.size(); ++i) {
      std::int64_t b = (static_cast<std::int64_t>(batch.z[i]) - settings.z_min);
      b = b < 0 ? 0
                : std::min<std::int64_t>(b / settings.bucket_height, static_cast<std::int64_t>(settings.buckets) - 1);
      append_row(batch, i, buckets[static_cast<std::size_t>(b)]);
    }
  }
  return buckets;
}

TEST(SlabStore, KeepsEverySampleInOrder) {
  const bool good = rc::check("round trip", [] {
    StoreLayout layout;
    layout.has_radius = *rc::gen::arbitrary<bool>();
    layout.has_quality = *rc::gen::arbitrary<bool>();
    const int attributes = *rc::gen::inRange(0, 5);
    for (int a = 0; a < attributes; ++a) {
      layout.attributes.push_back({std::to_string(a), static_cast<ScalarType>(*rc::gen::inRange(0, 8))});
    }
    StoreSettings settings{temporary(), *rc::gen::inRange(-5000, 5000), *rc::gen::inRange(1, 2000),
                           *rc::gen::inRange<std::size_t>(1, 200), *rc::gen::inRange<std::size_t>(0, 300'000)};
    std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
    std::vector<LocalSamples> batches;
    const int count = *rc::gen::inRange(0, 6);
    for (int b = 0; b < count; ++b) {
      const std::int32_t low = *rc::gen::inRange(-10'000, 10'000);
      batches.push_back(random_samples(layout, *rc::gen::inRange<std::size_t>(0, 3000), low, low + 20'000, random));
    }
    SlabStoreWriter writer(layout, settings);
    for (const auto& batch : batches) writer.append(batch);
    const SlabStore store = writer.finish();
    const auto expected = expected_buckets(settings, batches);
    RC_ASSERT(store.buckets() == expected.size());
    std::uint64_t total = 0;
    LocalSamples out;
    for (std::size_t b = 0; b < expected.size(); ++b) {
      store.read(b, out);
      RC_ASSERT(same(out, expected[b]));
      RC_ASSERT(store.count(b) == out.size());
      total += out.size();
      if (out.size() == 0) continue;
      RC_ASSERT(store.z_lower(b) == *std::min_element(out.z.begin(), out.z.end()));
      RC_ASSERT(store.z_upper(b) == *std::max_element(out.z.begin(), out.z.end()));
    }
    RC_ASSERT(store.total() == total);
  });
  EXPECT_TRUE(good);
}

TEST(SlabStore, TakesTheWholeRangeOfCoordinates) {
  constexpr auto low = std::numeric_limits<std::int32_t>::min();
  constexpr auto high = std::numeric_limits<std::int32_t>::max();
  std::mt19937 random(3);
  const StoreLayout layout;
  std::vector<LocalSamples> batches{random_samples(layout, 2000, low, high, random)};
  batches[0].z[0] = low;
  batches[0].z[1] = high;
  for (const auto& settings :
       {StoreSettings{temporary(), low, 1, 7, 1 << 20}, StoreSettings{temporary(), low, 1 << 20, 4096, 1 << 20},
        StoreSettings{temporary(), high, high, 3, 1 << 20}, StoreSettings{temporary(), 0, high, 2, 0}}) {
    SlabStoreWriter writer(layout, settings);
    writer.append(batches[0]);
    const SlabStore store = writer.finish();
    const auto expected = expected_buckets(settings, batches);
    LocalSamples out;
    for (std::size_t b = 0; b < expected.size(); ++b) {
      store.read(b, out);
      EXPECT_TRUE(same(out, expected[b])) << b;
    }
  }
}

TEST(SlabStore, RoundsAndClampsToTheAttributesType) {
  StoreLayout layout;
  for (const auto type :
       {ScalarType::uint8, ScalarType::int8, ScalarType::uint16, ScalarType::int32, ScalarType::uint32}) {
    layout.attributes.push_back({"a", type});
  }
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  const std::vector<float> in{-1e20F, -inf, -3.6F, -0.4F, 0.6F, 254.4F, 1e20F, inf, nan};
  LocalSamples samples;
  for (auto* a : {&samples.x, &samples.y, &samples.z}) a->assign(in.size(), 0);
  for (auto* a : {&samples.nx, &samples.ny, &samples.nz}) a->assign(in.size(), 1);
  samples.attributes.assign(5, in);
  SlabStoreWriter writer(layout, {temporary(), 0, 1, 1, 1 << 16});
  writer.append(samples);
  LocalSamples out;
  writer.finish().read(0, out);
  EXPECT_EQ(out.attributes[0], (std::vector<float>{0, 0, 0, 0, 1, 254, 255, 255, 0}));
  EXPECT_EQ(out.attributes[1], (std::vector<float>{-128, -128, -4, 0, 1, 127, 127, 127, 0}));
  EXPECT_EQ(out.attributes[2], (std::vector<float>{0, 0, 0, 0, 1, 254, 65535, 65535, 0}));
  EXPECT_EQ(out.attributes[3],
            (std::vector<float>{-2147483648.F, -2147483648.F, -4, 0, 1, 254, 2147483648.F, 2147483648.F, 0}));
  EXPECT_EQ(out.attributes[4], (std::vector<float>{0, 0, 0, 0, 1, 254, 4294967296.F, 4294967296.F, 0}));
}

TEST(SlabStore, ColouredSamplesStayUnderThirtyBytes) {
  StoreLayout layout;
  for (const auto* name : {"red", "green", "blue"}) layout.attributes.push_back({name, ScalarType::uint8});
  std::mt19937 random(5);
  SlabStoreWriter writer(layout, {temporary(), 0, 1000, 64, 4 << 20});
  for (int b = 0; b < 4; ++b) writer.append(random_samples(layout, 50'000, 0, 64'000, random));
  const SlabStore store = writer.finish();
  EXPECT_LE(store.disk_bytes(), 22 * store.total());
}

TEST(SlabStore, GivesBackTheDiskOfBucketsDoneWith) {
  std::mt19937 random(9);
  SlabStoreWriter writer({}, {temporary(), 0, 10, 100, 1 << 18});
  const std::vector<LocalSamples> batches{random_samples({}, 100'000, 0, 1000, random)};
  writer.append(batches[0]);
  SlabStore store = writer.finish();
  const auto expected = expected_buckets({temporary(), 0, 10, 100, 0}, batches);
  const std::uint64_t whole = store.disk_bytes();
  std::uint64_t before = whole;
  LocalSamples out;
  for (std::size_t b = 0; b <= 100; b += 5) {
    store.release_before(b);
    EXPECT_LE(store.disk_bytes(), before);
    before = store.disk_bytes();
    EXPECT_LT(static_cast<double>(before), static_cast<double>(whole) * (1.12 - static_cast<double>(b) / 100));
    for (std::size_t c = b; c < 100; ++c) {
      store.read(c, out);
      ASSERT_TRUE(same(out, expected[c])) << b << ' ' << c;
    }
  }
  EXPECT_EQ(before, 0U);
}

TEST(SlabStore, IsReadFromSeveralThreads) {
  std::mt19937 random(7);
  const StoreLayout layout{true, true, {{"red", ScalarType::uint8}}};
  const StoreSettings settings{temporary(), 0, 100, 50, 1 << 18};
  const std::vector<LocalSamples> batches{random_samples(layout, 60'000, 0, 5000, random)};
  SlabStoreWriter writer(layout, settings);
  writer.append(batches[0]);
  const SlabStore store = writer.finish();
  const auto expected = expected_buckets(settings, batches);
  std::vector<char> good(200, 0);
  tbb::parallel_for(std::size_t{0}, good.size(), [&](std::size_t i) {
    LocalSamples out;
    store.read(i % 50, out);
    good[i] = same(out, expected[i % 50]) ? 1 : 0;
  });
  EXPECT_EQ(std::count(good.begin(), good.end(), 1), 200);
}

/// Runs `f`, which must throw an Error of this code whose message holds all these words.
template <class F>
void expect_error(ExitCode code, std::initializer_list<std::string> words, F&& f) {
  try {
    f();
    ADD_FAILURE() << "no error";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), code) << e.what();
    for (const auto& word : words) EXPECT_NE(std::string(e.what()).find(word), std::string::npos) << e.what();
  }
}

TEST(SlabStore, NamesADirectoryItCannotUse) {
  expect_error(ExitCode::budget, {"/no/such/place", "--tmp-dir"}, [] {
    SlabStoreWriter({}, {"/no/such/place", 0, 1, 1, 1 << 16});
  });
  expect_error(ExitCode::budget, {"/dev/null", "--tmp-dir"}, [] {
    SlabStoreWriter({}, {"/dev/null", 0, 1, 1, 1 << 16});
  });
}

TEST(SlabStore, RefusesSamplesThatDoNotFitTheLayout) {
  std::mt19937 random(1);
  SlabStoreWriter writer({true, false, {}}, {temporary(), 0, 1, 1, 1 << 16});
  expect_error(ExitCode::internal, {"layout"}, [&] { writer.append(random_samples({}, 10, 0, 9, random)); });
  writer.finish();
  expect_error(ExitCode::internal, {"finish"}, [&] { writer.append({}); });
}

TEST(SlabStore, LeavesNothingInItsDirectory) {
  const auto directory = std::filesystem::path(temporary()) / "lamina_store_is_unnamed";
  std::filesystem::create_directory(directory);
  SlabStoreWriter writer({}, {directory.string(), 0, 1, 4, 1 << 16});
  EXPECT_TRUE(std::filesystem::is_empty(directory));
  std::filesystem::remove_all(directory);
}

TEST(SlabStore, SaysWhereTheDiskIsFull) {
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{600'000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  std::mt19937 random(1);
  expect_error(ExitCode::budget, {temporary(), "600000 bytes", "--tmp-dir"}, [&] {
    SlabStoreWriter writer({}, {temporary(), 0, 100, 4, 1 << 16});
    for (int i = 0; i < 20; ++i) writer.append(random_samples({}, 10'000, 0, 400, random));
  });
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
}

/// The descriptor of the one unnamed file in a directory.
int find_unnamed(const std::filesystem::path& directory) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code gone;
    const auto target = std::filesystem::read_symlink(entry.path(), gone).string();
    if (!gone && target.starts_with(directory.string() + "/")) return std::stoi(entry.path().filename().string());
  }
  return -1;
}

TEST(SlabStore, NoticesADamagedFile) {
  const auto directory = std::filesystem::path(temporary()) / "lamina_store_damaged";
  std::filesystem::create_directory(directory);
  std::mt19937 random(1);
  SlabStoreWriter writer({}, {directory.string(), 0, 100, 1, 1 << 20});
  writer.append(random_samples({}, 5000, 0, 99, random));
  const SlabStore store = writer.finish();
  const int file = find_unnamed(directory);
  ASSERT_GE(file, 0);
  const std::vector<char> zeros(200, 0);
  ASSERT_EQ(::pwrite(file, zeros.data(), zeros.size(), 0), 200);
  LocalSamples out;
  expect_error(ExitCode::budget, {directory.string(), "bucket 0", "--tmp-dir"}, [&] { store.read(0, out); });
  ASSERT_EQ(::ftruncate(file, 1000), 0);
  expect_error(ExitCode::budget, {directory.string(), "--tmp-dir"}, [&] { store.read(0, out); });
  std::filesystem::remove_all(directory);
}

TEST(SlabStore, SamplesLeftOutNeverComeBack) {
  std::mt19937 random(11);
  const StoreLayout layout{true, true, {{"red", ScalarType::uint8}}};
  StoreSettings settings;
  settings.directory = temporary();
  settings.bucket_height = 100;
  settings.buckets = 7;
  SlabStoreWriter writer(layout, settings);
  writer.append(random_samples(layout, 5000, 0, 600, random));
  SlabStore store = writer.finish();
  std::vector<LocalSamples> expected(store.buckets());
  for (auto& e : expected) e.attributes.resize(1);
  // Twice, the second time of what the first has left; one bucket loses everything and one nothing.
  for (int round = 0; round < 2; ++round) {
    std::vector<std::vector<bool>> keep(store.buckets());
    for (std::size_t b = 0; b < store.buckets(); ++b) {
      LocalSamples all;
      store.read(b, all);
      expected[b] = {};
      expected[b].attributes.resize(1);
      for (std::size_t i = 0; i < all.size(); ++i) {
        keep[b].push_back(b != 2 && (b == 3 || random() % 3 > 0));
        if (keep[b].back()) append_row(all, i, expected[b]);
      }
    }
    store.keep_only(keep);
  }
  std::uint64_t total = 0;
  for (std::size_t b = 0; b < store.buckets(); ++b) {
    LocalSamples left;
    store.read(b, left);
    EXPECT_TRUE(same(left, expected[b])) << b;
    EXPECT_EQ(store.count(b), expected[b].size());
    total += store.count(b);
    if (expected[b].size() == 0) {
      EXPECT_EQ(store.z_lower(b), std::numeric_limits<std::int32_t>::max());
      continue;
    }
    EXPECT_EQ(store.z_lower(b), *std::min_element(expected[b].z.begin(), expected[b].z.end()));
    EXPECT_EQ(store.z_upper(b), *std::max_element(expected[b].z.begin(), expected[b].z.end()));
  }
  EXPECT_EQ(store.total(), total);
  EXPECT_EQ(store.count(2), 0U);
  EXPECT_GT(store.count(3), 500U);
}

}  // namespace
}  // namespace lamina
