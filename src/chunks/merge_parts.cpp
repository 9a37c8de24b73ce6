#include "chunks/part_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "base/output_file.h"
#include "boundary/hole_closer.h"
#include "lamina/chunk.h"
#include "lamina/error.h"
#include "meshes/formats.h"
#include "meshes/mesh_sink.h"
#include "meshes/stored_mesh.h"
#include "simplify/streamed.h"

namespace lamina {
namespace {

[[noreturn]] void refuse(const std::string& message) {
  throw Error(ExitCode::unreadable, message);
}

/// Counts and places agree, and what one part stands on is what the one before ends with.
void require_successive(const std::vector<PartReader>& parts) {
  const PartInfo& first = parts.front().info();
  SlabMark below;
  std::int32_t end = first.span.begin;
  const PartReader* owner = nullptr;  // of the slab below
  for (const PartReader& part : parts) {
    const PartInfo& info = part.info();
    if (info.span.begin != end || info.span.end < info.span.begin || !(info.layout().attributes == first.attributes) ||
        info.double_positions != first.double_positions || info.comments != first.comments)
      refuse(fmt::format("{}: does not fit to the other parts; make it again", part.path()));
    end = info.span.end;
    if (info.span.empty()) continue;
    if (owner != nullptr && !(info.below == below)) {
      refuse(
          fmt::format("{} and {}: do not agree on the surface between them, though made from one store with one "
                      "set of parameters; make both again, with one program",
                      owner->path(), part.path()));
    }
    below = info.last;
    owner = &part;
  }
}

/// What closes the holes of the whole mesh; counts it.
boundary::Addition close_holes(const std::vector<PartReader>& parts, MergedParts& merged) {
  const PartInfo& info = parts.front().info();
  boundary::HoleCloser closer(info.holes, info.attributes.size(), info.double_positions);
  std::uint64_t first = 0;
  for (const PartReader& part : parts) {
    if (!part.info().span.empty()) closer.add_part(part.read_boundary(), first);
    first += part.info().vertices;
  }
  boundary::Addition addition = closer.finish(first);
  merged.vertices += addition.vertices.size();
  merged.triangles += addition.triangles.size();
  merged.holes = closer.stats();
  return addition;
}

void write(OutputFile& file, const void* data, std::size_t bytes) {
  if (const int error = write_all(file.fd(), data, bytes); error != 0) report_write_error(file.name(), error);
}

}  // namespace

std::vector<PartReader> open_parts(const std::vector<std::string>& paths) {
  if (paths.empty()) refuse("no parts are named");
  std::vector<PartReader> parts;
  parts.reserve(paths.size());
  for (const std::string& path : paths) parts.emplace_back(path);
  const PartReader& one = parts.front();
  for (const PartReader& part : parts) {
    if (part.info().job != one.info().job) {
      refuse(
          fmt::format("{}: is of another run than {}: of another store, with other parameters, or by another version "
                      "of lamina",
                      part.path(), one.path()));
    }
    if (part.info().count != one.info().count) {
      refuse(fmt::format("{}: is one of {} chunks, {} one of {}: all must be cut alike", part.path(), part.info().count,
                         one.path(), one.info().count));
    }
  }
  std::stable_sort(parts.begin(), parts.end(),
                   [](const PartReader& a, const PartReader& b) { return a.info().number < b.info().number; });
  int expected = 1;
  const int count = parts.front().info().count;
  for (std::size_t p = 0; p < parts.size(); ++p, ++expected) {
    const int number = parts[p].info().number;
    if (p > 0 && number == expected - 1)
      refuse(fmt::format("{} and {}: are both chunk {} of {}; give one of them", parts[p - 1].path(), parts[p].path(),
                         number, count));
    if (number != expected)
      refuse(fmt::format("chunk {} of {} is missing (others, such as {}, are there): make it with --chunk {}/{}",
                         expected, count, parts[p].path(), expected, count));
  }
  if (expected != count + 1) {
    refuse(fmt::format("chunk {} of {} is missing ({} is the last that is there): make it with --chunk {}/{}", expected,
                       count, parts.back().path(), expected, count));
  }
  require_successive(parts);
  return parts;
}

void encode_shifted(std::span<const PartTriangle> triangles, std::uint64_t first, std::uint64_t vertices,
                    const std::string& part, std::vector<std::byte>& out) {
  out.resize(triangles.size() * kFaceRecordBytes);
  std::vector<std::array<std::uint32_t, 3>> shifted(triangles.size());
  bool inside = true;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int64_t number = static_cast<std::int64_t>(first) + triangles[t][k];
      inside = inside && number >= 0 && static_cast<std::uint64_t>(number) < vertices;
      shifted[t][k] = static_cast<std::uint32_t>(number);
    }
  }
  if (!inside)
    refuse(fmt::format("{}: is damaged: a triangle names a vertex that is not there; make the chunk again", part));
  encode_faces(shifted.data(), shifted.size(), out.data());
}

