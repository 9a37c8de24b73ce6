#include <fmt/format.h>

#include <algorithm>

#include "lamina/error.h"
#include "lamina/volume_points.h"
#include "points/formats.h"
#include "points/input_file.h"
#include "points/point_columns.h"

namespace lamina {
namespace {

bool needs_double(const SampleBatch& rows) {
  const auto wide = [](double v) { return static_cast<double>(static_cast<float>(v)) != v; };
  return std::any_of(rows.x.begin(), rows.x.end(), wide) || std::any_of(rows.y.begin(), rows.y.end(), wide) ||
         std::any_of(rows.z.begin(), rows.z.end(), wide);
}

class VdbPoints final : public PointSource {
 public:
  explicit VdbPoints(const std::string& path) {
    PointVolume volume = read_point_volume(path);
    rows_ = std::move(volume.points.samples);
    rows_.exact.resize(rows_.attributes.size());
    info_.path = path;
    info_.count = rows_.size();
    info_.has_normals = !rows_.nx.empty();
    info_.has_radius = !rows_.radius.empty();
    info_.has_quality = !rows_.quality.empty();
    if (info_.has_radius) info_.radius_name = "pscale";
    if (info_.has_quality) info_.quality_name = "quality";
    info_.random_access = true;
    info_.double_precision = needs_double(rows_);
    info_.attributes = std::move(volume.points.layout);
    for (std::size_t a = 0; a < info_.attributes.size(); ++a) {
      // Every source fills these where a float cannot hold the type.
      if (!fits_float(info_.attributes[a].type) && rows_.exact[a].empty()) {
        rows_.exact[a].assign(rows_.attributes[a].begin(), rows_.attributes[a].end());
      }
    }
    std::string skipped;
    for (const std::string& name : volume.skipped) skipped += (skipped.empty() ? "" : ", ") + quoted_word(name);
    if (!skipped.empty())
      info_.remarks.push_back(fmt::format("{}: attributes left out, as they are no numbers: {}", path, skipped));
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    out.first = rows.first;
    for_columns(rows_, out, [&](const auto& from, auto& to) {
      if (from.empty()) return to.clear();
      const auto begin = from.begin() + static_cast<std::ptrdiff_t>(rows.first);
      to.assign(begin, begin + static_cast<std::ptrdiff_t>(rows.count));
    });
  }

 private:
  SampleBatch rows_;
};

}  // namespace

std::unique_ptr<PointSource> open_vdb(const std::string& path) {
  if (path == "-") {
    throw Error(ExitCode::unreadable,
                "standard input: points from OpenVDB are read from files only; give the file's name");
  }
  return std::make_unique<VdbPoints>(path);
}

}  // namespace lamina
