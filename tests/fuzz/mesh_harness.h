// What the fuzzers of the mesh readers share: bytes as a file, and what must hold of the mesh they become.
#pragma once
#include <fmt/format.h>

#include <string>

#include "harness.h"
#include "lamina/mesh.h"
#include "meshes/formats.h"

namespace lamina::fuzz {

/// Arrays must be as long as they say, and triangles name vertices that are there.
inline void require_consistent(const TriangleMesh& mesh, std::size_t file_bytes) {
  const std::size_t n = mesh.positions.size();
  // A vertex or a face takes two bytes at least, of gzip a thousandth of it.
  if (n + mesh.triangles.size() > 2000 * (file_bytes + 1)) broken("a header was believed");
  if (!mesh.normals.empty() && mesh.normals.size() != n) broken("normals are short");
  if (mesh.attributes.size() != mesh.layout.size()) broken("attributes are missing");
  for (const auto& values : mesh.attributes) {
    if (values.size() != n) broken("an attribute is short");
  }
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t v : triangle) {
      if (v >= n) broken("a triangle names a vertex that is not there");
    }
  }
}

/// `read(FileBuffer&, path)` on the bytes, as read_mesh() calls it.
template <class Read>
int run_mesh(const std::uint8_t* data, std::size_t size, const Read& read) {
  const InputFile file = as_file(data, size);
  const std::string path = fmt::format("/proc/self/fd/{}", file.file.get());
  return run([&] {
    meshes::FileBuffer buffer(path);
    require_consistent(read(buffer, path), size);
  });
}

}  // namespace lamina::fuzz
