// OBJ and STL through OpenMesh's readers, extended the way OpenMesh means it: an importer of our own. A halfedge
// mesh would drop the faces that make a mesh non-manifold, the very faces `check` is asked about; plain arrays keep
// them.
#include <fmt/format.h>
#include <OpenMesh/Core/IO/importer/BaseImporter.hh>
#include <OpenMesh/Core/IO/reader/OBJReader.hh>
#include <OpenMesh/Core/IO/reader/STLReader.hh>
#include <OpenMesh/Core/System/omstream.hh>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <istream>
#include <mutex>

#include "base/number.h"
#include "lamina/error.h"
#include "meshes/formats.h"

namespace lamina::meshes {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", path, what));
}

/// As OpenMesh's reader parts words.
bool is_blank(char c) {
  return std::isspace(static_cast<unsigned char>(c)) != 0;
}

/// True for a line of the OBJ keyword `letter`.
bool keyword(std::string_view line, char letter) {
  return line.size() > 1 && line[0] == letter && is_blank(line[1]);
}

/// The three coordinates `text` begins with. OpenMesh stops at a number it cannot read: so must we, by name.
std::array<double, 3> position(std::string_view text, const std::string& path, std::uint64_t line) {
  std::array<double, 3> p{};
  for (double& c : p) {
    const auto value = take_decimal(text);
    if (!value || !std::isfinite(*value)) fail(path, fmt::format("line {}: a vertex needs three finite numbers", line));
    c = *value;
  }
  return p;
}

/// The corners of a face, VERTEX[/[TEXTURE][/NORMAL]] each. OpenMesh's reader ends the program over a corner without
/// its vertex and a normal that is not there.
void require_face(std::string_view text, const std::string& path, std::uint64_t line, std::uint64_t normals) {
  const auto refuse = [&](const std::string& what) { fail(path, fmt::format("line {}: {}", line, what)); };
  for (std::uint64_t corners = 0;;) {
    while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
    if (text.empty() || text.front() == '#') {
      if (corners == 0) refuse("a face without corners");
      return;
    }
    ++corners;
    for (int part = 0; part < 3; ++part) {
      std::int64_t number = 0;
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
      const bool there = error == std::errc{};
      if (!there && part != 1)
        refuse("a face's corner is VERTEX, VERTEX/TEXTURE/NORMAL or VERTEX//NORMAL, whole numbers");
      if (there) text.remove_prefix(static_cast<std::size_t>(end - text.data()));
      // From the first on, or from the last one back.
      const std::uint64_t place =
          number < 0 ? ~static_cast<std::uint64_t>(number) + 1 : static_cast<std::uint64_t>(number);
      if (part == 2 && (place < 1 || place > normals))
        refuse(fmt::format("the face names normal {} but there are {} before it", number, normals));
      if (text.empty() || text.front() != '/') break;
      if (part < 2) text.remove_prefix(1);
    }
    if (!text.empty() && !is_blank(text.front()))
      refuse("a face's corner is VERTEX, VERTEX/TEXTURE/NORMAL or VERTEX//NORMAL, whole numbers");
  }
}

TextCensus census_obj(std::istream& in, const std::string& path) {
  TextCensus census;
  census.faces = 0;
  std::string line;
  std::uint64_t normals = 0;
  for (std::uint64_t number = 1; std::getline(in, line); ++number) {
    const auto text = trimmed(line);
    if (!text.empty() && text.back() == '\\' && text[0] != '#')
      fail(path, fmt::format("line {} is continued on the next: join the lines, or convert to PLY", number));
    if (keyword(text, 'v')) census.positions.push_back(position(text.substr(1), path, number));
    if (text.starts_with("vn") && text.size() > 2 && is_blank(text[2])) ++normals;
    if (keyword(text, 'f')) {
      require_face(text.substr(1), path, number, normals);
      ++*census.faces;
    }
  }
  if (census.positions.empty()) fail(path, "holds no vertices: not an OBJ file?");
  return census;
}

/// A binary file may begin with "solid" too: its length decides.
TextCensus census_stl(std::istream& in, const std::string& path) {
  std::array<char, 84> head{};
  in.read(head.data(), head.size());
  const bool whole_head = in.gcount() == static_cast<std::streamsize>(head.size());
  const auto count = load_little<std::uint32_t>(reinterpret_cast<const std::byte*>(head.data()) + 80);
  std::uint64_t rest = 0;
  std::array<char, 1 << 16> skipped;
  while (in) {
    in.read(skipped.data(), skipped.size());
    rest += static_cast<std::uint64_t>(in.gcount());
  }
  if (whole_head && rest == 50 * std::uint64_t{count}) return {count, {}, true};
  if (std::string_view(head.data(), 5) != "solid")
    fail(path, whole_head ? fmt::format("its header promises {} triangles but {} bytes follow instead of {}: the file "
                                        "is cut short or damaged",
                                        count, rest, 50 * std::uint64_t{count})
                          : "not an STL file");
  in.clear();
  in.seekg(0);
  TextCensus census{0, {}, false};
  bool ended = false;
  for (std::string line; std::getline(in, line);) {
    const auto text = trimmed(line);
    if (text.starts_with("facet")) ++*census.faces;
    if (text.starts_with("endsolid")) ended = true;
  }
  if (!ended) fail(path, "ends without \"endsolid\": the file is cut short");
  return census;
}

}  // namespace

TextCensus take_census(FileBuffer& file, const std::string& path, TextFormat format) {
  std::istream in(&file);
  in.seekg(0);
  TextCensus census;
  switch (format) {
    case TextFormat::obj:
      census = census_obj(in, path);
      break;
    case TextFormat::stl:
      census = census_stl(in, path);
      break;
  }
  file.require_sound();
  return census;
}

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
