// The scene of a GLB as one mesh.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/number.h"
#include "lamina/error.h"
#include "lamina/mesh.h"
#include "meshes/formats.h"
#include "meshes/glb.h"

namespace lamina::meshes {
namespace {

using GlbObject = nlohmann::json;

/// Column after column, as in glTF.
using GlbMatrix = std::array<double, 16>;
constexpr GlbMatrix kNoTransform{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

GlbMatrix product(const GlbMatrix& a, const GlbMatrix& b) {
  GlbMatrix out{};
  for (std::size_t column = 0; column < 4; ++column) {
    for (std::size_t row = 0; row < 4; ++row) {
      for (std::size_t k = 0; k < 4; ++k) out[4 * column + row] += a[4 * k + row] * b[4 * column + k];
    }
  }
  return out;
}

/// What a node's transform does to positions and normals.
class GlbTransform {
 public:
  explicit GlbTransform(const GlbMatrix& m) : m_(m) {
    for (std::size_t i = 0; i < 12; ++i) turns_ = turns_ || m[i] != kNoTransform[i];
    moves_ = turns_ || m[12] != 0 || m[13] != 0 || m[14] != 0;
    // The cofactors: the inverse's transpose, times the determinant.
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t d = (c + 1) % 3, e = (c + 2) % 3;
      for (std::size_t r = 0; r < 3; ++r) {
        const std::size_t s = (r + 1) % 3, t = (r + 2) % 3;
        cofactors_[3 * c + r] = m[4 * d + s] * m[4 * e + t] - m[4 * d + t] * m[4 * e + s];
      }
    }
    mirrors_ = m[0] * cofactors_[0] + m[1] * cofactors_[1] + m[2] * cofactors_[2] < 0;
  }
  [[nodiscard]] bool mirrors() const { return mirrors_; }
  void move(std::array<double, 3>& p) const {
    if (!moves_) return;
    const std::array<double, 3> from = p;
    for (std::size_t r = 0; r < 3; ++r) {
      p[r] = turns_ ? m_[r] * from[0] + m_[4 + r] * from[1] + m_[8 + r] * from[2] + m_[12 + r] : from[r] + m_[12 + r];
    }
  }
  void turn(std::array<float, 3>& n) const {
    if (!turns_) return;
    std::array<double, 3> to{};
    double length2 = 0;
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t c = 0; c < 3; ++c) to[r] += (mirrors_ ? -1 : 1) * cofactors_[3 * c + r] * n[c];
      length2 += to[r] * to[r];
    }
    const double scale = length2 > 0 ? 1 / std::sqrt(length2) : 0;
    for (std::size_t r = 0; r < 3; ++r) n[r] = static_cast<float>(scale * to[r]);
  }

 private:
  GlbMatrix m_;
  std::array<double, 9> cofactors_{};
  bool turns_ = false, moves_ = false, mirrors_ = false;
};

/// The greatest value of a colour channel: what white is in its type.
double white_of(ScalarType type) {
  return 255 / static_cast<double>(colour_scale(type));
}

class GlbReader {
 public:
  GlbReader(FileBuffer& file, const std::string& path) : file_(file, path) {}

  TriangleMesh read() {
    visit_scene();
    if (normals_missing_) mesh_.normals.clear();
    return std::move(mesh_);
  }

 private:
  static const GlbObject& list_in(const GlbObject& object, const char* key) {
    static const GlbObject kNone = GlbObject::array();
    const auto found = object.find(key);
    return found != object.end() && found->is_array() ? *found : kNone;
  }

  std::uint64_t number(const GlbObject& value) const { return file_.whole(GlbObject{{"node", value}}, "node"); }

  /// Nodes no other is above where no scene says which.
  std::vector<std::uint64_t> roots() const {
    std::vector<std::uint64_t> out;
    if (!list_in(file_.json(), "scenes").empty()) {
      const GlbObject& scene = file_.element("scenes", file_.whole(file_.json(), "scene", 0));
      for (const GlbObject& node : list_in(scene, "nodes")) out.push_back(number(node));
      return out;
    }
    std::vector<bool> below(list_in(file_.json(), "nodes").size(), false);
    for (std::uint64_t n = 0; n < below.size(); ++n) {
      for (const GlbObject& child : list_in(file_.element("nodes", n), "children")) {
        const std::uint64_t c = number(child);
        if (c < below.size()) below[c] = true;
      }
    }
    for (std::uint64_t n = 0; n < below.size(); ++n) {
      if (!below[n]) out.push_back(n);
    }
    return out;
  }

