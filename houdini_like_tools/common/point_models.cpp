#include "common/point_models.h"

#include <fmt/format.h>

#include <utility>

#include "common/inputs.h"
#include "common/text.h"
#include "lamina/error.h"
#include "lamina/info.h"
#include "lamina/volume.h"

namespace lamina::tools {
namespace {

constexpr std::size_t kBatch = std::size_t{1} << 20;  // points held at a time

class StreamedPoints : public Model {
 public:
  StreamedPoints(const std::string& path, const PaintOptions& paint, const RunContext& context)
      : source_(open_point_input(path, {}, context)), context_(context) {
    if (source_->info().count == 0) throw Error(ExitCode::empty, fmt::format("{}: no points to draw", path));
    if (!paint.what.empty()) painter_ = std::make_unique<Painter>(paint, path, context);
  }
  void frame(Renderer& renderer) override {
    for_batches("frame", [&](const SampleBatch& batch) {
      renderer.frame(batch);
      if (painter_) painter_->see(batch, source_->info().attributes);
    });
    if (painter_) painter_->choose_scale();
  }
  void draw(Renderer& renderer) override {
    for_batches("draw", [&](SampleBatch& batch) {
      AttributeLayout layout = source_->info().attributes;
      if (painter_) painter_->paint(batch, layout);
      renderer.draw(batch, layout);
    });
  }
  [[nodiscard]] std::string what() const override { return count_text(source_->info().count) + " points"; }

 private:
  /// Every batch of the file, with progress.
  template <class Take>
  void for_batches(std::string_view stage, const Take& take) {
    SampleBatch batch;
    const std::uint64_t total = source_->info().count;
    for (std::uint64_t first = 0; first < total;) {
      if (context_.cancelled()) throw Error(ExitCode::internal, "cancelled");
      source_->read(first, kBatch, batch);
      first += batch.size();
      take(batch);
      if (context_.progress) context_.progress({stage, first, total, 0, 0});
    }
  }
  std::unique_ptr<PointSource> source_;
  std::unique_ptr<Painter> painter_;
  const RunContext& context_;
};

class HeldPoints : public Model {
 public:
  HeldPoints(PointArrays points, std::string what) : points_(std::move(points)), what_(std::move(what)) {}
  void frame(Renderer& renderer) override { renderer.frame(points_.samples); }
  void draw(Renderer& renderer) override { renderer.draw(points_.samples, points_.layout); }
  [[nodiscard]] std::string what() const override { return what_; }

 private:
  PointArrays points_;
  std::string what_;
};

}  // namespace

Painter::Painter(PaintOptions options, std::string path, const RunContext& context)
    : options_(std::move(options)), path_(std::move(path)), context_(context) {
  if (options_.what == "distance")
    reference_ = std::make_unique<DistanceField>(read_reference(options_.reference, context));
}

std::vector<double> Painter::values(const SampleBatch& points, const AttributeLayout& layout) const {
  if (reference_) return reference_->of(points, context_);
  std::vector<double> values = point_values(points, layout, options_.what);
  if (values.size() == points.size()) return values;
  std::string names;
  if (!points.radius.empty()) names += ", radius";
  if (!points.quality.empty()) names += ", quality";
  for (const AttributeSpec& a : layout) names += ", " + a.name;
  throw Error(ExitCode::usage,
              fmt::format("{}: --paint {}: the points have no such attribute; there is distance (with --reference){}",
                          shown_name(path_), options_.what, names.empty() ? ", nothing else" : names));
}

void Painter::choose_scale() {
  range_ = options_.range ? *options_.range : scale_.range();
  say_scale(options_.what, range_, scale_.least(), scale_.most(), context_);
}

void Painter::paint(SampleBatch& points, AttributeLayout& layout) const {
  const std::vector<double> of = values(points, layout);
  lamina::paint(points, layout, of, range_);
}

void say_scale(const std::string& what, const PaintRange& range, double least, double most, const RunContext& context) {
  context.info(fmt::format(
      "painted {}: dark blue {:.4g}, turquoise {:.4g}, yellow-green {:.4g}, orange {:.4g}, dark red "
      "{:.4g}; values lie between {:.4g} and {:.4g}",
      what, range.low, range.low + 0.25 * (range.high - range.low), range.low + 0.5 * (range.high - range.low),
      range.low + 0.75 * (range.high - range.low), range.high, least, most));
}

TriangleMesh read_reference(const std::string& path, const RunContext& context) {
  if (path != "-" && content_of(path, context.tmp_dir) == FileContent::volume)
    return mesh_level_set(read_level_set(path), {}, context);
  return read_mesh_input(path, context);
}

std::unique_ptr<Model> streamed_points(const std::string& path, const PaintOptions& paint, const RunContext& context) {
  return std::make_unique<StreamedPoints>(path, paint, context);
}

std::unique_ptr<Model> held_points(PointArrays points, std::string what, const std::string& path,
                                   const PaintOptions& paint, const RunContext& context) {
  if (!paint.what.empty()) {
    Painter painter(paint, path, context);
    painter.see(points.samples, points.layout);
    painter.choose_scale();
    painter.paint(points.samples, points.layout);
  }
  return std::make_unique<HeldPoints>(std::move(points), std::move(what));
}

}  // namespace lamina::tools
