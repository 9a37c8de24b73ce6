#include "lamina/simplify.h"

#include <fmt/format.h>

#include <cmath>

#include "base/run.h"
#include "lamina/error.h"
#include "lamina/measure.h"
#include "measure/edge_table.h"
#include "simplify/part.h"
#include "simplify/rounds.h"

namespace lamina {
namespace {

void require_manifold(const TriangleMesh& mesh, const RunContext& run) {
  const CheckReport r = check_mesh(mesh, run);
  if (r.manifold()) return;
  throw Error(ExitCode::unreadable,
              fmt::format("simplify: the mesh is not manifold ({} edges, {} vertices, {} edges between triangles of "
                          "opposite sides, {} triangles there twice, {} without three vertices); 'lamina check' tells "
                          "more",
                          r.non_manifold_edges, r.non_manifold_vertices, r.inconsistent_edges, r.duplicate_triangles,
                          r.repeated_index_triangles));
}

}  // namespace

SimplifyStats simplify_mesh(TriangleMesh& mesh, const SimplifySettings& settings, const RunContext& run) {
  if (settings.error != 0) {
    if (!(settings.error > 0 && std::isfinite(settings.error)))
      throw Error(ExitCode::usage,
                  fmt::format("simplify: an error of {:g}: a length above 0 is meant", settings.error));
    if (settings.triangles > 0) throw Error(ExitCode::usage, "simplify: a number of triangles or an error, not both");
  } else if (settings.triangles == 0) {
    throw Error(ExitCode::usage, "simplify: at least one triangle has to stay");
  }
  require_manifold(mesh, run);
  if (settings.triangles > mesh.triangles.size()) {
    throw Error(ExitCode::usage, fmt::format("simplify: {} triangles are wanted, the mesh has {}", settings.triangles,
                                             mesh.triangles.size()));
  }
  SimplifyStats stats;
  stats.triangles_before = mesh.triangles.size();
  with_threads(run.threads, [&] {
    simplify::WorkMesh work = simplify::make_work_mesh(mesh, measure::EdgeTable(mesh));
    work.bound = settings.error;
    stats.contractions = settings.error > 0 ? simplify::contract_within(work, run)
                                            : simplify::contract_to(work, settings.triangles, run);
  });
  simplify::drop_unused(mesh);
  stats.triangles_after = mesh.triangles.size();
  stats.reached = settings.error > 0 || stats.triangles_after <= settings.triangles;
  return stats;
}

}  // namespace lamina
