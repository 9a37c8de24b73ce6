// Meshes for the sink, and what comes of them where they cannot be written.
#pragma once
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "lamina/error.h"
#include "lamina/mesh.h"
#include "meshes/mesh_sink.h"

namespace lamina::test {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

inline const AttributeLayout kColours{
    {"red", ScalarType::uint8}, {"depth", ScalarType::uint16}, {"w", ScalarType::float32}};

inline VertexBatch some_vertices(std::size_t first, std::size_t count) {
  VertexBatch batch;
  batch.attributes.resize(kColours.size());
  for (std::size_t i = first; i < first + count; ++i) {
    const auto v = static_cast<float>(i);
    batch.x.push_back(std::sin(v));
    batch.y.push_back(4e6 + v / 7);
    batch.z.push_back(-v);
    batch.nx.push_back(v / 3);
    batch.ny.push_back(1);
    batch.nz.push_back(-v);
    batch.attributes[0].push_back(static_cast<float>(i % 256));
    batch.attributes[1].push_back(static_cast<float>(i % 65536));
    batch.attributes[2].push_back(v / 11);
  }
  return batch;
}

inline Triangles some_triangles(std::size_t first, std::size_t count, std::size_t vertices) {
  Triangles triangles;
  for (std::size_t i = first; i < first + count; ++i) {
    triangles.push_back({static_cast<std::uint32_t>(i % vertices), static_cast<std::uint32_t>((i * 7 + 1) % vertices),
                         static_cast<std::uint32_t>((i * 31 + 2) % vertices)});
  }
  return triangles;
}

/// Runs `work` and gives its error's message, "code: message".
inline std::string outcome(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& e) {
    return std::to_string(static_cast<int>(e.code())) + ": " + e.what();
  }
  return "nothing";
}

/// The same in a process of its own, whose limits and mounts end with it.
inline std::string outcome_in_child(const std::function<void()>& work) {
  int ends[2];
  if (::pipe(ends) != 0) return "no pipe";
  const pid_t child = ::fork();
  if (child == 0) {
    const std::string text = outcome(work);
    const ssize_t n = ::write(ends[1], text.data(), text.size());
    ::_exit(n == static_cast<ssize_t>(text.size()) ? 0 : 1);
  }
  ::close(ends[1]);
  std::string text;
  char buffer[512];
  for (ssize_t n = 0; (n = ::read(ends[0], buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(n));
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  return status == 0 ? text : "the child died";
}

inline void write_mesh_to(const MeshSinkSettings& settings, std::size_t vertices, std::size_t triangles) {
  MeshSink sink(settings);
  sink.append_vertices(some_vertices(0, vertices));
  sink.append_triangles(some_triangles(0, triangles, vertices));
  sink.commit();
}

/// Faces of some_triangles() name a vertex twice now and then, which readers of meshes do not take.
inline Triangles strip(std::size_t count) {
  Triangles triangles;
  for (std::uint32_t i = 0; i < count; ++i) triangles.push_back({i, i + 1, i + 2});
  return triangles;
}

}  // namespace lamina::test
