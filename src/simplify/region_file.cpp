#include "simplify/region_file.h"

#include <span>

namespace lamina::simplify {
namespace {

/// Arrays one after the other.
class ArrayReader {
 public:
  ArrayReader(const SpillFile& file, std::uint64_t offset) : file_(file), offset_(offset) {}
  template <class T>
  void read(std::vector<T>& out, std::size_t count) {
    out.resize(count);
    const auto bytes = std::as_writable_bytes(std::span(out));
    if (!bytes.empty()) file_.read(offset_, bytes);
    offset_ += bytes.size();
  }

 private:
  const SpillFile& file_;
  std::uint64_t offset_;
};

}  // namespace

RegionFile::RegionFile(const std::string& tmp_dir, const TriangleMesh& layout, bool bound)
    : file_(tmp_dir), attributes_(layout.layout), normals_(!layout.normals.empty()), bound_(bound) {}

RegionFile::Place RegionFile::append(const RegionMesh& part) {
  const Place place{file_.size(), part.mesh.positions.size(), part.mesh.triangles.size()};
  const auto write = [this](const auto& array) { file_.append(std::as_bytes(std::span(array))); };
  write(part.mesh.positions);
  write(part.mesh.normals);
  for (const std::vector<float>& values : part.mesh.attributes) write(values);
  write(part.ids);
  write(part.quadrics);
  write(part.mesh.triangles);
  write(part.errors);
  write(part.tried);
  return place;
}

RegionMesh RegionFile::read(const Place& place) const {
  RegionMesh part;
  ArrayReader from(file_, place.offset);
  from.read(part.mesh.positions, place.vertices);
  if (normals_) from.read(part.mesh.normals, place.vertices);
  part.mesh.layout = attributes_;
  part.mesh.attributes.resize(attributes_.size());
  for (std::vector<float>& values : part.mesh.attributes) from.read(values, place.vertices);
  from.read(part.ids, place.vertices);
  from.read(part.quadrics, place.vertices);
  from.read(part.mesh.triangles, place.triangles);
  if (bound_) {
    from.read(part.errors, place.triangles);
    from.read(part.tried, place.vertices);
  }
  return part;
}

}  // namespace lamina::simplify
