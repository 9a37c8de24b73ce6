#include "tiles/tile_content.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <type_traits>
#include <vector>

#include "base/little_endian.h"
#include "base/scalar_type.h"
#include "lamina/attributes.h"
#include "lamina/error.h"
#include "meshes/colours.h"
#include "meshes/glb.h"

namespace lamina::tiles {
namespace {

using meshes::Vec3;
using meshes::operator-;
using meshes::operator*;
namespace glb = meshes::glb;
using ContentJson = nlohmann::ordered_json;

/// How the decoder gets a view's numbers back.
enum class ViewMode { attributes, floats_of_whole_numbers, triangles };

/// The JSON and the data of one file, view by view.
class ContentWriter {
 public:
  explicit ContentWriter(bool compress) : compress_(compress) {
    json_["asset"] = {{"version", "2.0"}, {"generator", "lamina " LAMINA_VERSION}};
    json_["extensionsUsed"] = ContentJson::array({"KHR_mesh_quantization"});
    if (compress) json_["extensionsUsed"].push_back("EXT_meshopt_compression");
    json_["extensionsRequired"] = json_["extensionsUsed"];
  }

  ContentJson& json() { return json_; }

  /// Adds a view of `count` rows as they are to be after decoding, `coded` as they are to be compressed, and its
  /// accessor, whose number is returned.
  std::size_t add(ContentJson accessor, std::size_t count, const std::string& plain, ViewMode mode,
                  const std::string& coded) {
    constexpr int kOfVertices = 34962, kOfIndices = 34963;
    const std::size_t rows = mode == ViewMode::triangles ? accessor["count"].get<std::size_t>() : count;
    const std::size_t stride = plain.size() / std::max<std::size_t>(rows, 1);
    ContentJson view;
    view["buffer"] = compress_ ? 1 : 0;
    view["byteOffset"] = compress_ ? decoded_ : data_.size();
    view["byteLength"] = plain.size();
    if (mode != ViewMode::triangles) view["byteStride"] = stride;
    view["target"] = mode == ViewMode::triangles ? kOfIndices : kOfVertices;
    if (compress_) {
      ContentJson extension{
          {"buffer", 0},   {"byteOffset", data_.size()}, {"byteLength", coded.size()}, {"byteStride", stride},
          {"count", rows}, {"mode", "ATTRIBUTES"}};
      if (mode == ViewMode::triangles) extension["mode"] = "TRIANGLES";
      if (mode == ViewMode::floats_of_whole_numbers) extension["filter"] = "EXPONENTIAL";
      view["extensions"]["EXT_meshopt_compression"] = std::move(extension);
      decoded_ += (plain.size() + 3) / 4 * 4;
    }
    data_ += compress_ ? coded : plain;
    data_.resize((data_.size() + 3) / 4 * 4, '\0');
    accessor["bufferView"] = json_["bufferViews"].size();
    accessor["count"] = rows;
    json_["bufferViews"].push_back(std::move(view));
    json_["accessors"].push_back(std::move(accessor));
    return json_["accessors"].size() - 1;
  }

  std::string finish() {
    json_["buffers"].push_back({{"byteLength", data_.size()}});
    if (compress_) {
      ContentJson fallback{{"byteLength", decoded_}};
      fallback["extensions"]["EXT_meshopt_compression"] = {{"fallback", true}};
      json_["buffers"].push_back(std::move(fallback));
    }
    std::string text = json_.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string file;
    const std::size_t all = glb::kHeaderBytes + 2 * glb::kChunkHeaderBytes + text.size() + data_.size();
    for (const std::uint32_t word : {glb::kMagic, glb::kVersion, static_cast<std::uint32_t>(all),
                                     static_cast<std::uint32_t>(text.size()), glb::kJsonChunk})
      append_little(file, word);
    file += text;
    append_little(file, static_cast<std::uint32_t>(data_.size()));
    append_little(file, glb::kDataChunk);
    file += data_;
    return file;
  }

