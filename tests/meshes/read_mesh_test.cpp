#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>
#include <limits>

#include "lamina/mesh.h"
#include "meshes/mesh_files.h"

namespace lamina {
namespace {

using namespace testing_meshes;

const char* const kAsciiPly =
    "ply\nformat ascii 1.0\ncomment hello\nobj_info x\nelement camera 1\nproperty float f\nproperty list uchar int "
    "extra\n"
    "element vertex 4\nproperty double x\nproperty float quality\nproperty float y\nproperty float z\nproperty list "
    "uchar float w\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\nproperty uchar flags\n"
    "property list uchar int vertex_indices\nelement tail 1\nproperty int t\nend_header\n"
    "3.5 2 7 8\n500000.123 0.5 0 0 0 1 2 3\n1 0.25 0 0 2 1.5 2.5 4 5 6\n1 1 1 0 0 7 8 9\n+0 1 1e0 0 1 9 10 11 12\n"
    "1 3 0 1 2\n0 4 0 1 2 3\n42\n";

void gzip(const std::string& path, const std::string& bytes) {
  gzFile f = gzopen(path.c_str(), "wb");
  gzwrite(f, bytes.data(), static_cast<unsigned>(bytes.size()));
  gzclose(f);
}

template <class T>
void put(std::string& bytes, T value, bool big) {
  std::string raw(sizeof(T), '\0');
  std::memcpy(raw.data(), &value, sizeof(T));
  bytes += big ? std::string(raw.rbegin(), raw.rend()) : raw;
}

std::string binary_triangle(bool big, std::uint32_t last_index = 2) {
  std::string b =
      std::string("ply\nformat binary_") + (big ? "big" : "little") +
      "_endian 1.0\nelement vertex 3\nproperty float x\nproperty double y\nproperty short z\nproperty ushort red\n"
      "element face 1\nproperty list ushort uint vertex_index\nend_header\n";
  for (int v = 0; v < 3; ++v) {
    put(b, static_cast<float>(v), big);
    put(b, 0.1 * v, big);
    put(b, static_cast<std::int16_t>(-v), big);
    put(b, static_cast<std::uint16_t>(60000 + v), big);
  }
  put(b, std::uint16_t{3}, big);
  for (const std::uint32_t i : {0u, 1u, last_index}) put(b, i, big);
  return b;
}

TEST(ReadMesh, PlyWithMoreEmptyRowsThanCanBeCounted) {
  const ScratchFolder folder;
  std::string text = kAsciiPly;
  text.insert(text.find("element vertex"), "element nothing 18446744073709551615\n");
  const TriangleMesh m = read_mesh(folder.write("a.ply", text));
  EXPECT_EQ(m.positions.size(), 4u);
  EXPECT_EQ(m.triangles.size(), 3u);
}

TEST(ReadMesh, AsciiPlyWithForeignElementsAndLists) {
  const ScratchFolder folder;
  const TriangleMesh m = read_mesh(folder.write("a.ply", kAsciiPly));
  ASSERT_EQ(m.positions.size(), 4u);
  EXPECT_EQ(m.positions[0][0], 500000.123);
  EXPECT_EQ(m.positions[3], (std::array<double, 3>{0, 1, 0}));
  ASSERT_EQ(m.layout.size(), 4u);
  EXPECT_EQ(m.layout[0], (AttributeSpec{"quality", ScalarType::float32}));
  EXPECT_EQ(m.layout[3], (AttributeSpec{"blue", ScalarType::uint8}));
  EXPECT_EQ(m.attributes[3], (std::vector<float>{3, 6, 9, 12}));
  ASSERT_EQ(m.triangles.size(), 3u) << "a triangle and a quad cut in two";
  EXPECT_EQ(m.triangles[2], (std::array<std::uint32_t, 3>{0, 2, 3}));
}

TEST(ReadMesh, BinaryPlyOfEitherEndianness) {
  const ScratchFolder folder;
  for (const bool big : {false, true}) {
    const TriangleMesh m = read_mesh(folder.write("b.ply", binary_triangle(big)));
    EXPECT_EQ(m.positions[2], (std::array<double, 3>{2, 0.2, -2}));
    EXPECT_EQ(m.attributes[0], (std::vector<float>{60000, 60001, 60002}));
    EXPECT_EQ(m.triangles.size(), 1u);
  }
}

TEST(ReadMesh, GzipOfEveryFormat) {
  const ScratchFolder folder;
  gzip(folder.file("a.ply.gz"), kAsciiPly);
  EXPECT_EQ(read_mesh(folder.file("a.ply.gz")).triangles.size(), 3u);
  for (const char* format : {"obj", "off", "stl", "ply"}) {
    const std::string plain = folder.file(std::string("t.") + format);
    write_mesh(tetrahedron(), plain);
    gzip(plain + ".gz", bytes_of(plain));
    EXPECT_EQ(read_mesh(plain + ".gz").triangles, read_mesh(plain).triangles) << format;
    EXPECT_EQ(read_mesh(plain + ".gz").positions.size(), 4u) << format;
  }
}

TEST(ReadMesh, KeepsFacesThatAHalfedgeMeshWouldDrop) {
  const ScratchFolder folder;
  TriangleMesh fins;
  fins.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}};
  fins.triangles = {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}, {0, 1, 2}};
  for (const char* format : {"obj", "off", "stl", "ply"}) {
    const std::string path = folder.file(std::string("fins.") + format);
    write_mesh(fins, path);
    EXPECT_EQ(read_mesh(path).triangles.size(), 4u) << format;
    EXPECT_EQ(read_mesh(path).positions.size(), 5u) << format;
  }
}