  void visit_scene() {
    std::vector<std::pair<std::uint64_t, GlbMatrix>> left;
    const std::vector<std::uint64_t> first = roots();
    for (auto node = first.rbegin(); node != first.rend(); ++node) left.emplace_back(*node, kNoTransform);
    std::vector<bool> seen(list_in(file_.json(), "nodes").size(), false);
    while (!left.empty()) {
      const auto [number_of, above] = left.back();
      left.pop_back();
      const GlbObject& node = file_.element("nodes", number_of);
      if (seen[number_of]) file_.fail(fmt::format("nodes[{}] is below itself or below two others", number_of));
      seen[number_of] = true;
      const GlbMatrix here = product(above, matrix_of(node));
      if (node.contains("mesh")) add_mesh(file_.element("meshes", file_.whole(node, "mesh")), GlbTransform(here));
      const GlbObject& children = list_in(node, "children");
      for (auto child = children.rbegin(); child != children.rend(); ++child) left.emplace_back(number(*child), here);
    }
  }

  template <std::size_t N>
  std::array<double, N> numbers(const GlbObject& node, const char* key, std::array<double, N> otherwise) const {
    const auto found = node.find(key);
    if (found == node.end()) return otherwise;
    if (!found->is_array() || found->size() != N) file_.fail(fmt::format("\"{}\" of a node is not {} numbers", key, N));
    for (std::size_t i = 0; i < N; ++i) {
      if (!(*found)[i].is_number()) file_.fail(fmt::format("\"{}\" of a node is not {} numbers", key, N));
      otherwise[i] = (*found)[i].template get<double>();
    }
    return otherwise;
  }

  GlbMatrix matrix_of(const GlbObject& node) const {
    if (node.contains("matrix")) return numbers<16>(node, "matrix", {});
    const auto t = numbers<3>(node, "translation", {0, 0, 0});
    const auto [x, y, z, w] = numbers<4>(node, "rotation", {0, 0, 0, 1});
    const auto s = numbers<3>(node, "scale", {1, 1, 1});
    return {s[0] * (1 - 2 * (y * y + z * z)),
            s[0] * 2 * (x * y + z * w),
            s[0] * 2 * (x * z - y * w),
            0,
            s[1] * 2 * (x * y - z * w),
            s[1] * (1 - 2 * (x * x + z * z)),
            s[1] * 2 * (y * z + x * w),
            0,
            s[2] * 2 * (x * z + y * w),
            s[2] * 2 * (y * z - x * w),
            s[2] * (1 - 2 * (x * x + y * y)),
            0,
            t[0],
            t[1],
            t[2],
            1};
  }

  void add_mesh(const GlbObject& mesh, const GlbTransform& transform) {
    std::map<std::string, std::uint64_t> placed;  // primitives may share their vertices
    GlbSeats seats(mesh_);
    for (const GlbObject& primitive : list_in(mesh, "primitives")) {
      constexpr std::uint64_t kPoints = 0, kTriangles = 4, kFan = 6;
      const std::uint64_t mode = file_.whole(primitive, "mode", kTriangles);
      if (mode != kPoints && (mode < kTriangles || mode > kFan)) continue;  // lines
      const auto attributes = primitive.find("attributes");
      if (attributes == primitive.end() || !attributes->is_object()) file_.fail("has a primitive without attributes");
      if (!attributes->contains("POSITION")) continue;
      const auto [at, fresh] = placed.try_emplace(attributes->dump(-1, ' ', false, GlbObject::error_handler_t::replace),
                                                  mesh_.positions.size());
      if (fresh) {
        add_vertices(*attributes, transform);
        add_seats(primitive, mesh_.positions.size() - at->second, seats);
      }
      if (mode != kPoints) add_triangles(primitive, mode, at->second, transform.mirrors());
    }
    seats.take(mesh_);
  }

  /// Which of a mesh's vertices those of a piece are, as write_glb_set() notes it.
  void add_seats(const GlbObject& primitive, std::uint64_t count, GlbSeats& seats) const {
    const auto extras = primitive.find("extras");
    if (extras == primitive.end() || !extras->is_object() || !extras->contains("vertices") ||
        !(*extras)["vertices"].is_number_unsigned())
      return seats.forget();
    const GlbAccessor runs = file_.accessor(file_.whole(*extras, "vertices"));
    if (runs.component != glb::kUint || runs.width != 1 || runs.count % 2 != 0) return seats.forget();
    for (std::uint64_t r = 0; r < runs.count; r += 2)
      seats.add(static_cast<std::uint64_t>(runs.raw(r, 0)), static_cast<std::uint64_t>(runs.raw(r + 1, 0)));
    seats.end_piece(count);
  }