  [[nodiscard]] bool compresses() const { return compress_; }

 private:
  bool compress_;
  ContentJson json_;
  std::string data_;
  std::size_t decoded_ = 0;  ///< bytes of all views after decoding
};

std::string compressed_rows(const std::string& rows, std::size_t count) {
  const std::size_t stride = rows.size() / count;
  std::string out(meshopt_encodeVertexBufferBound(count, stride), '\0');
  out.resize(
      meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(out.data()), out.size(), rows.data(), count, stride));
  return out;
}

std::string compressed_indices(const std::vector<unsigned int>& indices, std::size_t vertices) {
  std::string out(meshopt_encodeIndexBufferBound(indices.size(), vertices), '\0');
  out.resize(meshopt_encodeIndexBuffer(reinterpret_cast<unsigned char*>(out.data()), out.size(), indices.data(),
                                       indices.size()));
  return out;
}

/// Triangles and vertices in the order that compresses well and that graphics processors like.
struct TileOrder {
  std::vector<unsigned int> indices;
  std::vector<std::uint32_t> vertices;  ///< which one of the mesh is at each place
};

TileOrder order_of(const TriangleMesh& mesh) {
  const std::size_t vertices = mesh.positions.size();
  TileOrder order;
  order.indices.resize(3 * mesh.triangles.size());
  constexpr unsigned int kCache = 16;
  static_assert(sizeof(mesh.triangles[0]) == 3 * sizeof(unsigned int));
  meshopt_optimizeVertexCacheFifo(order.indices.data(), mesh.triangles[0].data(), order.indices.size(), vertices,
                                  kCache);
  constexpr std::uint32_t kUnplaced = 0xFFFFFFFF;
  std::vector<std::uint32_t> place(vertices, kUnplaced);
  for (unsigned int& v : order.indices) {
    if (place[v] == kUnplaced) {
      place[v] = static_cast<std::uint32_t>(order.vertices.size());
      order.vertices.push_back(v);
    }
    v = place[v];
  }
  return order;
}

/// What is z-up in 3D Tiles is y-up in glTF.
Vec3 y_up(const Vec3& v) {
  return {v[0], v[2], -v[1]};
}

void add_rows(ContentWriter& writer, ContentJson& primitive, const char* semantic, ContentJson accessor,
              const std::string& rows, std::size_t count) {
  primitive["attributes"][semantic] = writer.add(std::move(accessor), count, rows, ViewMode::attributes,
                                                 writer.compresses() ? compressed_rows(rows, count) : std::string());
}

/// The node's mesh in steps from `middle`.
void add_positions(ContentWriter& writer, ContentJson& primitive, const TriangleMesh& mesh, const TileOrder& order,
                   const Vec3& middle) {
  const std::size_t count = order.vertices.size();
  Vec3 low = y_up(mesh.positions[order.vertices[0]] - middle), high = low;
  for (const std::uint32_t v : order.vertices) {
    const Vec3 at = y_up(mesh.positions[v] - middle);
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], at[k]);
      high[k] = std::max(high[k], at[k]);
    }
  }
  constexpr double kMost = std::numeric_limits<std::int16_t>::max();
  bool words = true;
  for (std::size_t k = 0; k < 3; ++k) words = words && low[k] >= -kMost && high[k] <= kMost;
  std::string rows, coded;
  rows.reserve(12 * count);
  for (const std::uint32_t v : order.vertices) {
    for (const double c : y_up(mesh.positions[v] - middle)) {
      if (words) {
        append_little(rows, static_cast<std::int16_t>(c));
      } else {
        append_little(rows, static_cast<float>(c));
        // An exponent of 0 above 24 bits of the number itself.
        append_little(coded, static_cast<std::uint32_t>(static_cast<std::int32_t>(c)) & 0xFFFFFFU);
      }
    }
    if (words) append_little(rows, std::int16_t{0});
  }
  ContentJson accessor{{"componentType", words ? glb::kShort : glb::kFloat}, {"type", "VEC3"}};
  for (std::size_t k = 0; k < 3; ++k) {
    accessor["min"].push_back(low[k] + 0.0);
    accessor["max"].push_back(high[k] + 0.0);
  }
  if (words) {
    add_rows(writer, primitive, "POSITION", std::move(accessor), rows, count);
    return;
  }
  primitive["attributes"]["POSITION"] = writer.add(std::move(accessor), count, rows, ViewMode::floats_of_whole_numbers,
                                                   writer.compresses() ? compressed_rows(coded, count) : std::string());
}