TEST(ReadMesh, ObjKeepsDoublesColoursNormalsAndRelativeIndices) {
  const ScratchFolder folder;
  const TriangleMesh m =
      read_mesh(folder.write("a.obj",
                             "# c\nv 4100000.456 1 2 255 0 0\nv 0 0 0 0 1 0\nv 1 0 0 0 0 1\nv 1 1 0 9 9 9\n"
                             "vn 0 0 1\nvt 0 0\nf 1//1 2//1 3//1\nf -4/1/1 -2/1/1 -1/1/1\n"));
  EXPECT_EQ(m.positions[0][0], 4100000.456);
  ASSERT_EQ(m.triangles.size(), 2u);
  EXPECT_EQ(m.triangles[1], (std::array<std::uint32_t, 3>{0, 2, 3}));
  ASSERT_EQ(m.layout.size(), 3u);
  EXPECT_EQ(m.layout[0], (AttributeSpec{"red", ScalarType::uint8}));
  EXPECT_EQ(m.attributes[0][0], 255);
  EXPECT_EQ(m.normals[3][2], 1);
  const TriangleMesh two =
      read_mesh(folder.write("b.obj",
                             "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 1 0 0\nvn 0 1 0\nvn 0 0 1\nf -3//-3 -2//-2 -1//-1\n"
                             "v 0 0 5\nv 1 0 5\nv 0 1 5\nvn -1 0 0\nvn 0 -1 0\nvn 0 0 -1\nf -3//-3 -2//-2 -1//-1\n"));
  EXPECT_EQ(two.normals[2][2], 1);
  EXPECT_EQ(two.normals[3][0], -1);
}

TEST(ReadMesh, OffWithCommentsColoursAndNormals) {
  const ScratchFolder folder;
  const TriangleMesh m =
      read_mesh(folder.write("a.off",
                             "CNOFF # x\n\n4 1 0\n0 0 0 0 0 1 0.5 0 0\n1 0 0.1 0 0 1 1 0 0\n# y\n1 1 0 0 0 1 0 0 1\n"
                             "0 1 0 0 0 1 0 1 0\n4 0 1 2 3 1 0 0\n"));
  EXPECT_EQ(m.triangles.size(), 2u);
  EXPECT_EQ(m.positions[1][2], 0.1);
  EXPECT_EQ(m.normals[0][2], 1);
  EXPECT_EQ(m.layout[0], (AttributeSpec{"red", ScalarType::float32}));
  EXPECT_EQ(m.attributes[0][0], 0.5);
}

TEST(ReadMesh, AsciiStl) {
  const ScratchFolder folder;
  const TriangleMesh m = read_mesh(folder.write(
      "a.stl",
      "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
      "facet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n"));
  EXPECT_EQ(m.positions.size(), 4u) << "equal positions are welded";
  EXPECT_EQ(m.triangles.size(), 2u);
}

