// From the file to radii: reading points, the slab store, the density radii.
#include <cstdio>
#include <optional>

#include "bench/benches.h"
#include "bench/measure.h"
#include "lamina/scatter.h"
#include "samples/radius_estimator.h"
#include "samples/sampling_survey.h"
#include "store/slab_store.h"

namespace lamina::bench {
namespace {

constexpr std::size_t kRows = 1u << 15;

std::unique_ptr<PointSource> point_file(const Scene& scene) {
  const std::string path = scene.folder + (scene.attributes() > 0 ? "/colour.ply" : "/plain.ply");
  ScatterSettings settings;
  settings.count = scene.samples();
  scatter(*shape_surface(scene.settings.input, scene.attributes() > 0), settings, path);
  return open_points(path);
}

void read_points(benchmark::State& state, const Scene& scene) {
  SampleBatch batch;
  measure(
      state, scene.samples(), [&] { return point_file(scene); },
      [&](const std::unique_ptr<PointSource>& source) {
        for (std::uint64_t row = 0; row < scene.samples(); row += kRows) source->read(row, kRows, batch);
      });
}

void read_store(const SlabStore& store) {
  LocalSamples samples;
  for (std::size_t b = 0; b < store.buckets(); ++b) store.read(b, samples);
}

/// All of the store's samples in the order of the input's rows, more or less: bucket by bucket in small turns, so that
/// the writer has them all open as with a cloud in random order.
std::vector<LocalSamples> pieces(const SlabStore& store) {
  std::vector<LocalSamples> out;
  LocalSamples all;
  for (std::size_t b = 0; b < store.buckets(); ++b) {
    store.read(b, all);
    constexpr std::size_t kPiece = 512;
    for (std::size_t i = 0; i < all.size(); i += kPiece) {
      LocalSamples p;
      const auto cut = [&](const auto& from, auto& to) {
        if (from.empty()) return;
        to.assign(from.begin() + static_cast<std::ptrdiff_t>(i),
                  from.begin() + static_cast<std::ptrdiff_t>(std::min(from.size(), i + kPiece)));
      };
      cut(all.x, p.x);
      cut(all.y, p.y);
      cut(all.z, p.z);
      cut(all.nx, p.nx);
      cut(all.ny, p.ny);
      cut(all.nz, p.nz);
      p.attributes.resize(all.attributes.size());
      for (std::size_t c = 0; c < all.attributes.size(); ++c) cut(all.attributes[c], p.attributes[c]);
      out.push_back(std::move(p));
    }
  }
  // Strides through the list take turns among the buckets.
  std::vector<LocalSamples> shuffled;
  constexpr std::size_t kStride = 61;
  for (std::size_t start = 0; start < kStride; ++start) {
    for (std::size_t k = start; k < out.size(); k += kStride) shuffled.push_back(std::move(out[k]));
  }
  return shuffled;
}

void write_store(benchmark::State& state, const Scene& scene) {
  const std::vector<LocalSamples> parts = pieces(scene.cloud->ingested.store);
  StoreSettings settings;
  settings.directory = scene.folder;
  const Extent& extent = scene.cloud->ingested.extent;
  constexpr std::size_t kBuckets = 64;
  settings.z_min = extent.z_min;
  settings.bucket_height =
      static_cast<std::int32_t>((std::int64_t{extent.z_max} - extent.z_min) / static_cast<std::int64_t>(kBuckets)) + 1;
  settings.buckets = kBuckets;
  std::uint64_t bytes = 0;
  measure(
      state, scene.samples(), [] { return 0; },
      [&](int) {
        SlabStoreWriter writer(scene.cloud->ingested.store.layout(), settings);
        for (const LocalSamples& p : parts) writer.append(p);
        bytes = writer.finish().disk_bytes();
      });
  state.counters["disk_bytes_per_sample"] = static_cast<double>(bytes) / static_cast<double>(scene.samples());
}

/// Radii of every sample; the store is read in between, as in the job, but not timed.
void density_radii(benchmark::State& state, const Scene& scene) {
  const SlabStore& store = scene.cloud->ingested.store;
  std::vector<LocalSamples> buckets(store.buckets());
  for (std::size_t b = 0; b < buckets.size(); ++b) store.read(b, buckets[b]);
  std::vector<float> radii;
  measure(
      state, scene.samples(), [&] { return std::make_unique<RadiusEstimator>(scene.plan.radii); },
      [&](const std::unique_ptr<RadiusEstimator>& estimator) {
        for (const LocalSamples& b : buckets) {
          estimator->push(b);
          while (estimator->pop(radii)) benchmark::DoNotOptimize(radii.data());
        }
        estimator->finish();
        while (estimator->pop(radii)) benchmark::DoNotOptimize(radii.data());
      });
}

}  // namespace

void add_input_benches(const Scene& scene, const std::string& suffix) {
  const auto nothing = [] { return 0; };
  add("read_points" + suffix, [&scene](benchmark::State& s) { read_points(s, scene); });
  add("survey" + suffix, [&scene, nothing](benchmark::State& s) {
    measure(s, scene.samples(), nothing, [&](int) { survey_input(*scene.source, BadSamples::drop, {}); });
  });
  add("ingest" + suffix, [&scene, nothing](benchmark::State& s) {
    const Survey survey = survey_input(*scene.source, BadSamples::drop, {});
    measure(s, scene.samples(), nothing,
            [&](int) { ingest(*scene.source, survey, scene.plan.frame, scene.folder, {}); });
  });
  add("store_write" + suffix, [&scene](benchmark::State& s) { write_store(s, scene); });
  add("store_read" + suffix, [&scene, nothing](benchmark::State& s) {
    measure(s, scene.samples(), nothing, [&](int) { read_store(scene.cloud->ingested.store); });
  });
  if (scene.attributes() > 0) return;
  add("survey_radii", [&scene, nothing](benchmark::State& s) {
    measure(s, scene.samples(), nothing,
            [&](int) { benchmark::DoNotOptimize(survey_radii(scene.cloud->ingested.store, scene.samples())); });
  });
  add("radii", [&scene](benchmark::State& s) { density_radii(s, scene); });
}

}  // namespace lamina::bench
