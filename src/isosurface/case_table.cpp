#include "isosurface/case_table.h"

#include "isosurface/loops.h"

namespace lamina {
namespace {

std::uint64_t edge_key(int edge) {
  std::array<int, 3> middle = edge_low_corner(edge);
  for (int& c : middle) c *= 2;
  ++middle[edge / 4];
  return loop_key(middle[0], middle[1], middle[2]);
}

LoopPoint edge_middle(int edge) {
  const std::array<int, 3> low = edge_low_corner(edge);
  LoopPoint p;
  for (int i = 0; i < 3; ++i) {
    p.position[i] = static_cast<float>(low[i]);
    if (i != edge / 4) p.faces |= static_cast<std::uint8_t>(1 << (2 * i + low[i]));
  }
  p.position[edge / 4] = 0.5F;
  return p;
}

/// Edge of a cell by axis and the low corner's coordinates.
int edge_index(int axis, const std::array<int, 3>& low) {
  return axis * 4 + low[(axis + 1) % 3] + 2 * low[(axis + 2) % 3];
}

void walk_face(int outside, int axis, int end, LoopTracer& tracer) {
  std::vector<FaceCrossing> cycle;
  for (const FaceSide& side : kFaceSides[end]) {
    const int along = (axis + 1 + side.along) % 3;
    std::array<int, 3> low{};
    low[axis] = end;
    low[(axis + 2 - side.along) % 3] = side.at;
    const int corner = low[0] + 2 * low[1] + 4 * low[2];
    const bool at_low = ((outside >> corner) & 1) != 0;
    const bool at_high = ((outside >> (corner + (1 << along))) & 1) != 0;
    if (at_low != at_high) cycle.push_back({edge_key(edge_index(along, low)), side.forward ? at_high : at_low});
  }
  tracer.add_face(cycle);
}

CaseTriangles make_case(int outside) {
  LoopTracer tracer;
  for (int axis = 0; axis < 3; ++axis) {
    for (int end = 0; end < 2; ++end) walk_face(outside, axis, end, tracer);
  }
  tracer.trace();
  CaseTriangles out;
  for (const LoopTracer::Loop& loop : tracer.loops()) {
    std::vector<LoopPoint> points;
    std::vector<int> edges;
    for (std::uint32_t i = 0; i < loop.count; ++i) {
      int edge = 0;
      while (edge_key(edge) != tracer.keys()[tracer.order()[loop.first + i]]) ++edge;
      edges.push_back(edge);
      points.push_back(edge_middle(edge));
    }
    std::vector<std::array<std::uint8_t, 3>> triangles;
    cut_loop(points, triangles);  // always possible here
    for (const auto& t : triangles) {
      for (int i = 0; i < 3; ++i) out.edges.at(out.count * 3 + i) = static_cast<std::uint8_t>(edges[t[i]]);
      ++out.count;
    }
  }
  return out;
}

}  // namespace

const std::array<CaseTriangles, 256>& case_table() {
  static const std::array<CaseTriangles, 256> table = [] {
    std::array<CaseTriangles, 256> t;
    for (int i = 0; i < 256; ++i) t[i] = make_case(i);
    return t;
  }();
  return table;
}

}  // namespace lamina