void add_normals(ContentWriter& writer, ContentJson& primitive, const TriangleMesh& mesh, const TileOrder& order) {
  constexpr double kMost = 127;
  std::string rows;
  for (const std::uint32_t v : order.vertices) {
    Vec3 n = meshes::unit(meshes::to_double(mesh.normals[v]));
    if (!(meshes::dot(n, n) > 0.5)) n = {0, 0, 1};
    for (const double c : y_up(n)) append_little(rows, static_cast<std::int8_t>(std::lround(kMost * c)));
    append_little(rows, std::int8_t{0});
  }
  add_rows(writer, primitive, "NORMAL", {{"componentType", glb::kByte}, {"normalized", true}, {"type", "VEC3"}}, rows,
           order.vertices.size());
}

std::uint8_t byte_of(float channel) {
  return static_cast<std::uint8_t>(std::clamp(std::round(channel), 0.0F, 255.0F));
}

/// Linear, of 16 bits, of encoded colours of 8.
const std::array<std::uint16_t, 256>& linear_words() {
  static const std::array<std::uint16_t, 256> words = [] {
    std::array<std::uint16_t, 256> all{};
    for (std::size_t c = 0; c < all.size(); ++c)
      all[c] = static_cast<std::uint16_t>(std::lround(65535 * meshes::linear_of(static_cast<double>(c) / 255)));
    return all;
  }();
  return words;
}

void add_colours(ContentWriter& writer, ContentJson& primitive, const TriangleMesh& mesh, const TileOrder& order) {
  const auto colours = meshes::find_colours(mesh);
  if (!colours) return;
  const auto alpha = find_attribute(mesh.layout, "alpha");
  const bool words = colours->scale == 1;
  const std::size_t channels = alpha ? 4 : 3;
  std::string rows;
  for (const std::uint32_t v : order.vertices) {
    const std::array<float, 3> colour = colours->at(mesh, v);
    const float opacity = alpha ? colours->scale * mesh.attributes[*alpha][v] : 0;
    if (words) {
      for (const float c : colour) append_little(rows, linear_words()[byte_of(c)]);
      append_little(rows, static_cast<std::uint16_t>(257 * byte_of(opacity)));
      continue;
    }
    const auto share = [](float channel) { return std::clamp(static_cast<double>(channel) / 255, 0.0, 1.0); };
    for (const float c : colour) append_little(rows, static_cast<float>(meshes::linear_of(share(c))));
    if (alpha) append_little(rows, static_cast<float>(share(opacity)));
  }
  ContentJson accessor{{"componentType", words ? glb::kUshort : glb::kFloat},
                       {"type", channels == 4 ? "VEC4" : "VEC3"}};
  if (words) accessor["normalized"] = true;
  accessor["extras"]["type"] = ply_name(mesh.layout[colours->columns[0]].type);
  add_rows(writer, primitive, "COLOR_0", std::move(accessor), rows, order.vertices.size());
}

