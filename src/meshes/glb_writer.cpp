#include "meshes/glb.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/number.h"
#include "base/output_file.h"
#include "lamina/error.h"
#include "meshes/formats.h"
#include "meshes/mesh_blocks.h"

namespace lamina::meshes {
namespace {

std::byte* put_unit_normal(const std::array<float, 3>& normal, std::byte* to) {
  constexpr double kUnit = 1e-3;  // what rounding leaves; as far from 1 the validator still agrees
  const double x = normal[0], y = normal[1], z = normal[2];
  const double length = std::sqrt(x * x + y * y + z * z);
  if (std::abs(length - 1) <= kUnit) {
    for (const float c : normal) to = store_little(to, c);
    return to;
  }
  const bool usable = length > 0 && std::isfinite(length);
  for (const double c : {usable ? x / length : 0, usable ? y / length : 0, usable ? z / length : 1})
    to = store_little(to, static_cast<float>(c));
  return to;
}

/// A channel of 0-255 as a linear 16-bit number: neighbours differ by 20 at the least, so that each comes back.
std::uint16_t linear_word(float channel) {
  static const std::array<std::uint16_t, 256> kWords = [] {
    std::array<std::uint16_t, 256> words{};
    for (std::size_t c = 0; c < words.size(); ++c)
      words[c] = static_cast<std::uint16_t>(std::lround(65535 * linear_of(static_cast<double>(c) / 255)));
    return words;
  }();
  return kWords[to_scalar<std::uint8_t>(std::isfinite(channel) ? channel : 0.0F)];
}

double share_of(float channel) {
  return std::isfinite(channel) ? std::clamp(static_cast<double>(channel) / 255, 0.0, 1.0) : 0.0;
}

/// Colours that become COLOR_0: all channels of one type; `alpha` where it has that type as well.
struct GlbColours {
  ColourColumns columns;
  std::optional<std::size_t> alpha;
  [[nodiscard]] bool has(std::size_t attribute) const {
    return std::find(columns.columns.begin(), columns.columns.end(), attribute) != columns.columns.end() ||
           alpha == attribute;
  }
};

std::optional<GlbColours> glb_colours(const AttributeLayout& layout) {
  const auto found = find_colours(layout);
  if (!found) return std::nullopt;
  const ScalarType type = layout[found->columns[0]].type;
  for (const std::size_t c : found->columns) {
    if (layout[c].type != type) return std::nullopt;
  }
  GlbColours colours{*found, find_attribute(layout, "alpha")};
  if (colours.alpha && layout[*colours.alpha].type != type) colours.alpha.reset();
  return colours;
}

GlbColumn colour_column(const GlbColours& colours, const AttributeSpec& red) {
  const std::size_t channels = colours.alpha ? 4 : 3;
  const bool words = colours.columns.scale == 1;
  GlbColumn column{"COLOR_0", {{"componentType", words ? glb::kUshort : glb::kFloat}}, words ? 8 : 4 * channels};
  if (words) column.accessor["normalized"] = true;
  column.accessor["type"] = channels == 4 ? "VEC4" : "VEC3";
  column.accessor["extras"]["type"] = ply_name(red.type);
  column.encode = [=](const TriangleMesh& block, std::size_t v, std::byte* to) {
    const std::array<float, 3> rgb = colours.columns.at(block, v);
    const float alpha = colours.alpha ? colours.columns.scale * block.attributes[*colours.alpha][v] : 255.0F;
    if (words) {
      for (const float c : rgb) to = store_little(to, linear_word(c));
      store_little(to, colours.alpha ? static_cast<std::uint16_t>(std::lround(65535 * share_of(std::round(alpha))))
                                     : std::uint16_t{0});
    } else {
      for (const float c : rgb) to = store_little(to, static_cast<float>(linear_of(share_of(c))));
      if (colours.alpha) store_little(to, static_cast<float>(share_of(alpha)));
    }
  };
  return column;
}

GlbColumn attribute_column(const AttributeLayout& layout, std::size_t attribute, std::set<std::string>& taken) {
  const AttributeSpec& spec = layout[attribute];
  const glb::Component component = glb::component_of(spec.type);
  GlbColumn column{
      glb::semantic_of(spec.name), {{"name", spec.name}, {"componentType", component}, {"type", "SCALAR"}}, 4};
  while (!taken.insert(column.semantic).second) column.semantic += '_';
  if (component == glb::kFloat && spec.type != ScalarType::float32)
    column.accessor["extras"]["type"] = ply_name(spec.type);
  const ScalarType type = component == glb::kFloat ? ScalarType::float32 : spec.type;
  column.encode = [attribute, type](const TriangleMesh& block, std::size_t v, std::byte* to) {
    const float value = block.attributes[attribute][v];
    with_scalar_type(
        type, [&](auto zero) { store_little(to, to_scalar<decltype(zero)>(std::isfinite(value) ? value : 0.0F)); });
  };
  return column;
}

}  // namespace

GlbBox glb_box_of(MeshBlocks& mesh, const std::string& name) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  GlbBox box;
  box.low.fill(kInfinite);
  box.high.fill(-kInfinite);
  std::uint64_t vertex = 0;
  for_vertices(mesh, [&](const TriangleMesh& block, std::size_t v) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double c = block.positions[v][k];
      if (!std::isfinite(c)) {
        throw Error(
            ExitCode::usage,
            fmt::format("{}: vertex {} has a coordinate that is not finite, which a GLB cannot hold", name, vertex));
      }
      box.low[k] = std::min(box.low[k], c);
      box.high[k] = std::max(box.high[k], c);
      box.floats = box.floats && static_cast<double>(static_cast<float>(c)) == c;
    }
    ++vertex;
  });
  if (box.floats) return box;
  double extent = 0;
  for (std::size_t k = 0; k < 3; ++k) extent = std::max(extent, box.high[k] - box.low[k]);
  if (!(extent <= std::numeric_limits<float>::max())) {
    throw Error(ExitCode::usage,
                fmt::format("{}: positions reach over {:g}, more than a GLB's floats can hold", name, extent));
  }
  // A round middle, so that to subtract it loses nothing and moved vertices seldom have another one.
  const double step = std::exp2(std::ceil(std::log2(extent)) - 4);
  for (std::size_t k = 0; k < 3; ++k) {
    const double middle = box.low[k] + 0.5 * (box.high[k] - box.low[k]);
    box.middle[k] = extent > 0 ? std::round(middle / step) * step : middle;
  }
  return box;
}

