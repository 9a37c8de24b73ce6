#include "meshes/triangle_bins.h"

#include <span>

namespace lamina::meshes {

TriangleBins::TriangleBins(std::size_t bins, const std::string& tmp_dir)
    : file_(tmp_dir),
      bins_(bins),
      most_held_(std::clamp<std::size_t>((std::size_t{48} << 20) / (sizeof(Corners) * bins_.size()), 32, 2048)) {}

void TriangleBins::spill(Bin& bin) {
  if (bin.held.empty()) return;
  bin.chunks.push_back({file_.append(std::as_bytes(std::span(bin.held))), bin.held.size()});
  bin.held.clear();
}

void TriangleBins::finish() {
  for (Bin& bin : bins_) {
    spill(bin);
    bin.held = {};
  }
  file_.flush();
}

std::vector<TriangleBins::Corners> TriangleBins::read(std::uint32_t bin) const {
  std::size_t all = 0, done = 0;
  for (const Chunk& chunk : bins_[bin].chunks) all += chunk.count;
  std::vector<Corners> corners(all);
  for (const Chunk& chunk : bins_[bin].chunks) {
    file_.read(chunk.offset, std::as_writable_bytes(std::span(corners).subspan(done, chunk.count)));
    done += chunk.count;
  }
  return corners;
}

}  // namespace lamina::meshes
