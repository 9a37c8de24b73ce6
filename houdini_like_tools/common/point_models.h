// Point clouds in pictures, streamed or held, in their own colours or painted.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "common/model.h"
#include "lamina/points.h"
#include "lamina/volume_points.h"

namespace lamina::tools {

/// Values as colours. The scale is known once every value was seen.
class Painter {
 public:
  Painter(PaintOptions options, std::string path, const RunContext& context);

  void see(const SampleBatch& points, const AttributeLayout& layout) { scale_.add(values(points, layout)); }
  /// The scale, in words for the user too.
  void choose_scale();
  void paint(SampleBatch& points, AttributeLayout& layout) const;

 private:
  /// Throws Error(usage) naming what there is, when what is to be painted is not there.
  [[nodiscard]] std::vector<double> values(const SampleBatch& points, const AttributeLayout& layout) const;

  PaintOptions options_;
  std::string path_;
  const RunContext& context_;
  std::unique_ptr<DistanceField> reference_;
  PaintScale scale_;
  PaintRange range_;
};

/// What the colours mean, to the user.
void say_scale(const std::string& what, const PaintRange& range, double least, double most, const RunContext& context);

/// What --paint distance measures from: a mesh, or a .vdb level set, meshed.
TriangleMesh read_reference(const std::string& path, const RunContext& context);

std::unique_ptr<Model> streamed_points(const std::string& path, const PaintOptions& paint, const RunContext& context);
/// `what`: "1200 points".
std::unique_ptr<Model> held_points(PointArrays points, std::string what, const std::string& path,
                                   const PaintOptions& paint, const RunContext& context);

}  // namespace lamina::tools