  /// Nodes and primitives may name the same data again and again.
  void require_room(std::uint64_t more) const {
    constexpr std::uint64_t kMostPerByte = 100;
    const std::uint64_t all = mesh_.positions.size() + mesh_.triangles.size() + more;
    if (all > kMostPerByte * file_.bytes() ||
        mesh_.positions.size() + more >= std::numeric_limits<std::uint32_t>::max())
      file_.fail(fmt::format("repeats its meshes until they have {} vertices and triangles, too many to be held", all));
  }

  void add_vertices(const GlbObject& attributes, const GlbTransform& transform) {
    const GlbAccessor positions = file_.accessor(file_.whole(attributes, "POSITION"));
    if (positions.width != 3) file_.fail("has positions that are not of three numbers");
    require_room(positions.count);
    const std::size_t first = mesh_.positions.size();
    for (std::uint64_t v = 0; v < positions.count; ++v) {
      std::array<double, 3> p{};
      for (std::size_t k = 0; k < 3; ++k) p[k] = positions.at(v, k);
      transform.move(p);
      mesh_.positions.push_back(p);
    }
    add_normals(attributes, transform, positions.count);
    // In the order of the accessors, which is that of the attributes in files of our own.
    std::vector<std::pair<std::uint64_t, std::string>> order;
    for (const auto& [semantic, accessor] : attributes.items())
      order.emplace_back(file_.whole(attributes, semantic.c_str()), semantic);
    std::sort(order.begin(), order.end());
    for (const auto& [accessor, semantic] : order) {
      if (semantic == "COLOR_0") add_colours(accessor, first);
      if (semantic.starts_with('_')) add_attribute(semantic, accessor, first);
    }
    for (std::vector<float>& values : mesh_.attributes) values.resize(mesh_.positions.size());
  }

  GlbAccessor of_every_vertex(std::uint64_t accessor, std::uint64_t count) const {
    const GlbAccessor out = file_.accessor(accessor);
    if (out.count != count)
      file_.fail(fmt::format("accessors[{}] has {} values for {} vertices", accessor, out.count, count));
    return out;
  }

  void add_normals(const GlbObject& attributes, const GlbTransform& transform, std::uint64_t count) {
    if (!attributes.contains("NORMAL")) {
      normals_missing_ = true;
      mesh_.normals.resize(mesh_.positions.size());
      return;
    }
    const GlbAccessor normals = of_every_vertex(file_.whole(attributes, "NORMAL"), count);
    if (normals.width != 3) file_.fail("has normals that are not of three numbers");
    for (std::uint64_t v = 0; v < count; ++v) {
      std::array<float, 3> n{};
      for (std::size_t k = 0; k < 3; ++k) n[k] = static_cast<float>(normals.at(v, k));
      transform.turn(n);
      mesh_.normals.push_back(n);
    }
  }

  /// The type that the writer has noted where the accessor's own is another.
  std::optional<ScalarType> noted_type(std::uint64_t accessor) const {
    const GlbObject& object = file_.element("accessors", accessor);
    const auto extras = object.find("extras");
    if (extras == object.end() || !extras->is_object()) return std::nullopt;
    const auto type = extras->find("type");
    if (type == extras->end() || !type->is_string()) return std::nullopt;
    return ply_type(type->get_ref<const std::string&>());
  }

  static ScalarType type_of(const GlbAccessor& values) {
    switch (values.component) {
      case glb::kByte:
        return ScalarType::int8;
      case glb::kUbyte:
        return ScalarType::uint8;
      case glb::kShort:
        return ScalarType::int16;
      case glb::kUshort:
        return ScalarType::uint16;
      case glb::kUint:
        return ScalarType::uint32;
      case glb::kFloat:
        break;
    }
    return ScalarType::float32;
  }

  /// The column of a name, which vertices before may lack.
  std::size_t column(const std::string& name, ScalarType type, double otherwise) {
    const auto found = find_attribute(mesh_.layout, name);
    if (found) return *found;
    mesh_.layout.push_back({name, type});
    mesh_.attributes.emplace_back(mesh_.positions.size(), static_cast<float>(otherwise));
    return mesh_.layout.size() - 1;
  }

