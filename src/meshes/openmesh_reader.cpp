// OBJ and STL through OpenMesh's readers, extended the way OpenMesh means it: an importer of our own. A halfedge
// mesh would drop the faces that make a mesh non-manifold, the very faces `check` is asked about; plain arrays keep
// them.
#include <fmt/format.h>

#include <OpenMesh/Core/IO/importer/BaseImporter.hh>
#include <OpenMesh/Core/IO/reader/OBJReader.hh>
#include <OpenMesh/Core/IO/reader/STLReader.hh>
#include <OpenMesh/Core/System/omstream.hh>
#include <algorithm>
#include <mutex>

#include "lamina/error.h"
#include "meshes/readers.h"

namespace lamina::meshes {
namespace {

/// Keeps OpenMesh's own messages off the terminal: what went wrong reaches the user as our one line instead. Its
/// readers keep their state in singletons, so this also lets one thread in at a time.
class QuietOpenMesh {
 public:
  QuietOpenMesh() : lock_(mutex()) {
    omerr().disable();
    omlog().disable();
  }
  ~QuietOpenMesh() {
    omerr().enable();
    omlog().enable();
  }
  QuietOpenMesh(const QuietOpenMesh&) = delete;
  QuietOpenMesh& operator=(const QuietOpenMesh&) = delete;

 private:
  static std::mutex& mutex() {
    static std::mutex one;
    return one;
  }
  std::lock_guard<std::mutex> lock_;
};

namespace om = OpenMesh;

class ArrayImporter final : public om::IO::BaseImporter {
 public:
  explicit ArrayImporter(const std::string& path) : path_(path) {}
  TriangleMesh mesh;
  std::size_t faces = 0;

  om::VertexHandle add_vertex(const om::Vec3f& p) override { return add_vertex(om::Vec3d(p)); }
  om::VertexHandle add_vertex(const om::Vec3d& p) override {
    mesh.positions.push_back({p[0], p[1], p[2]});
    return om::VertexHandle(static_cast<int>(mesh.positions.size() - 1));
  }
  om::VertexHandle add_vertex() override { return add_vertex(om::Vec3d(0, 0, 0)); }
  void set_point(om::VertexHandle v, const om::Vec3f& p) override { mesh.positions[require(v)] = {p[0], p[1], p[2]}; }

  om::FaceHandle add_face(const VHandles& corners) override {
    if (corners.size() < 3)
      fail(fmt::format("face {} has {} corners; a polygon needs three (is the file damaged there?)", faces,
                       corners.size()));
    for (const auto v : corners) require(v);
    for (std::size_t i = 2; i < corners.size(); ++i)
      mesh.triangles.push_back({index(corners[0]), index(corners[i - 1]), index(corners[i])});
    return om::FaceHandle(static_cast<int>(faces++));
  }

  void set_normal(om::VertexHandle v, const om::Vec3f& n) override {
    const auto i = require(v);
    if (mesh.normals.size() <= i) mesh.normals.resize(mesh.positions.size());
    mesh.normals[i] = {n[0], n[1], n[2]};
  }
  void set_normal(om::VertexHandle v, const om::Vec3d& n) override { set_normal(v, om::Vec3f(n)); }
  void set_color(om::VertexHandle v, const om::Vec3uc& c) override { colour(v, ScalarType::uint8, c, 3); }
  void set_color(om::VertexHandle v, const om::Vec4uc& c) override { colour(v, ScalarType::uint8, c, 4); }
  void set_color(om::VertexHandle v, const om::Vec3f& c) override { colour(v, ScalarType::float32, c, 3); }
  void set_color(om::VertexHandle v, const om::Vec4f& c) override { colour(v, ScalarType::float32, c, 4); }

  [[nodiscard]] std::size_t n_vertices() const override { return mesh.positions.size(); }
  [[nodiscard]] std::size_t n_faces() const override { return faces; }
  [[nodiscard]] std::size_t n_edges() const override { return 0; }