/// What is no colour, as "_NAME".
void add_attributes(ContentWriter& writer, ContentJson& primitive, const TriangleMesh& mesh, const TileOrder& order) {
  constexpr int kFloatBits = 15, kAllBits = 23;  // those left out are 0 and compress to nothing
  const auto colours = meshes::find_colours(mesh);
  std::set<std::string> taken;
  for (std::size_t a = 0; a < mesh.layout.size(); ++a) {
    const AttributeSpec& spec = mesh.layout[a];
    if (colours && is_colour(spec.name)) continue;
    const glb::Component component = glb::component_of(spec.type);
    const ScalarType type = component == glb::kFloat ? ScalarType::float32 : spec.type;
    const int bits = is_integer_type(spec.type) ? kAllBits : kFloatBits;
    std::string rows;
    rows.reserve(4 * order.vertices.size());
    for (const std::uint32_t v : order.vertices) {
      const float value = std::isfinite(mesh.attributes[a][v]) ? mesh.attributes[a][v] : 0.0F;
      with_scalar_type(type, [&](auto zero) {
        using Number = decltype(zero);
        if constexpr (std::is_floating_point_v<Number>) {
          append_little(rows, static_cast<float>(meshopt_quantizeFloat(value, bits)));
        } else {
          append_little(rows, to_scalar<Number>(value));
        }
      });
      rows.resize((rows.size() + 3) / 4 * 4, '\0');
    }
    std::string semantic = glb::semantic_of(spec.name);
    while (!taken.insert(semantic).second) semantic += '_';
    add_rows(writer, primitive, semantic.c_str(),
             {{"name", spec.name}, {"componentType", component}, {"type", "SCALAR"}}, rows, order.vertices.size());
  }
}

void add_indices(ContentWriter& writer, ContentJson& primitive, const TileOrder& order) {
  const bool words = order.vertices.size() < 0xFFFF;
  std::string plain;
  for (const unsigned int v : order.indices) {
    if (words) {
      append_little(plain, static_cast<std::uint16_t>(v));
    } else {
      append_little(plain, static_cast<std::uint32_t>(v));
    }
  }
  ContentJson accessor{
      {"componentType", words ? glb::kUshort : glb::kUint}, {"type", "SCALAR"}, {"count", order.indices.size()}};
  primitive["indices"] =
      writer.add(std::move(accessor), order.vertices.size(), plain, ViewMode::triangles,
                 writer.compresses() ? compressed_indices(order.indices, order.vertices.size()) : std::string());
}

}  // namespace

StepBox box_of_tile(const TriangleMesh& mesh) {
  StepBox box{mesh.positions[0], mesh.positions[0]};
  for (const Vec3& at : mesh.positions) {
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = std::min(box.low[k], at[k]);
      box.high[k] = std::max(box.high[k], at[k]);
    }
  }
  return box;
}

std::string tile_content(const TriangleMesh& mesh, const TileLattice& lattice, bool compress) {
  const TileOrder order = order_of(mesh);
  const StepBox box = box_of_tile(mesh);
  Vec3 middle{};
  for (std::size_t k = 0; k < 3; ++k) middle[k] = std::nearbyint(0.5 * (box.low[k] + box.high[k]));
  ContentWriter writer(compress);
  ContentJson& json = writer.json();
  json["scene"] = 0;
  json["scenes"] = ContentJson::array({{{"nodes", ContentJson::array({0})}}});
  const double step = lattice.step;
  const Vec3 translation = y_up(step * middle);
  json["nodes"] = ContentJson::array({{{"mesh", 0}, {"translation", translation}, {"scale", Vec3{step, step, step}}}});
  json["materials"] = ContentJson::array(
      {{{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}}, {"doubleSided", true}}});
  ContentJson primitive;
  add_positions(writer, primitive, mesh, order, middle);
  add_normals(writer, primitive, mesh, order);
  add_colours(writer, primitive, mesh, order);
  add_attributes(writer, primitive, mesh, order);
  add_indices(writer, primitive, order);
  primitive["mode"] = 4;
  primitive["material"] = 0;
  json["meshes"] = ContentJson::array({{{"primitives", ContentJson::array({std::move(primitive)})}}});
  return writer.finish();
}

}  // namespace lamina::tiles