TEST(ReadMesh, CloudWithoutFacesHasNoTriangles) {
  const ScratchFolder folder;
  const auto path = folder.write("c.ply",
                                 "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
                                 "y\nproperty float z\nend_header\n1 2 3\n");
  EXPECT_TRUE(read_mesh(path).triangles.empty());
}

TEST(ReadMesh, NonFiniteVerticesAreRefusedUnlessAskedFor) {
  const ScratchFolder folder;
  const auto path = folder.write(
      "n.ply",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n0 0 0\n1 nan 0\n0 -inf 0\n3 0 1 2\n");
  expect_error(ExitCode::unreadable, [&] { read_mesh(path); }, {path, "vertex 1", "not finite"});
  EXPECT_TRUE(std::isnan(read_mesh(path, NonFinite::keep).positions[1][1]));
}

TEST(DropNonFinite, LeavesTheRestAsItIs) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {0, nan, 0}, {1, 0, 0}, {0, 0, -1 / 0.0}, {1, 1, 0}, {0, 1, 0}};
  mesh.normals = {{0, 0, 1}, {}, {0, 0, 2}, {}, {0, 0, 3}, {0, 0, 4}};
  mesh.layout = {{"grey", ScalarType::uint8}};
  mesh.attributes = {{1, 0, 2, 0, 3, 4}};
  mesh.triangles = {{0, 2, 4}, {0, 1, 2}, {0, 4, 5}, {3, 4, 5}};
  EXPECT_EQ(drop_non_finite(mesh), 2);
  EXPECT_EQ(mesh.positions, (std::vector<std::array<double, 3>>{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}));
  EXPECT_EQ(mesh.normals, (std::vector<std::array<float, 3>>{{0, 0, 1}, {0, 0, 2}, {0, 0, 3}, {0, 0, 4}}));
  EXPECT_EQ(mesh.attributes[0], (std::vector<float>{1, 2, 3, 4}));
  EXPECT_EQ(mesh.triangles, (std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}}));
  const TriangleMesh whole = mesh;
  EXPECT_EQ(drop_non_finite(mesh), 0);
  EXPECT_EQ(mesh.triangles, whole.triangles);
}

