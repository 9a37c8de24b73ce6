// Tile sets read back: their trees, and the triangles of their contents in steps of the lattice.
#pragma once
#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "lamina/tiles.h"
#include "meshes/mesh_blocks.h"
#include "meshes/mesh_files.h"
#include "tiles/write_tiles.h"

namespace lamina::testing_tiles {

using Json = nlohmann::json;
using Vec3 = std::array<double, 3>;

/// A corner: its place in steps of the finest kind, and its colour.
struct Corner {
  std::array<std::int64_t, 3> at{};
  std::array<int, 3> colour{};
  auto operator<=>(const Corner&) const = default;
};
using Triangle = std::array<Corner, 3>;

struct Glb {
  Json json;
  std::string data;
};

inline Glb read_glb_chunks(const std::string& path) {
  const std::string bytes = testing_meshes::bytes_of(path);
  const auto word = [&](std::size_t at) {
    std::uint32_t w = 0;
    std::memcpy(&w, bytes.data() + at, sizeof w);
    return std::size_t{w};
  };
  return {Json::parse(bytes.substr(20, word(12))), bytes.substr(28 + word(12), word(20 + word(12)))};
}

/// A view's bytes, decoded by meshoptimizer where they are compressed.
inline std::string view_bytes(const Glb& glb, const Json& view) {
  if (!view.contains("extensions")) return glb.data.substr(view["byteOffset"], view["byteLength"]);
  const Json& packed = view["extensions"]["EXT_meshopt_compression"];
  const std::string from = glb.data.substr(packed["byteOffset"], packed["byteLength"]);
  const auto* const coded = reinterpret_cast<const unsigned char*>(from.data());
  const std::size_t count = packed["count"], stride = packed["byteStride"];
  std::string to(count * stride, '\0');
  if (packed["mode"] == "TRIANGLES") {
    EXPECT_EQ(meshopt_decodeIndexBuffer(to.data(), count, stride, coded, from.size()), 0);
  } else {
    EXPECT_EQ(meshopt_decodeVertexBuffer(to.data(), count, stride, coded, from.size()), 0);
    if (packed.value("filter", "NONE") == "EXPONENTIAL") meshopt_decodeFilterExp(to.data(), count, stride);
  }
  EXPECT_EQ(to.size(), view["byteLength"].get<std::size_t>());
  return to;
}

/// The numbers of an accessor as they are, `width` a row.
inline std::vector<double> numbers_of(const Glb& glb, std::size_t number, std::size_t width) {
  const Json& accessor = glb.json["accessors"][number];
  const Json& view = glb.json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
  const std::string bytes = view_bytes(glb, view);
  const int type = accessor["componentType"];
  const std::map<int, std::size_t> sizes{{5120, 1}, {5121, 1}, {5122, 2}, {5123, 2}, {5125, 4}, {5126, 4}};
  const std::size_t size = sizes.at(type), rows = accessor["count"], stride = view.value("byteStride", size * width);
  std::vector<double> out;
  for (std::size_t row = 0; row < rows; ++row)
    for (std::size_t k = 0; k < width; ++k) {
      const char* from = bytes.data() + row * stride + k * size;
      const auto as = [&](auto value) {
        std::memcpy(&value, from, sizeof value);
        return static_cast<double>(value);
      };
      out.push_back(type == 5120   ? as(std::int8_t{})
                    : type == 5121 ? as(std::uint8_t{})
                    : type == 5122 ? as(std::int16_t{})
                    : type == 5123 ? as(std::uint16_t{})
                    : type == 5125 ? as(std::uint32_t{})
                                   : as(float{}));
    }
  return out;
}

inline int encoded_colour(double word) {
  const double linear = word / 65535;
  return static_cast<int>(
      std::lround(255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055)));
}

/// A content's triangles, their corners turned so that the least comes first.
inline std::vector<Triangle> triangles_of(const std::string& path, double step) {
  const Glb glb = read_glb_chunks(path);
  const Json& primitive = glb.json["meshes"][0]["primitives"][0];
  const Json& node = glb.json["nodes"][0];
  EXPECT_EQ(node["scale"], Json::array({step, step, step}));
  const auto at = numbers_of(glb, primitive["attributes"]["POSITION"], 3);
  const auto indices = numbers_of(glb, primitive["indices"], 1);
  const auto normals = numbers_of(glb, primitive["attributes"]["NORMAL"], 3);
  EXPECT_EQ(normals.size(), at.size());
  std::vector<double> colours;
  if (primitive["attributes"].contains("COLOR_0")) colours = numbers_of(glb, primitive["attributes"]["COLOR_0"], 3);
  std::vector<Corner> corners(at.size() / 3);
  for (std::size_t v = 0; v < corners.size(); ++v) {
    Vec3 p{};
    for (std::size_t k = 0; k < 3; ++k) p[k] = at[3 * v + k] + node["translation"][k].get<double>() / step;
    // Back from y up to z up.
    corners[v].at = {std::llround(p[0]), std::llround(-p[2]), std::llround(p[1])};
    for (std::size_t k = 0; k < 3 && !colours.empty(); ++k) corners[v].colour[k] = encoded_colour(colours[3 * v + k]);
  }
  std::vector<Triangle> out;
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
    Triangle t{};
    for (std::size_t k = 0; k < 3; ++k) t[k] = corners[static_cast<std::size_t>(indices[i + k])];
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    out.push_back(t);
  }
  return out;
}

