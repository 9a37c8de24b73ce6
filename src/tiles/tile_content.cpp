#include "tiles/tile_mesh.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/number.h"
#include "lamina/attributes.h"
#include "lamina/error.h"
#include "meshes/formats.h"
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
  ContentWriter(bool compress, std::string& data) : compress_(compress), data_(data) {
    data_.clear();
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

  void finish(std::string& file) {
    json_["buffers"].push_back({{"byteLength", data_.size()}});
    if (compress_) {
      ContentJson fallback{{"byteLength", decoded_}};
      fallback["extensions"]["EXT_meshopt_compression"] = {{"fallback", true}};
      json_["buffers"].push_back(std::move(fallback));
    }
    std::string text = json_.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    file.clear();
    const std::size_t all = glb::kHeaderBytes + 2 * glb::kChunkHeaderBytes + text.size() + data_.size();
    for (const std::uint32_t word : {glb::kMagic, glb::kVersion, static_cast<std::uint32_t>(all),
                                     static_cast<std::uint32_t>(text.size()), glb::kJsonChunk})
      append_little(file, word);
    file += text;
    append_little(file, static_cast<std::uint32_t>(data_.size()));
    append_little(file, glb::kDataChunk);
    file += data_;
  }

  [[nodiscard]] bool compresses() const { return compress_; }

 private:
  bool compress_;
  ContentJson json_;
  std::string& data_;
  std::size_t decoded_ = 0;  ///< bytes of all views after decoding
};

/// Triangles and vertices in the order that compresses well and that graphics processors like.
struct TileOrder {
  std::vector<unsigned int> indices;
  std::vector<std::uint32_t> vertices;  ///< which one of the mesh is at each place
};

/// Numbers of a tile's vertices or triangles in rows, one after the other.
class TileRows {
 public:
  void begin(std::size_t bytes) {
    bytes_.resize(bytes);  // all of them are written
    to_ = reinterpret_cast<std::byte*>(bytes_.data());
  }
  template <class T>
  void put(T value) {
    to_ = store_little(to_, value);
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  std::byte* to_ = nullptr;
};

/// What is z-up in 3D Tiles is y-up in glTF.
Vec3 y_up(const Vec3& v) {
  return {v[0], v[2], -v[1]};
}

/// Whole numbers of 1 or 2 bytes are filled up to 4.
constexpr std::size_t kRowStep = 4;

/// A tile on its way into the writer, and the memory for that.
struct TileWork {
  const TriangleMesh* mesh = nullptr;
  TileOrder order;
  std::vector<std::uint32_t> place;  ///< of the mesh's vertices in the order
  TileRows rows, coded;
  std::string packed, data;

  void settle_order() {
    const std::size_t vertices = mesh->positions.size();
    order.indices.resize(3 * mesh->triangles.size());
    constexpr unsigned int kCache = 16;
    static_assert(sizeof(mesh->triangles[0]) == 3 * sizeof(unsigned int));
    meshopt_optimizeVertexCacheFifo(order.indices.data(), mesh->triangles[0].data(), order.indices.size(), vertices,
                                    kCache);
    constexpr std::uint32_t kUnplaced = 0xFFFFFFFF;
    place.assign(vertices, kUnplaced);
    order.vertices.clear();
    for (unsigned int& v : order.indices) {
      if (place[v] == kUnplaced) {
        place[v] = static_cast<std::uint32_t>(order.vertices.size());
        order.vertices.push_back(v);
      }
      v = place[v];
    }
  }
  const std::string& compressed_rows(const std::string& plain) {
    const std::size_t count = order.vertices.size(), stride = plain.size() / count;
    packed.resize(meshopt_encodeVertexBufferBound(count, stride));
    packed.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(packed.data()), packed.size(),
                                             plain.data(), count, stride));
    return packed;
  }
  const std::string& compressed_indices() {
    packed.resize(meshopt_encodeIndexBufferBound(order.indices.size(), order.vertices.size()));
    packed.resize(meshopt_encodeIndexBuffer(reinterpret_cast<unsigned char*>(packed.data()), packed.size(),
                                            order.indices.data(), order.indices.size()));
    return packed;
  }
};

/// Those in work.rows.
void add_rows(ContentWriter& writer, ContentJson& primitive, const char* semantic, ContentJson accessor,
              TileWork& work) {
  const std::string& rows = work.rows.bytes();
  primitive["attributes"][semantic] =
      writer.add(std::move(accessor), work.order.vertices.size(), rows, ViewMode::attributes,
                 writer.compresses() ? work.compressed_rows(rows) : rows);
}