std::vector<GlbColumn> glb_columns(const AttributeLayout& layout, bool normals, const GlbBox& box) {
  std::vector<GlbColumn> columns;
  GlbColumn positions{"POSITION", {{"componentType", glb::kFloat}, {"type", "VEC3"}}, 12};
  for (std::size_t k = 0; k < 3; ++k) {
    // Rounding keeps the order, so these are the bounds of what is written, and doubles print them exactly.
    positions.accessor["min"].push_back(static_cast<double>(static_cast<float>(box.low[k] - box.middle[k])));
    positions.accessor["max"].push_back(static_cast<double>(static_cast<float>(box.high[k] - box.middle[k])));
  }
  positions.encode = [middle = box.middle, floats = box.floats](const TriangleMesh& block, std::size_t v,
                                                                std::byte* to) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double c = block.positions[v][k];
      to = store_little(to, static_cast<float>(floats ? c : c - middle[k]));
    }
  };
  columns.push_back(std::move(positions));
  if (normals) {
    columns.push_back(
        {"NORMAL",
         {{"componentType", glb::kFloat}, {"type", "VEC3"}},
         12,
         [](const TriangleMesh& block, std::size_t v, std::byte* to) { put_unit_normal(block.normals[v], to); }});
  }
  const auto colours = glb_colours(layout);
  std::set<std::string> taken;
  for (std::size_t a = 0; a < layout.size(); ++a) {
    if (colours && a == colours->columns.columns[0]) columns.push_back(colour_column(*colours, layout[a]));
    if (!colours || !colours->has(a)) columns.push_back(attribute_column(layout, a, taken));
  }
  return columns;
}

