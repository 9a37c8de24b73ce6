// GLB files to be looked into, and what Khronos's validator says of them.
#pragma once
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "lamina/mesh.h"
#include "meshes/mesh_files.h"
#include "support/paths.h"

namespace lamina::testing_meshes {

/// A ball of some blocks of vertices with attributes of every kind.
inline TriangleMesh with_everything() {
  TriangleMesh m = sphere(1, 9, 300);  // some blocks of vertices
  m.layout = {{"intensity", ScalarType::uint16}, {"red", ScalarType::uint8},    {"green", ScalarType::uint8},
              {"blue", ScalarType::uint8},       {"alpha", ScalarType::uint8},  {"Curvature", ScalarType::float32},
              {"id", ScalarType::int32},         {"time", ScalarType::float64}, {"kind", ScalarType::int8}};
  m.attributes.resize(m.layout.size());
  for (std::size_t v = 0; v < m.positions.size(); ++v) {
    for (double& c : m.positions[v]) c = static_cast<double>(static_cast<float>(c));
    const auto& p = m.positions[v];
    const double length = std::hypot(p[0], p[1], p[2]);
    m.normals.push_back(
        {static_cast<float>(p[0] / length), static_cast<float>(p[1] / length), static_cast<float>(p[2] / length)});
    const auto n = static_cast<float>(v);
    for (std::size_t a = 0; a < m.layout.size(); ++a)
      m.attributes[a].push_back(static_cast<float>((v * (a + 1)) % 256));
    m.attributes[5][v] = n / 7;
    m.attributes[6][v] = -n * 1000;
    m.attributes[8][v] = static_cast<float>(v % 256) - 128;
  }
  m.positions[3][1] = -0.0;
  return m;
}

/// The JSON chunk.
inline nlohmann::json json_of_glb(const std::string& bytes) {
  std::uint32_t length = 0;
  std::memcpy(&length, bytes.data() + 12, 4);
  return nlohmann::json::parse(bytes.substr(20, length));
}

/// A GLB of any JSON and data.
inline std::string glb_of(std::string text, const std::string& data = {}) {
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const auto word = [](std::size_t n) {
    const auto w = static_cast<std::uint32_t>(n);
    return std::string(reinterpret_cast<const char*>(&w), 4);
  };
  std::string bytes = word(text.size()) + "JSON" + text;
  if (!data.empty()) bytes += word(data.size()) + std::string("BIN\0", 4) + data;
  return "glTF" + word(2) + word(bytes.size() + 12) + bytes;
}

/// Errors and warnings of Khronos's validator in a line each; nothing where all is well.
inline std::string validated(const std::string& path) {
  const std::string out = path + ".report";
  const std::string command =
      fmt::format("node '{}/tests/interop/validate_glb.cjs' '{}' > '{}' 2>&1", LAMINA_SOURCE_DIR, path, out);
  const int status = std::system(command.c_str());
  return status == 0 ? std::string() : bytes_of(out);
}

inline bool has_validator() {
  return std::filesystem::exists(LAMINA_SOURCE_DIR "/tests/interop/node_modules/gltf-validator") &&
         std::system("node --version > /dev/null 2>&1") == 0;
}

}  // namespace lamina::testing_meshes
