#include "meshes/glb_document.h"

#include <utility>

#include "meshes/glb.h"

namespace lamina::meshes {
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

}  // namespace lamina::meshes
