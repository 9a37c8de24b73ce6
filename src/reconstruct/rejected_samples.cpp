#include "reconstruct/rejected_samples.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/error.h"

namespace lamina {
namespace {

constexpr const char* kReasonName = "reason";

void append_sample(const LocalSamples& from, std::size_t i, const Frame& frame, SampleBatch& to) {
  const Eigen::Vector3d p = frame.to_world(Eigen::Vector3d(from.x[i], from.y[i], from.z[i]));
  to.x.push_back(p.x());
  to.y.push_back(p.y());
  to.z.push_back(p.z());
  const Eigen::Vector3d n =
      frame.rotation.transpose() * Eigen::Vector3f(from.nx[i], from.ny[i], from.nz[i]).cast<double>();
  to.nx.push_back(static_cast<float>(n.x()));
  to.ny.push_back(static_cast<float>(n.y()));
  to.nz.push_back(static_cast<float>(n.z()));
  if (!from.radius.empty()) to.radius.push_back(static_cast<float>(static_cast<double>(from.radius[i]) * frame.step));
  if (!from.quality.empty()) to.quality.push_back(from.quality[i]);
  for (std::size_t a = 0; a < from.attributes.size(); ++a) to.attributes[a].push_back(from.attributes[a][i]);
}

}  // namespace

void try_rejected(const SurfaceSettings& settings) {
  if (!settings.rejected.empty() && settings.rejected != "-") open_points_writer(settings.rejected, {});
}

std::unique_ptr<PointsWriter> open_rejected(const StoredCloud& cloud, const SurfaceSettings& settings) {
  PointColumns columns = columns_of(cloud.info);
  columns.normals = true;
  const bool taken = std::any_of(columns.attributes.begin(), columns.attributes.end(),
                                 [](const AttributeSpec& a) { return a.name == kReasonName; });
  if (taken) {
    throw Error(ExitCode::usage, fmt::format("{}: the points have an attribute called {} already; leave out --rejected",
                                             input_name(settings), kReasonName));
  }
  columns.attributes.push_back({kReasonName, ScalarType::uint8});
  PointsWriterSettings how;
  how.crs = cloud.info.crs;
  how.comments = {"reason 1: merged, 2: outlier, 3: stray far from others, 4: stray on no surface, 5: thinned out"};
  return open_points_writer(settings.rejected, columns, how);
}

void write_rejected(const StoredCloud& cloud, const Reasons& reasons, PointsWriter& writer) {
  const SlabStore& store = cloud.ingested.store;
  LocalSamples samples;
  for (std::size_t b = 0; b < reasons.size(); ++b) {
    if (std::all_of(reasons[b].begin(), reasons[b].end(), [](std::uint8_t r) { return r == 0; })) continue;
    store.read(b, samples);
    SampleBatch batch;
    batch.attributes.resize(samples.attributes.size());
    std::vector<float> why;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (reasons[b][i] == 0) continue;
      append_sample(samples, i, cloud.frame, batch);
      why.push_back(static_cast<float>(reasons[b][i]));
    }
    batch.attributes.push_back(std::move(why));
    writer.append(batch);
  }
}

}  // namespace lamina