TEST(ReadMesh, BadFilesAreNamed) {
  const ScratchFolder folder;
  const auto bad = [&](const std::string& name, const std::string& bytes, const std::vector<std::string>& words) {
    SCOPED_TRACE(name + ": " + words[0]);
    const auto path = folder.write(name, bytes);
    auto all = words;
    all.push_back(path);
    expect_error(
        ExitCode::unreadable, [&] { read_mesh(path); }, all);
  };
  expect_error(ExitCode::unreadable, [&] { read_mesh(folder.file("none.ply")); }, {"none.ply", "No such file"});
  expect_error(ExitCode::unreadable, [&] { read_mesh(folder.file("")); }, {"is a directory"});
  bad("e.ply", "", {"is empty"});
  bad("e.obj",
      "\xEF\xBB\xBF"
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\n",
      {"byte order mark", "tail -c +4"});
  bad("e.xyz", "1 2 3\n", {"holds points, where a mesh is wanted", "lamina surface"});
  bad("e.dxf", "1 2 3\n", {"unknown mesh format \".dxf\""});
  bad("e.vdb", " BDV", {"is a volume", "lamina convert"});
  bad("a.ply", "plx\n", {"not a PLY file"});
  bad("b.ply", "ply\nformat ascii 1.0\nelement vertex -3\n", {"line 3", "'-3'"});
  bad("b2.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty floot x\n", {"line 4", "'floot'"});
  bad("c.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n", {"the header is cut short"});
  bad("c2.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nelement vertex 0\nend_header\n1\n",
      {"line 5", "element 'vertex' is there already"});
  bad("d.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", {"no x y z"});
  const std::string ascii = kAsciiPly;
  bad("f.ply", ascii.substr(0, ascii.size() - 4), {"tail 0 of the 1", "cut short"});
  bad("g.ply", ascii + "17\n", {"more data than its header promises"});
  bad("h.ply", std::string(ascii).replace(ascii.find("3 0 1 2"), 7, "3 0 1 9"), {"vertex 9", "there are 4"});
  bad("i.ply", std::string(ascii).replace(ascii.find("3 0 1 2"), 7, "2 0 1"), {"face 0", "2 corners"});
  bad("j.ply", std::string(ascii).replace(ascii.find("3 0 1 2"), 7, "3 0 -1 2"), {"face 0", "-1"});
  bad("k.ply", std::string(ascii).replace(ascii.find("3 0 1 2"), 7, "3 0 x 2"), {"face 0", "\"x\" is not a number"});
  const std::string little = binary_triangle(false);
  for (const std::size_t cut : {1u, 8u, 20u, 40u}) bad("l.ply", little.substr(0, little.size() - cut), {"cut short"});
  bad("m.ply", little + "zz", {"more data"});
  bad("n.ply", binary_triangle(false, 7), {"vertex 7", "there are 3"});
  bad("o.ply", std::string(little).replace(little.find("vertex 3"), 8, "vertex 4000000000"), {"cut short"});
  bad("a.obj", "v 0 0 0\nv 1 0 0\nv 1 nan 0\nf 1 2 3\n", {"line 3", "three finite numbers"});
  bad("b.obj", "v 0 0 0\nv 1 0\nv 1 1 0\nf 1 2 3\n", {"line 2"});
  bad("c.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 4\n", {"vertex 3", "there are 3"});
  bad("d.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 -9\n", {"face 0"});
  bad("e.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2\n", {"0 of the 1 faces"});
  bad("f.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 \\\n 3\n", {"line 4", "continued"});
  bad("g.obj", std::string(300, '\1'), {"no vertices"});
  bad("a.off", "OFX\n", {"not an OFF file"});
  bad("b.off", "OFF\n3 x 0\n", {"line 2", "counts"});
  bad("c.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n", {"vertex 2 of the 3", "cut short"});
  bad("d.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 0\n3 0 1 3\n", {"line 6", "vertex 3"});
  bad("e.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n1 1 0\n3 0 1 2\n", {"face 1 of the 2"});
  bad("f.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 0\n3 0 1\n", {"line 6"});
  bad("g.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 nan\n3 0 1 2\n", {"vertex 2", "not finite"});
  bad("h.off", "OFF BINARY\n", {"binary OFF"});
  bad("a.stl", "solid x\nfacet\n", {"endsolid"});
  bad("b.stl", std::string(84, 'x') + "123", {"cut short or damaged"});
  bad("c.stl", "short", {"not an STL"});
}

TEST(ReadMesh, CutArchivesAreNamed) {
  const ScratchFolder folder;
  for (const char* format : {"obj", "off", "stl", "ply"}) {
    const std::string plain = folder.file(std::string("s.") + format);
    write_mesh(sphere(1, 40, 80), plain);
    gzip(plain + ".gz", bytes_of(plain));
    const std::string whole = bytes_of(plain + ".gz");
    const auto path = folder.write(std::string("cut.") + format + ".gz", whole.substr(0, whole.size() / 2));
    SCOPED_TRACE(format);
    expect_error(ExitCode::unreadable, [&] { read_mesh(path); }, {path, "cannot be read to its end"});
  }
}

// OpenMesh's reader ends the program over these.
TEST(ReadMesh, ObjFacesThatNameNothingAreRefused) {
  const ScratchFolder folder;
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (const char* face : {"f /1 2 3", "f 1 2 //3", "f 1 2 x", "f 1/'1 2 3", "f 1//1 2//1 3//1", "f 1//0 2 3",
                           "f\v/1 2 3", "f # 1 2 3", "f #2 /1/11"}) {
    const auto path = folder.write("face.obj", corners + face + "\n");
    SCOPED_TRACE(face);
    expect_error(ExitCode::unreadable, [&] { read_mesh(path); }, {path, "line 4"});
  }
  const auto good = folder.write("good.obj", corners + "vn 0 0 1\nvt 0 0\nf 1/1/1 2//1 3/1\nf -3 -2 -1 # last\n");
  EXPECT_EQ(read_mesh(good).triangles.size(), 2U);
}

}  // namespace
}  // namespace lamina
