// The mesh is a function of the samples and the settings: not of threads, windows, processors, or how the file is laid
// out.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <thread>

#include "lamina/mesh_receiver.h"
#include "lamina/points.h"
#include "mls/kernel.h"
#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

/// Several levels, colours, quality and a tail of outliers: every branch of the job has something to do.
Cloud busy_cloud() {
  Cloud cloud = test::sphere_cloud(20000, [](const Point3& v) { return std::exp2(3 * (v[2] - 1)); });
  std::mt19937 random(5);
  std::uniform_real_distribution<> noise(-0.01, 0.01);
  for (Point3& p : cloud.positions) {
    for (double& c : p) c += noise(random);
  }
  cloud.add_property("red", ScalarType::uint8, [](const Point3& p) { return std::floor(127 + 100 * p[0]); });
  cloud.add_property("confidence", ScalarType::float32, [](const Point3& p) { return 1 + 0.5 * p[1]; });
  return cloud;
}

class SurfaceBytes : public ::testing::Test {
 protected:
  std::string bytes(const SurfaceSettings& settings, int threads = 0) const {
    SurfaceSettings s = settings;
    if (s.input.empty()) s.input = input_;
    s.output = folder_ / "out.ply";
    RunContext run;
    run.threads = threads;
    reconstruct_surface(s, run);
    return test::read_file(s.output);
  }
  test::TemporaryFolder folder_;
  const Cloud cloud_ = busy_cloud();
  const std::string input_ = test::write_cloud(cloud_, folder_ / "in.ply");
};

// EXPECT_TRUE: nobody wants to read two meshes in a failure.
TEST_F(SurfaceBytes, SameForThreadsWindowsAndRuns) {
  std::vector<SurfaceSettings> jobs(4);
  jobs[1].diffuse = true;
  jobs[1].cluster = ClusterMode::free;
  jobs[2].steps = 2;
  jobs[2].blend = 3;
  jobs[2].cluster = ClusterMode::none;
  jobs[3].fit = FitMode::plane;
  jobs[3].frame = FrameMode::axis;
  for (const SurfaceSettings& job : jobs) {
    const std::string once = bytes(job, 1);
    EXPECT_GT(once.size(), 100000u);
    EXPECT_TRUE(once == bytes(job, 1)) << "two runs";
    for (const int threads : {2, 4}) EXPECT_TRUE(once == bytes(job, threads)) << threads << " threads";
    for (const int window : {2, 5}) {
      SurfaceSettings s = job;
      s.window = window;
      EXPECT_TRUE(once == bytes(s, 2)) << "window " << window;
    }
  }
}

TEST_F(SurfaceBytes, SameForEveryKernel) {
  const char* before = std::getenv("LAMINA_KERNEL");
  const std::string kept = before == nullptr ? "" : before;
  SurfaceSettings s;
  s.steps = 2;
  std::vector<std::string> meshes;
  for (const Kernel& kernel : available_kernels()) {
    const std::string name(kernel.name);
    ::setenv("LAMINA_KERNEL", name.substr(name.size() - 2).c_str(), 1);
    meshes.push_back(bytes(s));
  }
  before == nullptr ? ::unsetenv("LAMINA_KERNEL") : ::setenv("LAMINA_KERNEL", kept.c_str(), 1);
  for (const std::string& mesh : meshes) EXPECT_TRUE(mesh == meshes.front());
}

TEST_F(SurfaceBytes, SameForEveryLayoutOfTheFile) {
  const std::string once = bytes({});
  test::PlyModel model = test::ply_model(cloud_);
  auto& vertices = model.elements[0];
  // Other elements around, columns turned round, names and types written the other way.
  std::mt19937 random(7);
  model.sized_names = true;
  std::reverse(vertices.columns.begin(), vertices.columns.end());
  for (auto& row : vertices.cells) std::reverse(row.begin(), row.end());
  for (auto& column : vertices.columns) {
    if (column.name == "y") column.type = ScalarType::float64;
  }
  const auto positions = model.elements[0];
  model.elements = {test::random_element("camera", 3, random), positions, test::random_element("face", 20, random)};
  for (const PlyFormat format : {PlyFormat::ascii, PlyFormat::little_endian, PlyFormat::big_endian}) {
    for (const bool rearranged : {false, true}) {
      SurfaceSettings s;
      const test::PlyModel& chosen = rearranged ? model : test::ply_model(cloud_);
      s.input = test::write_file(folder_ / "other.ply", test::ply_bytes(chosen, format));
      EXPECT_TRUE(once == bytes(s)) << static_cast<int>(format) << rearranged;
    }
  }
}

TEST_F(SurfaceBytes, SameFromAPipe) {
  const std::string once = bytes({});
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  std::thread feeder([&] {
    const std::string text = test::read_file(input_);
    for (std::size_t done = 0; done < text.size();) {
      const ssize_t n = ::write(ends[1], text.data() + done, text.size() - done);
      if (n <= 0) break;
      done += static_cast<std::size_t>(n);
    }
    ::close(ends[1]);
  });
  SurfaceSettings s;
  s.input = "-";
  {
    const test::Redirected input(STDIN_FILENO, ends[0]);
    ::close(ends[0]);
    EXPECT_TRUE(once == bytes(s));
  }
  feeder.join();
}

/// Puts a mesh together that is handed over.
class Collector final : public MeshReceiver {
 public:
  void begin(const StreamedMeshLayout& layout) override {
    layout_ = layout;
    mesh_.layout = layout.attributes;
    mesh_.attributes.resize(layout.attributes.size());
  }
  void take(TriangleMesh piece) override {
    ++pieces_;
    const auto join = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    join(mesh_.positions, piece.positions);
    join(mesh_.normals, piece.normals);
    join(mesh_.triangles, piece.triangles);
    for (std::size_t a = 0; a < mesh_.attributes.size(); ++a) join(mesh_.attributes[a], piece.attributes[a]);
  }
  [[nodiscard]] const TriangleMesh& mesh() const { return mesh_; }
  [[nodiscard]] const StreamedMeshLayout& layout() const { return layout_; }
  [[nodiscard]] int pieces() const { return pieces_; }

 private:
  TriangleMesh mesh_;
  StreamedMeshLayout layout_;
  int pieces_ = 0;
};

TEST_F(SurfaceBytes, SameFromASourceToAReceiver) {
  const std::string once = bytes({});
  const auto collector = std::make_shared<Collector>();
  SurfaceSettings s;
  s.input = "no file";
  s.open = [this] { return open_points(input_); };
  s.receiver = collector;
  const SurfaceStats stats = reconstruct_surface(s, {});
  EXPECT_GT(collector->pieces(), 3);
  EXPECT_EQ(stats.triangles, collector->mesh().triangles.size());
  const std::string again = folder_ / "again.ply";
  write_mesh(collector->mesh(), collector->layout(), again);
  EXPECT_TRUE(once == test::read_file(again));
}

}  // namespace
}  // namespace lamina