  // What a mesh of plain arrays has no place for.
  om::HalfedgeHandle add_edge(om::VertexHandle, om::VertexHandle) override { return om::HalfedgeHandle(); }
  om::FaceHandle add_face(om::HalfedgeHandle) override { return om::FaceHandle(); }
  void add_face_texcoords(om::FaceHandle, om::VertexHandle, const std::vector<om::Vec2f>&) override {}
  void add_face_texcoords(om::FaceHandle, om::VertexHandle, const std::vector<om::Vec3f>&) override {}
  void set_face_texindex(om::FaceHandle, int) override {}
  void set_halfedge(om::VertexHandle, om::HalfedgeHandle) override {}
  void set_texcoord(om::VertexHandle, const om::Vec2f&) override {}
  void set_texcoord(om::VertexHandle, const om::Vec3f&) override {}
  void set_texcoord(om::HalfedgeHandle, const om::Vec2f&) override {}
  void set_texcoord(om::HalfedgeHandle, const om::Vec3f&) override {}
  void set_status(om::VertexHandle, const om::Attributes::StatusInfo&) override {}
  void set_status(om::HalfedgeHandle, const om::Attributes::StatusInfo&) override {}
  void set_status(om::EdgeHandle, const om::Attributes::StatusInfo&) override {}
  void set_status(om::FaceHandle, const om::Attributes::StatusInfo&) override {}
  void set_next(om::HalfedgeHandle, om::HalfedgeHandle) override {}
  void set_face(om::HalfedgeHandle, om::FaceHandle) override {}
  void request_face_texcoords2D() override {}
  void set_color(om::EdgeHandle, const om::Vec3uc&) override {}
  void set_color(om::EdgeHandle, const om::Vec4uc&) override {}
  void set_color(om::EdgeHandle, const om::Vec3f&) override {}
  void set_color(om::EdgeHandle, const om::Vec4f&) override {}
  void set_normal(om::FaceHandle, const om::Vec3f&) override {}
  void set_normal(om::FaceHandle, const om::Vec3d&) override {}
  void set_color(om::FaceHandle, const om::Vec3uc&) override {}
  void set_color(om::FaceHandle, const om::Vec4uc&) override {}
  void set_color(om::FaceHandle, const om::Vec3f&) override {}
  void set_color(om::FaceHandle, const om::Vec4f&) override {}
  void add_texture_information(int, std::string) override {}

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ExitCode::unreadable, fmt::format("{}: {}", path_, what));
  }
  static std::uint32_t index(om::VertexHandle v) { return static_cast<std::uint32_t>(v.idx()); }
  std::size_t require(om::VertexHandle v) const {
    if (v.idx() < 0 || static_cast<std::size_t>(v.idx()) >= mesh.positions.size())
      fail(fmt::format("face {} names vertex {} but there are {}", faces, v.idx(), mesh.positions.size()));
    return static_cast<std::size_t>(v.idx());
  }
  template <class Colour>
  void colour(om::VertexHandle v, ScalarType type, const Colour& c, std::size_t channels) {
    const auto i = require(v);
    static constexpr const char* kNames[] = {"red", "green", "blue", "alpha"};
    while (mesh.layout.size() < channels) mesh.layout.push_back({kNames[mesh.layout.size()], type});
    mesh.attributes.resize(mesh.layout.size());
    for (std::size_t k = 0; k < channels; ++k) {
      if (mesh.attributes[k].size() <= i) mesh.attributes[k].resize(mesh.positions.size());
      mesh.attributes[k][i] = static_cast<float>(c[k]);
    }
  }

  const std::string& path_;
};

bool run_reader(std::istream& in, om::IO::BaseImporter& importer, TextFormat format, bool binary) {
  om::IO::Options options = om::IO::Options::VertexNormal | om::IO::Options::VertexColor;
  if (binary) options += om::IO::Options::Binary;
  switch (format) {
    case TextFormat::obj:
      return om::IO::OBJReader().read(in, importer, options);
    case TextFormat::stl:
      return om::IO::STLReader().read(in, importer, options);
  }
  return false;
}

}  // namespace

TriangleMesh read_with_openmesh(FileBuffer& file, const std::string& path, TextFormat format) {
  // OpenMesh's readers pass over what they do not understand: count first what the file holds.
  TextCensus census = take_census(file, path, format);
  std::istream in(&file);
  in.seekg(0);
  ArrayImporter importer(path);
  const QuietOpenMesh quiet;
  const bool read = run_reader(in, importer, format, census.binary);
  file.require_sound();
  if (!read) throw Error(ExitCode::unreadable, fmt::format("{}: damaged or not the format its name says", path));
  if (format == TextFormat::obj && importer.mesh.positions.size() != census.positions.size())
    throw Error(ExitCode::unreadable, fmt::format("{}: {} of its {} vertices can be read", path,
                                                  importer.mesh.positions.size(), census.positions.size()));
  if (census.faces && importer.faces != *census.faces)
    throw Error(ExitCode::unreadable,
                fmt::format("{}: {} of the {} faces it promises can be read: the file is cut short or damaged", path,
                            importer.faces, *census.faces));
  TriangleMesh mesh = std::move(importer.mesh);
  if (format == TextFormat::obj) mesh.positions = std::move(census.positions);
  if (!mesh.normals.empty()) mesh.normals.resize(mesh.positions.size());
  for (auto& a : mesh.attributes) a.resize(mesh.positions.size());
  settle_colour_range(mesh);
  return mesh;
}

}  // namespace lamina::meshes
