#include "ranks/together.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/output_file.h"
#include "boundary/boundary.h"
#include "boundary/hole_closer.h"
#include "chunks/part_file.h"
#include "lamina/error.h"
#include "meshes/formats.h"
#include "meshes/mesh_sink.h"
#include "meshes/stored_mesh.h"
#include "reconstruct/job.h"
#include "simplify/streamed.h"

namespace lamina::ranks {
namespace {

constexpr std::size_t kEncoded = 4096;  ///< vertices encoded at once
/// Read back at once: what is made of it stays in the cache.
constexpr std::size_t kVertexBytes = 256 << 10, kTriangleBytes = 64 << 10;

}  // namespace

RankSlabs::RankSlabs(const SlabSpan& span, MeshSinkSettings layout, const std::string& directory)
    : span_(span), layout_(std::move(layout)), records_(directory), faces_(directory) {}

void RankSlabs::write(const MeshSlab& slab) {
  const VertexBatch& vertices = slab.vertices;
  if (slab.slab < span_.begin) {
    if (slab.slab == span_.begin - 1) {
      below_ = mark_of(vertices, layout_);
      stands_on_ = vertices;
    }
    first_ += vertices.size();
    return;
  }
  if (slab.slab >= span_.end) return;
  if (!begun_) finder_ = boundary::BoundaryFinder(first_, stands_on_);
  begun_ = true;
  require_writable(vertices, layout_.attributes, layout_.double_positions, vertices_);
  const std::size_t record = vertex_record_bytes(layout_.attributes, layout_.double_positions);
  std::vector<std::byte> bytes(kEncoded * record);
  for (std::size_t done = 0; done < vertices.size(); done += kEncoded) {
    const std::size_t n = std::min(kEncoded, vertices.size() - done);
    encode_vertices(vertices, layout_.attributes, layout_.double_positions, done, n, bytes.data());
    records_.append(std::span(bytes).first(n * record));
  }
  if (slab.slab == span_.end - 1) last_ = mark_of(vertices, layout_);
  make_relative(slab.triangles, first_, below_.vertices, relative_);
  faces_.append(std::as_bytes(std::span(relative_)));
  vertices_ += vertices.size();
  triangles_ += relative_.size();
  boundary_.clear();
  finder_.add(vertices, slab.triangles, boundary_);
  if (!boundary_.empty()) boundary::pack(boundary_, packed_boundary_);
}

std::vector<std::byte> RankSlabs::take_boundary() {
  if (begun_) {
    boundary_.clear();
    finder_.finish(/*more=*/true, boundary_);
    boundary::pack(boundary_, packed_boundary_);
  }
  return std::move(packed_boundary_);
}

void RankSlabs::read_vertices(const std::function<void(std::span<const std::byte>)>& take) {
  records_.flush();
  records_.read_through(kVertexBytes, take);
}

void RankSlabs::read_triangles(const std::function<void(std::span<const PartTriangle>)>& take) {
  std::vector<PartTriangle> triangles;
  const auto unpack = [&](std::span<const std::byte> bytes) {
    triangles.resize(bytes.size() / sizeof(PartTriangle));
    std::memcpy(triangles.data(), bytes.data(), bytes.size());
    take(triangles);
  };
  faces_.flush();
  faces_.read_through(kTriangleBytes / sizeof(PartTriangle) * sizeof(PartTriangle), unpack);
}

namespace {

std::vector<Border> gather_borders(Ranks& ranks, const Border& own) {
  Packer words;
  words.put(own);
  const std::vector<Bytes> all = ranks.gather(words.take());
  std::vector<Border> borders;
  borders.reserve(all.size());
  for (const Bytes& bytes : all) borders.push_back(Unpacker(bytes).get<Border>());
  Packer list;
  list.put(borders);
  Bytes bytes = list.take();
  ranks.broadcast(bytes);
  return Unpacker(bytes).get_list<Border>();
}

std::string make_header(const RankSlabs& part, const Place& place) {
  return mesh_header(part.layout(), place.vertices, place.triangles);
}

void write_part(SharedFile& file, RankSlabs& part, const Place& place, bool first, const RunContext& run) {
  const std::string header = make_header(part, place);
  if (first) file.write(0, std::as_bytes(std::span(header)));
  const std::uint64_t record = vertex_record_bytes(part.layout().attributes, part.layout().double_positions);
  const auto go_on = [&] {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    if (run.progress) run.progress({"write", 0, 0, 0, 0});
  };
  std::uint64_t at = header.size() + place.first_vertex * record;
  part.read_vertices([&](std::span<const std::byte> records) {
    file.write(at, records);
    at += records.size();
    go_on();
  });
  at = header.size() + place.vertices * record + place.first_triangle * kFaceRecordBytes;
  std::vector<std::byte> faces;
  part.read_triangles([&](std::span<const PartTriangle> triangles) {
    encode_shifted(triangles, place.first_vertex, place.vertices, "a rank's part", faces);
    file.write(at, faces);
    at += faces.size();
    go_on();
  });
}

/// What rank 0 finds closes the holes of all; of the others, only how much there is.
boundary::Addition close_together(Ranks& ranks, RankSlabs& part, const std::vector<Border>& borders,
                                  const HoleSettings& settings, Place& place, HoleStats& stats) {
  const std::vector<Bytes> rims = ranks.gather(part.take_boundary());
  boundary::Addition addition;
  std::array<std::uint64_t, 2> added{};
  ranks.together([&] {
    if (!ranks.first()) return;
    boundary::HoleCloser closer(settings, part.layout().attributes.size(), part.layout().double_positions);
    std::uint64_t first = 0;
    for (std::size_t r = 0; r < rims.size(); ++r) {
      if (borders[r].any) closer.add_part(boundary::unpack(rims[r]), first);
      first += borders[r].vertices;
    }
    addition = closer.finish(place.vertices);
    stats = closer.stats();
    added = {addition.vertices.size(), addition.triangles.size()};
  });
  ranks.sum(added);
  place.vertices += added[0];
  place.triangles += added[1];
  return addition;
}

void write_addition(SharedFile& file, const RankSlabs& part, const Place& place, const boundary::Addition& addition) {
  const std::uint64_t record = vertex_record_bytes(part.layout().attributes, part.layout().double_positions);
  const std::uint64_t own = place.vertices - addition.vertices.size();
  const std::uint64_t header = make_header(part, place).size();
  file.write(header + own * record, encode_addition(addition.vertices, part.layout(), own));
  const std::uint64_t faces = place.triangles - addition.triangles.size();
  file.write(header + place.vertices * record + faces * kFaceRecordBytes,
             encode_addition(addition.triangles, place.vertices));
}

/// The file that all have written becomes the mesh.
void publish_mesh(OutputFile& file, const RankSlabs& part, const Place& place, const MeshSinkSettings& layout,
                  const SimplifySettings& simplify, Job& job) {
  const std::uint64_t header = make_header(part, place).size();
  const std::uint64_t record = vertex_record_bytes(layout.attributes, layout.double_positions);
  const StoredMesh mesh{file.fd(),      header,         file.fd(), header + place.vertices * record,
                        place.vertices, place.triangles};
  if (!simplify.wanted()) {
    write_files(
        mesh, layout, [&] { file.publish(); }, job.run);
    return;
  }
  const SimplifySettings goal = simplify::goal_for(simplify, mesh.triangles, job.run);
  job.stats.simplified = simplify::write_simplified(*stored_blocks(mesh, layout, job.run), goal, layout, job.run);
}

}  // namespace

Place find_place(std::span<const Border> parts, std::size_t rank, const std::string& name) {
  Place place;
  SlabMark below;
  bool any = false;
  for (std::size_t r = 0; r < parts.size(); ++r) {
    const Border& part = parts[r];
    if (r == rank) {
      place.first_vertex = place.vertices;
      place.first_triangle = place.triangles;
    }
    place.vertices += part.vertices;
    place.triangles += part.triangles;
    if (!part.any) continue;
    // A part may begin with slabs that have no surface: then there is nothing to agree on, and it knows nothing below.
    if (any && !(part.below == below)) {
      throw Error(ExitCode::internal,
                  fmt::format("ranks {} and {} do not agree on the surface between them: do all run the same program?",
                              r - 1, r));
    }
    any = true;
    below = part.last;
  }
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (place.vertices > kMost) {
    throw Error(ExitCode::budget, fmt::format("{}: the mesh has {} vertices, a PLY's indices name at most {}; use a "
                                              "larger cell",
                                              name, place.vertices, kMost));
  }
  return place;
}

Place write_together(Ranks& ranks, const ReconstructionPlan& plan, RankSlabs& part,
                     const std::vector<std::string>& outputs, Job& job) {
  MeshSinkSettings layout = part.layout();
  layout.path = outputs.at(0);
  layout.more_paths.assign(outputs.begin() + 1, outputs.end());
  const std::string output = plan.simplify.wanted() ? simplify::unsimplified_path(layout) : staging_path(layout);
  const std::vector<Border> borders =
      gather_borders(ranks, {part.span(), part.any(), part.below(), part.last(), part.vertices(), part.triangles()});
  Place place;
  std::optional<OutputFile> file;
  std::string staged;
  ranks.together([&] {
    place = find_place(borders, static_cast<std::size_t>(ranks.rank()), output);
    if (place.triangles == 0) no_surface(plan);
  });
  const boundary::Addition addition = close_together(ranks, part, borders, plan.holes, place, job.stats.holes);
  ranks.together([&] {
    if (!ranks.first()) return;
    meshes::warn_of_losses(layout, job.run);
    file.emplace(output, std::string());
    staged = std::filesystem::absolute(file->staged()).string();
  });
  Packer words;
  words.put(staged);
  Bytes bytes = words.take();
  ranks.broadcast(bytes);
  staged = Unpacker(bytes).get_text();
  {
    SharedFile shared(ranks, staged, output);
    ranks.together([&] {
      write_part(shared, part, place, ranks.first(), job.run);
      if (ranks.first()) write_addition(shared, part, place, addition);
    });
    shared.close();
  }
  ranks.together([&] {
    if (file) publish_mesh(*file, part, place, layout, plan.simplify, job);
  });
  return place;
}

}  // namespace lamina::ranks
