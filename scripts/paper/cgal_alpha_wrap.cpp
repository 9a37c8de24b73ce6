// CGAL's alpha wrap (Portaneri et al. 2022), a closed surface around points: cgal_alpha_wrap POINTS.ply MESH.ply ALPHA
// OFFSET. ALPHA, in sample spacings: gaps narrower than this are not entered. OFFSET, in the same: how far outside of
// the points it lies.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/IO/read_points.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>
#include <CGAL/compute_average_spacing.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <vector>

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  std::vector<Kernel::Point_3> points;
  if (!CGAL::IO::read_points(argv[1], std::back_inserter(points))) {
    std::fprintf(stderr, "cannot read %s\n", argv[1]);
    return 3;
  }
  const double spacing = CGAL::compute_average_spacing<CGAL::Sequential_tag>(points, 6);
  CGAL::Surface_mesh<Kernel::Point_3> mesh;
  CGAL::alpha_wrap_3(points, std::atof(argv[3]) * spacing, std::atof(argv[4]) * spacing, mesh);
  std::ofstream out(argv[2], std::ios::binary);
  CGAL::IO::set_binary_mode(out);
  return CGAL::IO::write_PLY(out, mesh) ? 0 : 5;
}