namespace {

/// The lists of the JSON while pieces are added to it.
class GlbDocument {
 public:
  GlbDocument() {
    json_["asset"] = {{"version", "2.0"}, {"generator", "lamina " LAMINA_VERSION}};
    json_["scene"] = 0;
    json_["scenes"] = GlbJson::array({GlbJson::object()});
  }
  GlbJson& json() { return json_; }

  /// The primitive of a piece, whose buffer is the next one.
  GlbJson add(const MeshBlocks& mesh, const GlbPiece& piece) {
    constexpr int kPoints = 0, kTriangles = 4;
    bytes_ = 0;
    GlbJson primitive;
    for (const GlbColumn& column : glb_columns(mesh.layout(), mesh.has_normals(), piece.box))
      primitive["attributes"][column.semantic] = view(column.accessor, piece.vertices, column.stride, kOfVertices);
    const GlbJson whole{{"componentType", glb::kUint}, {"type", "SCALAR"}};
    if (piece.triangles > 0) primitive["indices"] = view(whole, 3 * piece.triangles, sizeof(std::uint32_t), kOfIndices);
    primitive["mode"] = piece.triangles > 0 ? kTriangles : kPoints;
    primitive["material"] = 0;
    if (piece.runs > 0)
      primitive["extras"]["vertices"] = view(whole, 2 * piece.runs, sizeof(std::uint32_t), kOfNothing);
    GlbJson buffer{{"byteLength", bytes_}};
    if (!piece.uri.empty()) buffer["uri"] = piece.uri;
    json_["buffers"].push_back(std::move(buffer));
    return primitive;
  }

 private:
  static constexpr int kOfVertices = 34962, kOfIndices = 34963, kOfNothing = 0;

  std::size_t view(GlbJson accessor, std::uint64_t count, std::uint64_t stride, int target) {
    const std::size_t number = json_["bufferViews"].size();
    GlbJson view{{"buffer", json_["buffers"].size()}, {"byteOffset", bytes_}, {"byteLength", count * stride}};
    if (target == kOfVertices) view["byteStride"] = stride;
    if (target != kOfNothing) view["target"] = target;
    json_["bufferViews"].push_back(std::move(view));
    accessor["bufferView"] = number;
    accessor["count"] = count;
    json_["accessors"].push_back(std::move(accessor));
    bytes_ += count * stride;
    return number;
  }

  GlbJson json_;
  std::uint64_t bytes_ = 0;  ///< of the buffer
};

}  // namespace

std::string describe_glb(const MeshBlocks& mesh, const std::vector<GlbPiece>& pieces) {
  GlbDocument document;
  GlbJson& json = document.json();
  if (const std::vector<std::string> comments = mesh.comments(); !comments.empty())
    json["asset"]["extras"]["comments"] = comments;
  if (mesh.vertices() > 0) {
    GlbJson primitives = GlbJson::array();
    for (const GlbPiece& piece : pieces) primitives.push_back(document.add(mesh, piece));
    json["scenes"][0]["nodes"] = GlbJson::array({0});
    json["nodes"] = GlbJson::array({{{"mesh", 0}}});
    if (!pieces[0].box.floats) json["nodes"][0]["translation"] = pieces[0].box.middle;
    json["meshes"] = GlbJson::array({{{"primitives", std::move(primitives)}}});
    // Without one it would be of metal, and an open surface would have no back.
    json["materials"] = GlbJson::array(
        {{{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}}, {"doubleSided", true}}});
  }
  std::string text = json.dump(-1, ' ', false, GlbJson::error_handler_t::replace);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  return text;
}

std::uint64_t glb_file_bytes(const std::string& json, std::uint64_t data) {
  return glb::kHeaderBytes + glb::kChunkHeaderBytes + json.size() + (data > 0 ? glb::kChunkHeaderBytes + data : 0);
}