std::vector<std::byte> encode_addition(const VertexBatch& vertices, const MeshSinkSettings& layout,
                                       std::uint64_t first) {
  require_writable(vertices, layout.attributes, layout.double_positions, first);
  std::vector<std::byte> out(vertices.size() * vertex_record_bytes(layout.attributes, layout.double_positions));
  encode_vertices(vertices, layout.attributes, layout.double_positions, 0, vertices.size(), out.data());
  return out;
}

std::vector<std::byte> encode_addition(const std::vector<std::array<std::uint32_t, 3>>& triangles,
                                       std::uint64_t vertices) {
  std::vector<std::byte> out(triangles.size() * kFaceRecordBytes);
  if (!triangles.empty() && encode_faces(triangles.data(), triangles.size(), out.data()) >= vertices)
    refuse("a rim of a part names a vertex that is not there; make the chunks again");
  return out;
}

MergedParts merge_parts(const std::vector<std::string>& paths, const std::vector<std::string>& outputs,
                        const RunContext& run, const std::optional<SimplifySettings>& wanted) {
  const std::string& output = outputs.at(0);
  const std::vector<PartReader> parts = open_parts(paths);
  MergedParts merged;
  merged.parts = static_cast<int>(parts.size());
  for (const PartReader& part : parts) {
    merged.vertices += part.info().vertices;
    merged.triangles += part.info().triangles;
  }
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (merged.vertices > kMost) {
    throw Error(ExitCode::budget, fmt::format("{}: the mesh has {} vertices, a PLY's indices name at most {}; use a "
                                              "larger cell",
                                              output, merged.vertices, kMost));
  }
  if (merged.triangles == 0) {
    throw Error(ExitCode::empty, fmt::format("{}: no surface came out of any of the {} chunks; the samples lie too far "
                                             "apart for their radii, or on no surface at all (try --blend or "
                                             "--particlescale above 1)",
                                             output, parts.size()));
  }
  MeshSinkSettings layout = parts.front().info().layout();
  layout.path = output;
  layout.more_paths.assign(outputs.begin() + 1, outputs.end());
  layout.tmp_dir = run.tmp_dir;
  require_outputs(layout);
  const SimplifySettings simplify = wanted ? *wanted : SimplifySettings{.deviation = parts.front().info().deviation};
  if (simplify.wanted()) simplify::require_goal(simplify);
  OutputFile file(simplify.wanted() ? simplify::unsimplified_path(layout) : staging_path(layout), run.tmp_dir);
  const std::uint64_t own_vertices = merged.vertices;
  const boundary::Addition addition = close_holes(parts, merged);
  meshes::warn_of_losses(layout, run);
  const std::string header = mesh_header(layout, merged.vertices, merged.triangles);
  std::uint64_t bytes = header.size();
  write(file, header.data(), header.size());
  std::int64_t done = 0;
  const auto step = [&] {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    ++done;
    if (run.progress) run.progress({"merge", 0, 0, done, 2 * merged.parts});
  };
  for (const PartReader& part : parts) {
    part.read_vertices([&](std::span<const std::byte> records) {
      write(file, records.data(), records.size());
      bytes += records.size();
    });
    step();
  }
  const auto append = [&](const std::vector<std::byte>& encoded) {
    write(file, encoded.data(), encoded.size());
    bytes += encoded.size();
  };
  append(encode_addition(addition.vertices, layout, own_vertices));
  std::uint64_t first = 0;
  std::vector<std::byte> faces;
  for (const PartReader& part : parts) {
    part.read_triangles([&](std::span<const PartTriangle> triangles) {
      encode_shifted(triangles, first, own_vertices, part.path(), faces);
      write(file, faces.data(), faces.size());
      bytes += faces.size();
    });
    first += part.info().vertices;
    step();
  }
  append(encode_addition(addition.triangles, merged.vertices));
  const std::uint64_t faces_at = bytes - merged.triangles * kFaceRecordBytes;
  const StoredMesh mesh{file.fd(), header.size(), file.fd(), faces_at, merged.vertices, merged.triangles};
  if (simplify.wanted()) {
    const SimplifySettings goal = simplify::goal_for(simplify, mesh.triangles, run);
    merged.simplified = simplify::write_simplified(*stored_blocks(mesh, layout, run), goal, layout, run);
    merged.vertices = merged.simplified.vertices_after;
    merged.triangles = merged.simplified.triangles_after;
  } else {
    write_files(
        mesh, layout, [&] { file.complete(bytes); }, run);
  }
  return merged;
}

}  // namespace lamina
