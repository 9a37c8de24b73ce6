#include "points/copc.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/little_endian.h"
#include "lamina/error.h"

namespace lamina {
namespace {

constexpr std::size_t kNodeBytes = 32;

struct CopcNode {
  std::int32_t level = 0;
  std::array<std::int32_t, 3> at{};
  std::uint64_t offset = 0;
  std::int32_t bytes = 0, points = 0;  ///< -1 points: a further page of nodes lies there
};

CopcNode node_at(const std::byte* from) {
  CopcNode node;
  node.level = load_little<std::int32_t>(from);
  for (std::size_t k = 0; k < 3; ++k) node.at[k] = load_little<std::int32_t>(from + 4 + 4 * k);
  node.offset = load_little<std::uint64_t>(from + 16);
  node.bytes = load_little<std::int32_t>(from + 24);
  node.points = load_little<std::int32_t>(from + 28);
  return node;
}

class NodeFinder {
 public:
  NodeFinder(const InputFile& file, const CopcOctree& octree, const PointSelection& selection)
      : file_(file), octree_(octree), selection_(selection), deepest_(deepest()) {}

  std::vector<LazChunk> find() {
    // Every byte of the file is read once at most: pages that lead in a circle end.
    std::uint64_t rest = file_.bytes;
    std::vector<CopcNode> pages{
        {.offset = octree_.root_offset,
         .bytes = static_cast<std::int32_t>(std::min<std::uint64_t>(octree_.root_bytes, 1 << 30))}};
    while (!pages.empty()) {
      const CopcNode page = pages.back();
      pages.pop_back();
      const auto bytes = static_cast<std::uint64_t>(std::max(page.bytes, 0));
      if (page.offset > file_.bytes || bytes > file_.bytes - page.offset || bytes > rest) damaged(page.offset);
      rest -= bytes;
      read_page(page.offset, static_cast<std::size_t>(bytes), pages);
    }
    std::sort(nodes_.begin(), nodes_.end(), [](const LazChunk& a, const LazChunk& b) { return a.offset < b.offset; });
    std::uint64_t first = 0;
    for (LazChunk& node : nodes_) {
      node.first = first;
      first += node.points;
    }
    return std::move(nodes_);
  }

 private:
  [[noreturn]] void damaged(std::uint64_t offset) const {
    throw Error(
        ExitCode::unreadable,
        fmt::format("{}: the list of octree nodes at byte {} is damaged or cut short; without --level, --resolution "
                    "and --clip it is not needed",
                    file_.name, offset));
  }

  void read_page(std::uint64_t offset, std::size_t bytes, std::vector<CopcNode>& pages) {
    std::vector<std::byte> page(bytes);
    if (bytes % kNodeBytes != 0 || file_.read(offset, page.data(), bytes) < bytes) damaged(offset);
    for (std::size_t at = 0; at < bytes; at += kNodeBytes) {
      const CopcNode node = node_at(page.data() + at);
      if (node.level < 0 || node.level > kMostLevels) damaged(offset + at);
      if (!is_wanted(node)) continue;
      if (node.points < 0) {
        pages.push_back(node);
      } else if (node.points > 0) {
        const auto size = static_cast<std::uint64_t>(std::max(node.bytes, 0));
        if (node.offset > file_.bytes || size > file_.bytes - node.offset) damaged(offset + at);
        nodes_.push_back({node.offset, size, 0, static_cast<std::uint64_t>(node.points)});
      }
    }
  }

  [[nodiscard]] bool is_wanted(const CopcNode& node) const {
    if (node.level > deepest_) return false;
    if (!selection_.box) return true;
    const double size = std::ldexp(2 * octree_.half_size, -node.level);
    // Coordinates are rounded to the file's steps: a cube may hold points a little beyond its faces.
    const double slack = 1e-3 * size;
    for (std::size_t k = 0; k < 3; ++k) {
      const double low = octree_.centre[k] - octree_.half_size + size * node.at[k];
      if (low - slack > (*selection_.box)[1][k] || low + size + slack < (*selection_.box)[0][k]) return false;
    }
    return true;
  }

  [[nodiscard]] int deepest() const {
    if (!selection_.resolution) return kMostLevels;
    int level = 0;
    while (level < kMostLevels && std::ldexp(octree_.spacing, -level) > *selection_.resolution) ++level;
    return level;
  }

  static constexpr int kMostLevels = 31;

  const InputFile& file_;
  const CopcOctree& octree_;
  const PointSelection& selection_;
  int deepest_;
  std::vector<LazChunk> nodes_;
};

}  // namespace

CopcOctree parse_copc(std::span<const std::byte> record, const std::string& name) {
  constexpr std::size_t kBytes = 160;
  CopcOctree octree;
  bool sane = record.size() >= kBytes;
  if (sane) {
    for (std::size_t k = 0; k < 3; ++k) octree.centre[k] = load_little<double>(record.data() + 8 * k);
    octree.half_size = load_little<double>(record.data() + 24);
    octree.spacing = load_little<double>(record.data() + 32);
    octree.root_offset = load_little<std::uint64_t>(record.data() + 40);
    octree.root_bytes = load_little<std::uint64_t>(record.data() + 48);
    sane = std::all_of(octree.centre.begin(), octree.centre.end(), [](double v) { return std::isfinite(v); }) &&
           std::isfinite(octree.half_size) && octree.half_size > 0 && octree.spacing > 0;
  }
  if (!sane) throw Error(ExitCode::unreadable, fmt::format("{}: the record of its octree (COPC) makes no sense", name));
  return octree;
}

std::vector<LazChunk> find_copc_nodes(const InputFile& file, const CopcOctree& octree,
                                      const PointSelection& selection) {
  return NodeFinder(file, octree, selection).find();
}

}  // namespace lamina
