#include "chunks/part_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>

#include "base/temporary_folder.h"
#include "lamina/chunk.h"
#include "lamina/error.h"
#include "meshes/mesh_sink.h"

namespace lamina {
namespace {

using ::testing::HasSubstr;

VertexBatch random_vertices(std::size_t n, std::mt19937& random) {
  std::normal_distribution<> normal;
  VertexBatch v;
  v.attributes.resize(1);
  for (std::size_t i = 0; i < n; ++i) {
    for (auto* a : {&v.x, &v.y, &v.z}) a->push_back(normal(random));
    for (auto* a : {&v.nx, &v.ny, &v.nz}) a->push_back(static_cast<float>(normal(random)));
    v.attributes[0].push_back(static_cast<float>(random() % 256));
  }
  return v;
}

MeshSinkSettings layout() {
  MeshSinkSettings s;
  s.attributes = {{"red", ScalarType::uint8}};
  return s;
}

struct Read {
  std::vector<std::byte> vertices;
  std::vector<PartTriangle> triangles;
};

Read read_all(const std::string& path) {
  const PartReader reader(path);
  Read out;
  reader.read_vertices([&](auto bytes) { out.vertices.insert(out.vertices.end(), bytes.begin(), bytes.end()); });
  reader.read_triangles([&](auto t) { out.triangles.insert(out.triangles.end(), t.begin(), t.end()); });
  return out;
}

class PartFile : public ::testing::Test {
 protected:
  /// A part of two slabs.
  std::string write(std::size_t vertices) {
    std::mt19937 random(3);
    const std::string path = folder_ / "a.lmesh";
    PartWriter writer(path, layout());
    for (int slab = 0; slab < 2; ++slab) {
      const VertexBatch batch = random_vertices(vertices, random);
      std::vector<PartTriangle> triangles;
      for (std::size_t t = 0; t < 2 * vertices; ++t) {
        const auto number = [&] { return static_cast<std::int32_t>(random() % (vertices + 5)) - 5; };
        triangles.push_back({number(), number(), number()});
      }
      writer.add(batch, triangles);
      std::vector<std::byte> records(batch.size() * vertex_record_bytes(layout().attributes, false));
      encode_vertices(batch, layout().attributes, false, 0, batch.size(), records.data());
      expected_.vertices.insert(expected_.vertices.end(), records.begin(), records.end());
      expected_.triangles.insert(expected_.triangles.end(), triangles.begin(), triangles.end());
      last_ = mark_of(batch, layout());
    }
    PartInfo info;
    info.job = 0xFEDCBA9876543210U;
    info.number = 3;
    info.count = 9;
    info.span = {-4, -2};
    info.below = {5, 77};
    writer.commit(info);
    return path;
  }
  test::TemporaryFolder folder_;
  Read expected_;
  SlabMark last_;
};

TEST_F(PartFile, ComesBack) {
  const std::string path = write(10000);
  EXPECT_TRUE(is_part(path));
  const PartInfo info = PartReader(path).info();
  EXPECT_EQ(info.job, 0xFEDCBA9876543210U);
  EXPECT_EQ(info.number, 3);
  EXPECT_EQ(info.count, 9);
  EXPECT_EQ(info.span, (SlabSpan{-4, -2}));
  EXPECT_EQ(info.below, (SlabMark{5, 77}));
  EXPECT_EQ(info.last, last_);
  EXPECT_EQ(info.vertices, 20000u);
  EXPECT_EQ(info.triangles, 40000u);
  const Read read = read_all(path);
  EXPECT_TRUE(read.vertices == expected_.vertices);
  EXPECT_TRUE(read.triangles == expected_.triangles);
}

TEST_F(PartFile, NothingIsThereBeforeCommit) {
  const std::string path = folder_ / "b.lmesh";
  { PartWriter writer(path, layout()); }
  EXPECT_EQ(folder_.entries(), 0);
}

TEST_F(PartFile, NoTruncationAndNoChangedBytePasses) {
  const std::string path = write(6);
  const std::string whole = test::read_file(path);
  const std::string other = folder_ / "other.lmesh";
  for (std::size_t size = 0; size < whole.size(); ++size) {
    test::write_file(other, whole.substr(0, size));
    EXPECT_THROW(read_all(other), Error) << size;
  }
  std::mt19937 random(5);
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ static_cast<char>(1 + random() % 255));
    test::write_file(other, bytes);
    try {
      read_all(other);
      ADD_FAILURE() << "byte " << at;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::unreadable);
      EXPECT_THAT(error.what(), HasSubstr(other));
    }
  }
}

TEST_F(PartFile, OtherFilesAreNone) {
  EXPECT_FALSE(is_part(folder_.path()));
  EXPECT_FALSE(is_part(folder_ / "missing"));
  EXPECT_FALSE(is_part(test::write_file(folder_ / "x.ply", "ply\nformat ascii 1.0\n")));
  EXPECT_THROW(PartReader{folder_.path()}, Error);
}

TEST(PartNumbers, GoPast31Bits) {
  // A part whose first vertex is number 2^31 + 7 of the mesh, on a slab of four.
  constexpr std::uint64_t first = (std::uint64_t{1} << 31) + 7;
  constexpr std::uint64_t all = std::numeric_limits<std::uint32_t>::max();
  const std::vector<PartTriangle> triangles{{-4, 0, 1}, {2147483000, 5, -1}};
  std::vector<std::byte> bytes;
  encode_shifted(triangles, first, all, "a.lmesh", bytes);
  ASSERT_EQ(bytes.size(), 26u);
  std::array<std::uint32_t, 3> face{};
  std::memcpy(face.data(), bytes.data() + 1, sizeof face);
  EXPECT_EQ(face, (std::array<std::uint32_t, 3>{2147483651u, 2147483655u, 2147483656u}));
  std::memcpy(face.data(), bytes.data() + 14, sizeof face);
  EXPECT_EQ(face, (std::array<std::uint32_t, 3>{4294966655u, 2147483660u, 2147483654u}));
  EXPECT_EQ(bytes[0], std::byte{3});
  EXPECT_THROW(encode_shifted(triangles, first, first + 5, "a.lmesh", bytes), Error);
  EXPECT_THROW(encode_shifted(triangles, 3, all, "a.lmesh", bytes), Error);
}

TEST(PartNumbers, AreRelativeToThePart) {
  // What a clusterer says after four thousand million vertices.
  constexpr std::uint64_t first = 4294967000;
  std::vector<PartTriangle> out;
  make_relative({{4294966998u, 4294967000u, 4294967295u}}, first, 2, out);
  EXPECT_EQ(out, (std::vector<PartTriangle>{{-2, 0, 295}}));
  EXPECT_THROW(make_relative({{4294966997u, 4294967000u, 4294967295u}}, first, 2, out), Error);
  EXPECT_THROW(make_relative({{0u, 2147483648u, 1u}}, 0, 0, out), Error);
  make_relative({{0u, 2147483647u, 1u}}, 0, 0, out);
  EXPECT_EQ(out[0][1], 2147483647);
}

}  // namespace
}  // namespace lamina
