#include "render/view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::render_detail {
namespace {

constexpr double kMargin = 0.94;      // share of a tile that the model may fill
constexpr int kMostFramedTurns = 24;  // between two of them a model reaches less than the margin further out

void aim(const RenderSettings& settings, double azimuth, View& view) {
  const Eigen::Vector3d up = Eigen::Vector3d::Unit(settings.up);
  const Eigen::Vector3d front =
      settings.up == 2 ? Eigen::Vector3d(-Eigen::Vector3d::UnitY()) : Eigen::Vector3d::UnitZ();
  const double a = azimuth * std::numbers::pi / 180, e = settings.elevation * std::numbers::pi / 180;
  const Eigen::Vector3d level = std::cos(a) * front + std::sin(a) * up.cross(front);
  view.toward = (std::cos(e) * level + std::sin(e) * up).normalized();
  view.right = up.cross(level).normalized();
  view.up = view.toward.cross(view.right);
}

}  // namespace

void Extent::add(const View& view, const std::array<double, 3>& p) {
  const Eigen::Vector3d v(p[0], p[1], p[2]);
  const Eigen::Vector3d along(view.right.dot(v), view.up.dot(v), view.toward.dot(v));
  low_ = low_.cwiseMin(along);
  high_ = high_.cwiseMax(along);
}

Eigen::Vector3d Extent::middle(const View& view) const {
  if (empty()) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d m = 0.5 * (low_ + high_);
  return m[0] * view.right + m[1] * view.up + m[2] * view.toward;
}

std::vector<View> make_views(const RenderSettings& settings, double turned) {
  std::vector<View> views(static_cast<std::size_t>(settings.views));
  const int columns = static_cast<int>(std::ceil(std::sqrt(settings.views)));
  const int rows = (settings.views + columns - 1) / columns;
  const int width = settings.width * settings.supersample, height = settings.height * settings.supersample;
  for (int i = 0; i < settings.views; ++i) {
    View& view = views[static_cast<std::size_t>(i)];
    aim(settings, settings.azimuth + turned + 360.0 * i / settings.views, view);
    const int column = i % columns, row = i / columns;
    view.tile.x = column * width / columns;
    view.tile.y = row * height / rows;
    view.tile.width = (column + 1) * width / columns - view.tile.x;
    view.tile.height = (row + 1) * height / rows - view.tile.y;
  }
  return views;
}

std::vector<View> framing_views(const RenderSettings& settings) {
  std::vector<View> views;
  const int turns = std::min(settings.frames, kMostFramedTurns);
  for (int i = 0; i < turns; ++i) {
    const std::vector<View> more = make_views(settings, 360.0 * i / turns);
    views.insert(views.end(), more.begin(), more.end());
  }
  return views;
}

void fit_views(const RenderSettings& settings, const std::vector<View>& framing, const std::vector<Extent>& extents,
               std::vector<View>& views) {
  double scale = std::numeric_limits<double>::infinity();
  const auto fits = [&](double samples, double size) {
    if (size > 0) scale = std::min(scale, kMargin * samples / size);
  };
  if (settings.frames > 1 && !settings.zoom) {
    // One centre on the axis of the turn, so that nothing sways.
    const Eigen::Vector3d centre = extents[0].middle(framing[0]);
    for (std::size_t i = 0; i < framing.size(); ++i) {
      fits(framing[i].tile.width, 2 * extents[i].reach(0, framing[i].right.dot(centre)));
      fits(framing[i].tile.height, 2 * extents[i].reach(1, framing[i].up.dot(centre)));
    }
    for (View& view : views) {
      view.centre = centre;
      view.scale = std::isfinite(scale) ? scale : 1;
    }
    return;
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    View& view = views[i];
    if (settings.zoom) {
      const auto& c = settings.zoom->centre;
      view.centre = {c[0], c[1], c[2]};
      view.near = static_cast<float>(settings.zoom->radius);
      scale = std::min(scale, std::min(view.tile.width, view.tile.height) / (2 * settings.zoom->radius));
    } else {
      view.centre = extents[i].middle(view);
      fits(view.tile.width, extents[i].size(0));
      fits(view.tile.height, extents[i].size(1));
    }
  }
  for (View& view : views) view.scale = std::isfinite(scale) ? scale : 1;
}

}  // namespace lamina::render_detail