  void add_colours(std::uint64_t accessor, std::size_t first) {
    const GlbAccessor colours = of_every_vertex(accessor, mesh_.positions.size() - first);
    if (colours.width < 3) file_.fail("has colours of fewer than three numbers");
    const ScalarType type = noted_type(accessor).value_or(type_of(colours));
    static constexpr std::array kNames{"red", "green", "blue", "alpha"};
    for (std::size_t k = 0; k < colours.width; ++k) {
      const std::size_t to = column(kNames[k], type, white_of(type));
      const ScalarType own = mesh_.layout[to].type;
      std::vector<float>& values = mesh_.attributes[to];
      values.resize(mesh_.positions.size());
      for (std::size_t v = first; v < values.size(); ++v) {
        const double linear = std::clamp(colours.at(v - first, k), 0.0, 1.0);
        const double c = white_of(own) * (k < 3 ? encoded_of(linear) : linear);
        values[v] = static_cast<float>(is_integer_type(own) ? std::round(c) : c);
      }
    }
  }

  void add_attribute(const std::string& semantic, std::uint64_t accessor, std::size_t first) {
    const GlbAccessor values = of_every_vertex(accessor, mesh_.positions.size() - first);
    if (values.width != 1) return;
    const ScalarType type = values.normalized ? ScalarType::float32 : noted_type(accessor).value_or(type_of(values));
    const std::size_t to = column(name_of(semantic, accessor), type, 0);
    mesh_.attributes[to].resize(mesh_.positions.size());
    for (std::size_t v = first; v < mesh_.positions.size(); ++v)
      mesh_.attributes[to][v] = static_cast<float>(values.at(v - first, 0));
  }

  /// The accessor's own name tells of which letters the semantic was made.
  std::string name_of(const std::string& semantic, std::uint64_t accessor) const {
    const GlbObject& object = file_.element("accessors", accessor);
    const auto name = object.find("name");
    if (name != object.end() && name->is_string()) {
      const auto& text = name->get_ref<const std::string&>();
      if (!text.empty() && semantic.starts_with(glb::semantic_of(text))) return text;
    }
    constexpr std::array<std::string_view, 6> kTaken{"x", "y", "z", "nx", "ny", "nz"};
    const std::string bare = semantic.substr(1);
    return bare.empty() || std::find(kTaken.begin(), kTaken.end(), bare) != kTaken.end() ? semantic : bare;
  }

  void add_triangles(const GlbObject& primitive, std::uint64_t mode, std::uint64_t first, bool mirrored) {
    const std::uint64_t vertices = mesh_.positions.size() - first;
    std::optional<GlbAccessor> indices;
    if (primitive.contains("indices")) indices = file_.accessor(file_.whole(primitive, "indices"));
    const bool whole = !indices || indices->component == glb::kUbyte || indices->component == glb::kUshort ||
                       indices->component == glb::kUint;
    if (!whole || (indices && indices->width != 1)) file_.fail("has indices that are no whole numbers");
    const std::uint64_t corners = indices ? indices->count : vertices;
    constexpr std::uint64_t kList = 4, kStrip = 5;
    if (mode == kList && corners % 3 != 0) file_.fail(fmt::format("has triangles of {} corners in all", corners));
    const auto corner = [&](std::uint64_t i) {
      const auto v = indices ? static_cast<std::uint64_t>(indices->raw(i, 0)) : i;
      if (v >= vertices) file_.fail(fmt::format("a face names vertex {} but there are {}", v, vertices));
      return static_cast<std::uint32_t>(first + v);
    };
    const std::uint64_t count = mode == kList ? corners / 3 : corners < 3 ? 0 : corners - 2;
    require_room(count);
    for (std::uint64_t t = 0; t < count; ++t) {
      std::array<std::uint32_t, 3> triangle{};
      if (mode == kList) {
        triangle = {corner(3 * t), corner(3 * t + 1), corner(3 * t + 2)};
      } else if (mode == kStrip) {
        triangle = {corner(t), corner(t + 1 + t % 2), corner(t + 2 - t % 2)};
      } else {
        triangle = {corner(0), corner(t + 1), corner(t + 2)};
      }
      if (mirrored) std::swap(triangle[1], triangle[2]);
      mesh_.triangles.push_back(triangle);
    }
  }

  GlbFile file_;
  TriangleMesh mesh_;
  bool normals_missing_ = false;
};

}  // namespace

TriangleMesh read_glb(FileBuffer& file, const std::string& path) {
  try {
    return GlbReader(file, path).read();
  } catch (const nlohmann::json::exception& error) {
    throw Error(ExitCode::unreadable, fmt::format("{}: its JSON is not that of a glTF file ({})", path, error.what()));
  }
}

}  // namespace lamina::meshes