/// The node's mesh in steps from `middle`.
void add_positions(ContentWriter& writer, ContentJson& primitive, TileWork& work, const Vec3& middle) {
  const TriangleMesh& mesh = *work.mesh;
  const TileOrder& order = work.order;
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
  constexpr std::size_t kFloats = 12, kWords = 8;
  work.rows.begin((words ? kWords : kFloats) * count);
  if (!words) work.coded.begin(kFloats * count);
  for (const std::uint32_t v : order.vertices) {
    for (const double c : y_up(mesh.positions[v] - middle)) {
      if (words) {
        work.rows.put(static_cast<std::int16_t>(c));
      } else {
        work.rows.put(static_cast<float>(c));
        // An exponent of 0 above 24 bits of the number itself.
        work.coded.put(static_cast<std::uint32_t>(static_cast<std::int32_t>(c)) & 0xFFFFFFU);
      }
    }
    if (words) work.rows.put(std::int16_t{0});
  }
  ContentJson accessor{{"componentType", words ? glb::kShort : glb::kFloat}, {"type", "VEC3"}};
  for (std::size_t k = 0; k < 3; ++k) {
    accessor["min"].push_back(low[k] + 0.0);
    accessor["max"].push_back(high[k] + 0.0);
  }
  if (words) {
    add_rows(writer, primitive, "POSITION", std::move(accessor), work);
    return;
  }
  const std::string& rows = work.rows.bytes();
  primitive["attributes"]["POSITION"] =
      writer.add(std::move(accessor), count, rows, ViewMode::floats_of_whole_numbers,
                 writer.compresses() ? work.compressed_rows(work.coded.bytes()) : rows);
}