void GlbBytes::add_head(const std::string& json, std::uint64_t data) {
  for (const std::uint32_t word : {glb::kMagic, glb::kVersion, static_cast<std::uint32_t>(glb_file_bytes(json, data)),
                                   static_cast<std::uint32_t>(json.size()), glb::kJsonChunk})
    add(word);
  add(reinterpret_cast<const std::byte*>(json.data()), json.size());
  if (data == 0) return;
  for (const std::uint32_t word : {static_cast<std::uint32_t>(data), glb::kDataChunk}) add(word);
}

namespace {

/// A mesh that one buffer holds.
struct WholeGlb {
  GlbPiece piece;
  std::string json;
  std::uint64_t data = 0;
  [[nodiscard]] std::uint64_t bytes() const { return glb_file_bytes(json, data); }
};

std::uint64_t glb_bytes_of(const MeshBlocks& mesh) {
  return glb_data_bytes(mesh.layout(), mesh.has_normals(), mesh.vertices(), mesh.triangles());
}

WholeGlb whole_glb(MeshBlocks& mesh, const std::string& name) {
  WholeGlb whole;
  whole.piece.vertices = mesh.vertices();
  whole.piece.triangles = mesh.triangles();
  if (mesh.vertices() > 0) whole.piece.box = glb_box_of(mesh, name);
  whole.data = mesh.vertices() > 0 ? glb_bytes_of(mesh) : 0;
  whole.json = describe_glb(mesh, {whole.piece});
  return whole;
}

void write_whole(MeshBlocks& mesh, const WholeGlb& whole, const GlbBytes::Sink& sink) {
  GlbBytes bytes(sink);
  bytes.add_head(whole.json, whole.data);
  for (const GlbColumn& column : glb_columns(mesh.layout(), mesh.has_normals(), whole.piece.box)) {
    for_vertices(mesh, [&](const TriangleMesh& block, std::size_t v) {
      std::array<std::byte, kMostGlbColumn> record{};
      column.encode(block, v, record.data());
      bytes.add(record.data(), column.stride);
    });
  }
  if (mesh.vertices() > 0) {
    for_triangles(mesh, [&](const std::array<std::uint32_t, 3>& t) {
      bytes.add(reinterpret_cast<const std::byte*>(t.data()), sizeof t);
    });
  }
  bytes.flush();
}

void require_one_file(std::uint64_t bytes, const std::string& name) {
  if (bytes <= GlbLimits{}.file) return;
  throw Error(
      ExitCode::budget,
      fmt::format("{}: a single GLB holds at most 4 GB, the mesh takes {:.1f} GB in it; write a .ply, or cut the cloud",
                  name, static_cast<double>(bytes) * 1e-9));
}

}  // namespace

std::uint64_t glb_data_bytes(const AttributeLayout& layout, bool normals, std::uint64_t vertices,
                             std::uint64_t triangles) {
  std::uint64_t vertex = 0;
  for (const GlbColumn& column : glb_columns(layout, normals, {})) vertex += column.stride;
  return vertices * vertex + triangles * kGlbTriangleBytes;
}

void write_glb(MeshBlocks& mesh, ResultFile& out, const GlbLimits& limits) {
  for (const std::string& old : companions_of_glb(out.path())) out.replace_companion(old);
  if (glb_bytes_of(mesh) <= limits.file) {
    const WholeGlb whole = whole_glb(mesh, out.name());
    if (whole.bytes() <= limits.file)
      return write_whole(mesh, whole, [&out](std::string_view bytes) { out.write(bytes); });
  }
  write_glb_set(mesh, out, limits);
}

void write_glb(MeshBlocks& mesh, const std::string& name, const std::function<void(std::string_view)>& sink) {
  require_one_file(glb_bytes_of(mesh), name);
  const WholeGlb whole = whole_glb(mesh, name);
  require_one_file(whole.bytes(), name);
  write_whole(mesh, whole, sink);
}

}  // namespace lamina::meshes
