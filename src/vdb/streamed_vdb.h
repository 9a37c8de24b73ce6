// A .vdb file written leaf by leaf, in any order: OpenVDB's own writer wants the whole tree in memory.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/output_file.h"
#include "base/spill_file.h"
#include "vdb/grids.h"
#include "vdb/packed_leaf.h"

namespace lamina::volume {

/// Leaves wait, compressed, in an unnamed temporary file; memory holds some forty bytes for each. finish() puts the
/// file together, commit() gives it its name. Without commit() nothing is left.
class StreamedVdb {
 public:
  StreamedVdb(std::string path, const std::string& tmp_dir);
  StreamedVdb(const StreamedVdb&) = delete;
  StreamedVdb& operator=(const StreamedVdb&) = delete;

  /// An empty FloatGrid or Vec3SGrid that carries name, background, transform and metadata; returns its number. A float
  /// grid's tiles get the signs of the leaves around (packed_leaf.h) when it is a level set.
  std::size_t add_grid(const openvdb::GridBase::Ptr& empty);
  /// Each place once. Those of a node of 128^3 voxels are read fastest when they came one after the other.
  void add(std::size_t grid, const PackedLeaf& leaf);
  [[nodiscard]] std::uint64_t leaves() const;
  /// Writes everything, with a tag made from the contents. Throws Error(budget) when the disk does not take it.
  void finish();
  void commit(const std::string& final_name);
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  [[nodiscard]] openvdb::GridBase& grid(std::size_t number) { return *grids_[number].empty; }

 private:
  static constexpr std::size_t kBuffersInFlight = 16;
  struct Record {
    LeafVotes place;
    std::uint32_t size = 0;
    std::uint64_t at = 0;
  };
  struct Grid {
    openvdb::GridBase::Ptr empty;
    std::vector<Record> leaves;
    std::uint64_t active = 0;
    openvdb::CoordBBox box;
  };
  template <class Tree>
  class Topology;
  void write(std::ostream& os);
  void write_grid(std::ostream& os, const Grid& grid) const;
  void write_buffers(std::ostream& os, const Grid& grid) const;
  template <class Visit>
  void visit_records(std::span<const Record> records, const Visit& visit) const;
  [[noreturn]] void fail(const char* what) const;

  std::string path_;
  StagedFile staged_;
  SpillFile spool_;
  BackgroundWriter disk_{SpillFile::kBufferBytes, kBuffersInFlight};  ///< ends before the file it writes to
  std::vector<Grid> grids_;
  std::uint64_t bytes_ = 0;
};

}  // namespace lamina::volume
