// Where a sweep is cut into chunks, and their parts: the vertices and triangles of some slabs, to be joined with the
// parts before and after it. Its file, written and read, and finished slabs put into parts, each of which begins at a
// cut (PartSlabs).
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/output_file.h"
#include "boundary/boundary.h"
#include "lamina/holes.h"
#include "lamina/surface.h"
#include "meshes/mesh_sink.h"
#include "reconstruct/mesh_output.h"
#include "reconstruct/plan.h"
#include "reconstruct/stages.h"
#include "store/slab_store.h"

namespace lamina {

/// What two parts must agree on at their border: the vertices of the slab below it.
struct SlabMark {
  std::uint64_t vertices = 0;
  std::uint32_t checksum = 0;  ///< CRC-32 of their records
  bool operator==(const SlabMark&) const = default;
};

struct PartInfo {
  std::uint64_t job = 0;      ///< job_hash(): store and settings
  int number = 1, count = 1;  ///< Chunk
  SlabSpan span;
  bool double_positions = false;
  AttributeLayout attributes;
  std::vector<std::string> comments;
  HoleSettings holes;
  double deviation = 0;  ///< SimplifySettings::deviation of the mesh that the parts make
  std::uint64_t vertices = 0, triangles = 0;
  SlabMark below;  ///< the slab before the first, as this part's run has it
  SlabMark last;   ///< the last slab
  [[nodiscard]] MeshSinkSettings layout() const {
    return {.attributes = attributes, .double_positions = double_positions, .comments = comments};
  }
};

/// Vertex numbers from the part's first vertex on; negative: of the slab before.
using PartTriangle = std::array<std::int32_t, 3>;

/// Writes slab after slab; keeps a megabyte. The file appears with commit().
///
/// Layout, little-endian: 16 bytes that name the format and its version; blocks of a slab's vertices (records of the
/// final PLY), triangles (PartTriangle) or boundary batches (boundary/boundary.h, records of a byte), each as kind and
/// count (8 bytes both), records, and their CRC-32; at the end the PartInfo as JSON, its length, its CRC-32, and 8
/// bytes that say that the file is complete.
class PartWriter {
 public:
  /// Throws as OutputFile.
  PartWriter(const std::string& path, const MeshSinkSettings& layout);
  /// Throws Error(internal) for numbers that are not finite, Error(budget) when the disk is full.
  void add(const VertexBatch& vertices, std::span<const PartTriangle> triangles);
  /// What is known of the boundary of the part (BoundaryFinder of a part).
  void add(const boundary::BoundaryBatch& rims);
  [[nodiscard]] std::uint64_t vertices() const { return vertices_; }
  [[nodiscard]] std::uint64_t triangles() const { return triangles_; }
  [[nodiscard]] const SlabMark& last() const { return last_; }
  /// `info`: counts and last are filled in.
  void commit(PartInfo info);

 private:
  void put(const void* data, std::size_t bytes);
  void begin_block(std::uint64_t kind, std::uint64_t count);
  void flush();

  OutputFile file_;
  MeshSinkSettings layout_;
  std::vector<std::byte> buffer_;
  std::uint64_t written_ = 0, vertices_ = 0, triangles_ = 0;
  std::vector<std::byte> packed_;
  SlabMark last_;
};

/// The mark of vertices as a part would store them.
SlabMark mark_of(const VertexBatch& vertices, const MeshSinkSettings& layout);

/// Opens a complete part. Throws Error(unreadable) naming what is wrong with it.
class PartReader {
 public:
  explicit PartReader(const std::string& path);
  [[nodiscard]] const PartInfo& info() const { return info_; }
  [[nodiscard]] const std::string& path() const { return path_; }
  /// Hands over the vertices' records piece by piece, in order. Throws Error(unreadable) where bytes are damaged, in
  /// the end: what was handed over before must not be used then.
  void read_vertices(const std::function<void(std::span<const std::byte>)>& take) const;
  void read_triangles(const std::function<void(std::span<const PartTriangle>)>& take) const;
  /// All of them at once; in memory goes with the length of the boundary.
  [[nodiscard]] boundary::BoundaryBatch read_boundary() const;

 private:
  void read_blocks(std::uint64_t kind, std::size_t record,
                   const std::function<void(std::span<const std::byte>)>& take) const;
  [[noreturn]] void refuse(const std::string& what) const;
  void read(std::uint64_t offset, void* data, std::size_t bytes) const;

