// CGAL's Poisson reconstruction: cgal_poisson POINTS.ply MESH.ply RADIUS. RADIUS bounds the triangles' circumcircles,
// in sample spacings (CGAL's default of 30 gives coarse meshes).
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/IO/read_points.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/compute_average_spacing.h>
#include <CGAL/poisson_surface_reconstruction.h>
#include <CGAL/property_map.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <utility>
#include <vector>

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Sample = std::pair<Kernel::Point_3, Kernel::Vector_3>;

constexpr double kAngle = 20, kDistance = 0.375;  // CGAL's defaults

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  const CGAL::First_of_pair_property_map<Sample> position;
  const CGAL::Second_of_pair_property_map<Sample> normal;
  std::vector<Sample> samples;
  if (!CGAL::IO::read_points(argv[1], std::back_inserter(samples),
                             CGAL::parameters::point_map(position).normal_map(normal))) {
    std::fprintf(stderr, "cannot read %s\n", argv[1]);
    return 3;
  }
  const double spacing =
      CGAL::compute_average_spacing<CGAL::Sequential_tag>(samples, 6, CGAL::parameters::point_map(position));
  CGAL::Surface_mesh<Kernel::Point_3> mesh;
  if (!CGAL::poisson_surface_reconstruction_delaunay(samples.begin(), samples.end(), position, normal, mesh, spacing,
                                                     kAngle, std::atof(argv[3]), kDistance)) {
    std::fprintf(stderr, "no surface\n");
    return 4;
  }
  std::ofstream out(argv[2], std::ios::binary);
  CGAL::IO::set_binary_mode(out);
  return CGAL::IO::write_PLY(out, mesh) ? 0 : 5;
}