/// A tile set on disk.
struct Tileset {
  std::string folder;
  Json json;
  double step = 0;
  Vec3 origin{};

  explicit Tileset(std::string where) : folder(std::move(where)) {
    json = Json::parse(testing_meshes::bytes_of(folder + "/tileset.json"));
    origin = json["asset"]["extras"]["origin"].get<Vec3>();
    step = read_glb_chunks(folder + "/" + json["root"]["content"]["uri"].get<std::string>())
               .json["nodes"][0]["scale"][0]
               .get<double>();
  }
  [[nodiscard]] std::vector<Triangle> triangles(const Json& tile) const {
    return triangles_of(folder + "/" + tile["content"]["uri"].get<std::string>(), step);
  }
  /// All tiles, parents before children, with the one above (null for the root).
  void visit(const std::function<void(const Json&, const Json*)>& use) const { visit(json["root"], nullptr, use); }
  /// Tiles that a viewer might show together: those from the root on for which `refine` says no, and leaves.
  [[nodiscard]] std::vector<const Json*> cut(const std::function<bool(const Json&)>& refine) const {
    std::vector<const Json*> out;
    const std::function<void(const Json&)> go = [&](const Json& tile) {
      if (!tile.contains("children") || !refine(tile)) return out.push_back(&tile);
      for (const Json& child : tile["children"]) go(child);
    };
    go(json["root"]);
    return out;
  }

 private:
  void visit(const Json& tile, const Json* above, const std::function<void(const Json&, const Json*)>& use) const {
    use(tile, above);
    if (!tile.contains("children")) return;
    for (const Json& child : tile["children"]) visit(child, &tile, use);
  }
};

/// The mesh's own triangles in steps of the set's lattice.
inline std::vector<Triangle> expected_triangles(const TriangleMesh& mesh, const Tileset& set) {
  std::vector<Triangle> out;
  for (const auto& t : mesh.triangles) {
    Triangle corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t a = 0; a < 3; ++a) {
        corners[k].at[a] = std::llrint((mesh.positions[t[k]][a] - set.origin[a]) / set.step);
        if (!mesh.attributes.empty()) corners[k].colour[a] = static_cast<int>(mesh.attributes[a][t[k]]);
      }
    }
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    out.push_back(corners);
  }
  return out;
}

/// Small tiles, so that small meshes have several levels of them.
inline TileStats write_small_tiles(const TriangleMesh& mesh, const TileSettings& settings, const RunContext& run = {}) {
  meshes::HeldMesh blocks(mesh);
  return tiles::write_blocks_as_tiles(blocks, settings, run, {900, 600, 1200});
}

/// n x 2n squares around a bumpy ball, closed or without the part around its poles, with colours.
inline TriangleMesh bumpy_ball(std::uint32_t n, bool closed, const Vec3& centre = {}) {
  TriangleMesh mesh;
  mesh.layout = {{"red", ScalarType::uint8}, {"green", ScalarType::uint8}, {"blue", ScalarType::uint8}};
  mesh.attributes.resize(3);
  const auto add = [&](double theta, double phi) {
    const double r = 1 + 0.05 * std::sin(7 * theta) * std::cos(5 * phi);
    const Vec3 d{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
    mesh.positions.push_back({centre[0] + r * d[0], centre[1] + r * d[1], centre[2] + r * d[2]});
    mesh.normals.push_back({static_cast<float>(d[0]), static_cast<float>(d[1]), static_cast<float>(d[2])});
    for (std::size_t k = 0; k < 3; ++k)
      mesh.attributes[k].push_back(static_cast<float>((mesh.positions.size() * (k + 3)) % 256));
    return static_cast<std::uint32_t>(mesh.positions.size() - 1);
  };
  constexpr double kPi = 3.14159265358979323846;
  const double skip = closed ? 0 : 0.5;
  const std::uint32_t around = 2 * n;
  std::vector<std::vector<std::uint32_t>> rings;
  for (std::uint32_t i = closed ? 1 : 0; i < (closed ? n : n + 1); ++i) {
    rings.emplace_back();
    for (std::uint32_t j = 0; j < around; ++j)
      rings.back().push_back(add(skip + (kPi - 2 * skip) * i / n, 2 * kPi * j / around));
  }
  for (std::size_t i = 0; i + 1 < rings.size(); ++i)
    for (std::uint32_t j = 0; j < around; ++j) {
      const std::uint32_t a = rings[i][j], b = rings[i + 1][j], c = rings[i + 1][(j + 1) % around],
                          d = rings[i][(j + 1) % around];
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  if (!closed) return mesh;
  const std::uint32_t top = add(0, 0), bottom = add(kPi, 0);
  for (std::uint32_t j = 0; j < around; ++j) {
    mesh.triangles.push_back({top, rings.front()[j], rings.front()[(j + 1) % around]});
    mesh.triangles.push_back({bottom, rings.back()[(j + 1) % around], rings.back()[j]});
  }
  return mesh;
}

}  // namespace lamina::testing_tiles