void add_normals(ContentWriter& writer, ContentJson& primitive, TileWork& work) {
  constexpr double kMost = 127;
  work.rows.begin(4 * work.order.vertices.size());
  for (const std::uint32_t v : work.order.vertices) {
    Vec3 n = meshes::unit(meshes::to_double(work.mesh->normals[v]));
    if (!(meshes::dot(n, n) > 0.5)) n = {0, 0, 1};
    for (const double c : y_up(n)) work.rows.put(static_cast<std::int8_t>(std::lround(kMost * c)));
    work.rows.put(std::int8_t{0});
  }
  add_rows(writer, primitive, "NORMAL", {{"componentType", glb::kByte}, {"normalized", true}, {"type", "VEC3"}}, work);
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

void add_colours(ContentWriter& writer, ContentJson& primitive, TileWork& work) {
  const TriangleMesh& mesh = *work.mesh;
  const auto colours = meshes::find_colours(mesh);
  if (!colours) return;
  const auto alpha = find_attribute(mesh.layout, "alpha");
  const bool words = colours->scale == 1;
  const std::size_t channels = alpha ? 4 : 3;
  const std::array<std::uint16_t, 256>& table = linear_words();
  constexpr std::size_t kWords = 8;
  work.rows.begin((words ? kWords : channels * sizeof(float)) * work.order.vertices.size());
  for (const std::uint32_t v : work.order.vertices) {
    const std::array<float, 3> colour = colours->at(mesh, v);
    const float opacity = alpha ? colours->scale * mesh.attributes[*alpha][v] : 0;
    if (words) {
      for (const float c : colour) work.rows.put(table[byte_of(c)]);
      work.rows.put(static_cast<std::uint16_t>(257 * byte_of(opacity)));
      continue;
    }
    const auto share = [](float channel) { return std::clamp(static_cast<double>(channel) / 255, 0.0, 1.0); };
    for (const float c : colour) work.rows.put(static_cast<float>(meshes::linear_of(share(c))));
    if (alpha) work.rows.put(static_cast<float>(share(opacity)));
  }
  ContentJson accessor{{"componentType", words ? glb::kUshort : glb::kFloat},
                       {"type", channels == 4 ? "VEC4" : "VEC3"}};
  if (words) accessor["normalized"] = true;
  accessor["extras"]["type"] = ply_name(mesh.layout[colours->columns[0]].type);
  add_rows(writer, primitive, "COLOR_0", std::move(accessor), work);
}

/// What is no colour, as "_NAME".
void add_attributes(ContentWriter& writer, ContentJson& primitive, TileWork& work) {
  const TriangleMesh& mesh = *work.mesh;
  constexpr int kFloatBits = 15, kAllBits = 23;  // those left out are 0 and compress to nothing
  const auto colours = meshes::find_colours(mesh);
  std::set<std::string> taken;
  for (std::size_t a = 0; a < mesh.layout.size(); ++a) {
    const AttributeSpec& spec = mesh.layout[a];
    if (colours && is_colour(spec.name)) continue;
    const glb::Component component = glb::component_of(spec.type);
    const ScalarType type = component == glb::kFloat ? ScalarType::float32 : spec.type;
    const int bits = is_integer_type(spec.type) ? kAllBits : kFloatBits;
    work.rows.begin(kRowStep * work.order.vertices.size());
    for (const std::uint32_t v : work.order.vertices) {
      const float value = std::isfinite(mesh.attributes[a][v]) ? mesh.attributes[a][v] : 0.0F;
      with_scalar_type(type, [&](auto zero) {
        using Number = decltype(zero);
        if constexpr (std::is_floating_point_v<Number>) {
          work.rows.put(static_cast<float>(meshopt_quantizeFloat(value, bits)));
        } else {
          work.rows.put(to_scalar<Number>(value));
          for (std::size_t byte = sizeof(Number); byte < kRowStep; ++byte) work.rows.put(std::uint8_t{0});
        }
      });
    }
    std::string semantic = glb::semantic_of(spec.name);
    while (!taken.insert(semantic).second) semantic += '_';
    add_rows(writer, primitive, semantic.c_str(),
             {{"name", spec.name}, {"componentType", component}, {"type", "SCALAR"}}, work);
  }
}

void add_indices(ContentWriter& writer, ContentJson& primitive, TileWork& work) {
  const TileOrder& order = work.order;
  const bool words = order.vertices.size() < 0xFFFF;
  work.rows.begin((words ? sizeof(std::uint16_t) : sizeof(std::uint32_t)) * order.indices.size());
  for (const unsigned int v : order.indices) {
    if (words) {
      work.rows.put(static_cast<std::uint16_t>(v));
    } else {
      work.rows.put(static_cast<std::uint32_t>(v));
    }
  }
  ContentJson accessor{
      {"componentType", words ? glb::kUshort : glb::kUint}, {"type", "SCALAR"}, {"count", order.indices.size()}};
  const std::string& rows = work.rows.bytes();
  primitive["indices"] = writer.add(std::move(accessor), order.vertices.size(), rows, ViewMode::triangles,
                                    writer.compresses() ? work.compressed_indices() : rows);
}

}  // namespace

struct TileEncoder::Memory {
  TileWork work;
  std::string file;
};

TileEncoder::TileEncoder() : memory_(std::make_unique<Memory>()) {}
TileEncoder::~TileEncoder() = default;

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

const std::string& TileEncoder::content(const TriangleMesh& mesh, const TileLattice& lattice, bool compress) {
  TileWork& work = memory_->work;
  work.mesh = &mesh;
  work.settle_order();
  const StepBox box = box_of_tile(mesh);
  Vec3 middle{};
  for (std::size_t k = 0; k < 3; ++k) middle[k] = std::nearbyint(0.5 * (box.low[k] + box.high[k]));
  ContentWriter writer(compress, work.data);
  ContentJson& json = writer.json();
  json["scene"] = 0;
  json["scenes"] = ContentJson::array({{{"nodes", ContentJson::array({0})}}});
  const double step = lattice.step;
  const Vec3 translation = y_up(step * middle);
  json["nodes"] = ContentJson::array({{{"mesh", 0}, {"translation", translation}, {"scale", Vec3{step, step, step}}}});
  json["materials"] = ContentJson::array(
      {{{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}}, {"doubleSided", true}}});
  ContentJson primitive;
  add_positions(writer, primitive, work, middle);
  add_normals(writer, primitive, work);
  add_colours(writer, primitive, work);
  add_attributes(writer, primitive, work);
  add_indices(writer, primitive, work);
  primitive["mode"] = 4;
  primitive["material"] = 0;
  json["meshes"] = ContentJson::array({{{"primitives", ContentJson::array({std::move(primitive)})}}});
  writer.finish(memory_->file);
  return memory_->file;
}

}  // namespace lamina::tiles
