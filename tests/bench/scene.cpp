#include "bench/scene.h"

#include <algorithm>
#include <array>

#include "lamina/scatter.h"

namespace lamina::bench {
namespace {

class MemorySource final : public PointSource {
 public:
  MemorySource(const Surface& surface, std::uint64_t count) {
    info_.path = "memory";
    info_.count = count;
    info_.has_normals = info_.random_access = true;
    const bool colours = surface.has_colour();
    if (colours) {
      for (const char* name : {"red", "green", "blue"}) info_.attributes.push_back({name, ScalarType::uint8});
    }
    all_.attributes.resize(info_.attributes.size());
    for (std::uint64_t i = 0; i < count; ++i) {
      const Surface::Point p = surface.point(1, i, 0);
      all_.x.push_back(p.position[0]);
      all_.y.push_back(p.position[1]);
      all_.z.push_back(p.position[2]);
      all_.nx.push_back(static_cast<float>(p.normal[0]));
      all_.ny.push_back(static_cast<float>(p.normal[1]));
      all_.nz.push_back(static_cast<float>(p.normal[2]));
      for (std::size_t c = 0; c < all_.attributes.size(); ++c) all_.attributes[c].push_back(p.colour[c]);
    }
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const auto end = std::min<std::uint64_t>(info_.count, first + count);
    const auto copy = [&](const auto& from, auto& to) {
      to.assign(from.begin() + static_cast<std::ptrdiff_t>(first), from.begin() + static_cast<std::ptrdiff_t>(end));
    };
    out.first = first;
    copy(all_.x, out.x);
    copy(all_.y, out.y);
    copy(all_.z, out.z);
    copy(all_.nx, out.nx);
    copy(all_.ny, out.ny);
    copy(all_.nz, out.nz);
    out.attributes.resize(all_.attributes.size());
    for (std::size_t c = 0; c < all_.attributes.size(); ++c) copy(all_.attributes[c], out.attributes[c]);
  }

 private:
  SampleBatch all_;
};

}  // namespace

std::unique_ptr<PointSource> scattered(const std::string& shape, std::uint64_t count, bool colours) {
  return std::make_unique<MemorySource>(*shape_surface(shape, colours), count);
}

Scene make_scene(const std::string& shape, std::uint64_t count, bool colours, const std::string& folder) {
  Scene s;
  s.folder = folder;
  s.source = scattered(shape, count, colours);
  s.settings.input = shape;
  const Survey survey = survey_input(*s.source, s.settings.bad_samples, {});
  const Frame frame = choose_frame(survey, s.settings.frame.value_or(FrameMode::pca));
  s.cloud =
      std::make_unique<StoredCloud>(StoredCloud{s.source->info(), frame, ingest(*s.source, survey, frame, folder, {})});
  s.plan = make_plan(s.settings, *s.cloud,
                     {survey_radii(s.cloud->ingested.store, kSurveySamples, s.settings.density), false, {}});
  return s;
}

}  // namespace lamina::bench