  std::string path_;
  Descriptor file_;
  PartInfo info_;
  std::uint64_t body_end_ = 0;
};

/// Successive parts: the first begins where its sweep's exact slabs do, the others where the one before ends.
class PartSlabs : public SlabSink {
 public:
  struct Part {
    int number;  ///< Chunk
    SlabSpan span;
    std::string path;
  };
  /// `job`, `count`, `holes`, `deviation`: of every part (PartInfo).
  PartSlabs(std::vector<Part> parts, int count, std::uint64_t job, const HoleSettings& holes, double deviation,
            MeshSinkSettings layout);

  /// Slabs below the first part only tell what it stands on.
  void write(const MeshSlab& slab) override;
  /// The sweep is over: finishes the parts that wait for slabs without surface.
  void finish();
  [[nodiscard]] std::uint64_t vertices() const { return vertices_; }  ///< of finished parts
  [[nodiscard]] std::uint64_t triangles() const { return triangles_; }

 private:
  void open();
  void close();
  void finish_below(std::int64_t slab);

  std::vector<Part> parts_;
  int count_;
  std::uint64_t job_;
  HoleSettings holes_;
  double deviation_;
  MeshSinkSettings layout_;
  std::size_t at_ = 0;  ///< part that the next slab may belong to
  std::optional<PartWriter> writer_;
  PartInfo info_;
  SlabMark previous_;                ///< the slab written last
  VertexBatch below_;                ///< its vertices
  boundary::BoundaryFinder finder_;  ///< of the part
  boundary::BoundaryBatch boundary_;
  std::uint64_t numbered_ = 0;  ///< vertices so far, as the clusterer counts
  std::uint64_t first_ = 0;     ///< number of the part's first vertex
  std::uint64_t vertices_ = 0, triangles_ = 0;
  std::vector<PartTriangle> relative_;
};

/// Vertex numbers relative to a part that begins with vertex `first` on a slab of `below` vertices: from -below on.
/// Throws Error(internal) for numbers below that, Error(budget) where 32 bits do not hold them.
void make_relative(const std::vector<std::array<std::uint32_t, 3>>& triangles, std::uint64_t first, std::uint64_t below,
                   std::vector<PartTriangle>& out);

// Parts in order, checked against each other.

/// Opens them all and puts them in order. Throws Error(unreadable) as merge_parts() does.
std::vector<PartReader> open_parts(const std::vector<std::string>& paths);

/// The records of a mesh file's faces: numbers counted from `first`, the mesh's number of the part's first vertex.
/// Throws Error(unreadable) naming the part where a number lies outside of the mesh's `vertices`.
void encode_shifted(std::span<const PartTriangle> triangles, std::uint64_t first, std::uint64_t vertices,
                    const std::string& part, std::vector<std::byte>& out);

/// The records of what closes a mesh's holes: vertices, the first of number `first`, and faces of a mesh of `vertices`.
std::vector<std::byte> encode_addition(const VertexBatch& vertices, const MeshSinkSettings& layout,
                                       std::uint64_t first);
std::vector<std::byte> encode_addition(const std::vector<std::array<std::uint32_t, 3>>& triangles,
                                       std::uint64_t vertices);

/// Samples in each slab of the plan: a bucket's are taken to lie evenly between its lowest and its highest one.
std::vector<double> slab_samples(const ReconstructionPlan& plan, const SlabStore& store);

/// Samples in the slabs of a span, as slab_samples() has them.
std::uint64_t samples_in(const ReconstructionPlan& plan, const SlabStore& store, const SlabSpan& span);

/// `count` spans that follow each other through the slabs of the plan, the last ones empty where there are fewer slabs
/// than that. The largest cost of a chunk, the slabs it works on beside its own included, is as small as it can be. A
/// function of plan, store and count alone.
std::vector<SlabSpan> cut(const ReconstructionPlan& plan, const SlabStore& store, int count);

/// What a chunk of slabs [begin, end) costs, from what each slab does: those beside it are read and projected, too.
double chunk_cost(const std::vector<double>& cost, std::size_t begin, std::size_t end);

/// The same spans from what each slab costs; the first is slab number `first`.
std::vector<SlabSpan> cut(const std::vector<double>& cost, std::int32_t first, int count);

/// The settings that the mesh's bytes depend on, one a line.
std::string mesh_settings(const SurfaceSettings& settings);

/// A number that parts of different stores, settings, lattices or versions of the program do not share (FNV-1a).
std::uint64_t job_hash(const SurfaceSettings& settings, const std::string& input_id, const ReconstructionPlan& plan);

/// Throws Error(usage) for settings that cannot be met in parts.
void require_mesh_alone(const SurfaceSettings& settings, const std::string& option);

}  // namespace lamina
