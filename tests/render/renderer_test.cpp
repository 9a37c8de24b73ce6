#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>

#include "lamina/error.h"
#include "lamina/render.h"
#include "render/shapes.h"

namespace lamina {
namespace {

using Pixel = std::array<std::uint8_t, 3>;

// Seen along -z, one sample per pixel.
RenderSettings front(int width, int height) {
  RenderSettings s;
  s.width = width;
  s.height = height;
  s.supersample = 1;
  s.azimuth = 0;
  s.elevation = 0;
  return s;
}

std::size_t count_covered(const Image& image) {
  const Pixel background = image.at(0, 0);
  std::size_t n = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) n += image.at(x, y) != background ? 1 : 0;
  }
  return n;
}

std::size_t count_red(const Image& image) {
  std::size_t n = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const Pixel p = image.at(x, y);
      n += p[0] > 200 && p[1] < 80 && p[2] < 80 ? 1 : 0;
    }
  }
  return n;
}

TEST(Render, ASphereCoversItsDisc) {
  const Image image = render(test::sphere(3, 96, {5e5, 4e6, 1e3}), front(400, 300));
  const double radius = 0.5 * 300 * 0.94;
  EXPECT_NEAR(static_cast<double>(count_covered(image)), std::numbers::pi * radius * radius,
              0.01 * std::numbers::pi * radius * radius);
  // Every pixel clearly inside is covered, every one clearly outside is not.
  const Pixel background = image.at(0, 0);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double distance = std::hypot(x + 0.5 - 200, y + 0.5 - 150);
      if (distance < radius - 1.5) {
        ASSERT_NE(image.at(x, y), background) << x << ' ' << y;
      } else if (distance > radius + 1.5) {
        ASSERT_EQ(image.at(x, y), background) << x << ' ' << y;
      }
    }
  }
}

TEST(Render, NearerOccludesFartherInAnyOrder) {
  const TriangleMesh near = test::square(1, 1, {255, 0, 0}), far = test::square(2, 0, {0, 0, 255});
  for (const bool near_first : {true, false}) {
    Renderer renderer(front(100, 100), {});
    renderer.frame(near);
    renderer.frame(far);
    renderer.draw(near_first ? near : far);
    renderer.draw(near_first ? far : near);
    const Image image = renderer.finish();
    const Pixel middle = image.at(50, 50), rim = image.at(10, 50);
    EXPECT_GT(middle[0], middle[2] + 60);
    EXPECT_GT(rim[2], rim[0] + 60);
  }
}

TEST(Render, ColoursComeThroughFromEveryType) {
  const auto colour = [](ScalarType type, float full) {
    return render(test::square(2, 0, {0.2F * full, 0.8F * full, 0.4F * full}, type), front(64, 64)).at(32, 32);
  };
  const Pixel bytes = colour(ScalarType::uint8, 255);
  EXPECT_GT(bytes[1], bytes[2] + 30);
  EXPECT_GT(bytes[2], bytes[0] + 20);
  EXPECT_EQ(colour(ScalarType::uint16, 65535), bytes);
  EXPECT_EQ(colour(ScalarType::float32, 1), bytes);
  RenderSettings plain = front(64, 64);
  plain.colour = ColourMode::none;
  EXPECT_NE(render(test::square(2, 0, {0, 255, 0}), plain).at(32, 32), bytes);
}

TEST(Render, BackFacesAreTinted) {
  TriangleMesh mesh = test::square(2, 0, {200, 200, 200});
  const Pixel facing = render(mesh, front(64, 64)).at(32, 32);
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  const Pixel away = render(mesh, front(64, 64)).at(32, 32);
  EXPECT_LT(std::abs(facing[2] - facing[0]), 10);
  EXPECT_GT(away[2], away[0] + 30);
}

TEST(Render, IsTheSameForAnyNumberOfThreads) {
  RenderSettings s = front(300, 200);
  s.supersample = 2;
  s.views = 3;
  s.wire = true;
  s.mark_boundary = true;
  TriangleMesh mesh = test::sphere(1, 120);
  mesh.triangles.resize(mesh.triangles.size() - 500);
  mesh.triangles.insert(mesh.triangles.end(), mesh.triangles.begin(), mesh.triangles.begin() + 1000);  // ties in depth
  RunContext context;
  context.threads = 1;
  const Image one = render(mesh, s, context);
  for (const int threads : {2, 5}) {
    context.threads = threads;
    EXPECT_EQ(render(mesh, s, context).pixels, one.pixels) << threads;
  }
}

TEST(Render, TrianglesSharingEdgesLeaveNoGaps) {
  // A fan of slivers whose edges meet samples at every angle.
  TriangleMesh fan;
  fan.positions.push_back({0.013, -0.007, 0});
  constexpr std::uint32_t kSpokes = 701;
  for (std::uint32_t i = 0; i < kSpokes; ++i) {
    const double a = 2 * std::numbers::pi * i / kSpokes;
    fan.positions.push_back({std::cos(a), std::sin(a), 0});
    fan.triangles.push_back({0, 1 + i, 1 + (i + 1) % kSpokes});
  }
  const Image image = render(fan, front(257, 257));
  const Pixel background = image.at(0, 0);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (std::hypot(x - 128, y - 128) >= 118) continue;
      ASSERT_NE(image.at(x, y), background) << x << ' ' << y;
    }
  }
}

TEST(Render, BoundaryEdgesAreRedOverEverything) {
  RenderSettings s = front(200, 200);
  s.mark_boundary = true;
  const TriangleMesh closed = test::sphere(1, 40);
  EXPECT_EQ(count_red(render(closed, s)), 0u);
  TriangleMesh open = closed;
  open.triangles.erase(open.triangles.begin() + 1);  // at the far pole, -z: hidden by the near side
  Renderer renderer(s, {});
  renderer.frame(open);
  renderer.draw(open);
  EXPECT_EQ(renderer.boundary_edges(), 3u);
  EXPECT_GT(count_red(renderer.finish()), 10u);
}

TEST(Render, ZoomFillsThePictureAndCutsWhatHides) {
  const TriangleMesh near = test::square(1, 1, {255, 0, 0}), far = test::square(8, 0, {0, 0, 255});
  RenderSettings s = front(100, 100);
  s.zoom = RenderSettings::Zoom{{0, 0, 0}, 0.5};
  Renderer renderer(s, {});
  renderer.frame(near);
  renderer.draw(near);
  renderer.draw(far);
  const Image image = renderer.finish();
  for (const int at : {0, 50, 99}) EXPECT_GT(image.at(at, at)[2], image.at(at, at)[0] + 60);
  EXPECT_FALSE(renderer.blank());
  s.zoom->radius = 2;  // reaches beyond the near square now, a quarter of the picture wide
  const Image wider = render(near, s);
  EXPECT_NEAR(static_cast<double>(count_covered(wider)), 25 * 25, 60);
}

TEST(Render, UpAxisAndAzimuthTurnTheCamera) {
  // A long needle along each axis shows as wide, high or a dot.
  const auto extent = [](int axis, int up, double azimuth) {
    TriangleMesh needle;
    needle.positions.assign(3, {0, 0, 0});
    needle.positions[0][static_cast<std::size_t>(axis)] = -10;
    needle.positions[1][static_cast<std::size_t>(axis)] = 10;
    for (std::size_t a = 0; a < 3; ++a) needle.positions[2][a] += 0.5;
    needle.triangles = {{0, 1, 2}};
    RenderSettings s = front(200, 200);
    s.up = up;
    s.azimuth = azimuth;
    s.zoom = RenderSettings::Zoom{{0, 0, 0}, 12};
    const Image image = render(needle, s);
    int left = 200, right = 0, top = 200, bottom = 0;
    for (int y = 0; y < 200; ++y) {
      for (int x = 0; x < 200; ++x) {
        if (image.at(x, y) == image.at(0, 0)) continue;
        left = std::min(left, x), right = std::max(right, x), top = std::min(top, y), bottom = std::max(bottom, y);
      }
    }
    return std::pair{right - left > 100, bottom - top > 100};
  };
  const std::pair wide{true, false}, high{false, true}, dot{false, false};
  EXPECT_EQ(extent(0, 1, 0), wide);
  EXPECT_EQ(extent(1, 1, 0), high);
  EXPECT_EQ(extent(2, 1, 0), dot);
  EXPECT_EQ(extent(0, 1, 90), dot);
  EXPECT_EQ(extent(2, 1, 90), wide);
  EXPECT_EQ(extent(2, 2, 0), high);
  EXPECT_EQ(extent(0, 2, 0), wide);
  EXPECT_EQ(extent(0, 0, 0), high);
}

TEST(Render, PointsAreDiscsWithTheirColours) {
  SampleBatch points;
  points.x = {-1, 1};
  points.y = {0, 0};
  points.z = {0, 0};
  points.nx = {0, 0};
  points.ny = {0, 0};
  points.nz = {1, 1};
  points.attributes = {{255, 0}, {0, 255}, {0, 0}};
  const AttributeLayout layout{{"red", ScalarType::uint8}, {"green", ScalarType::uint8}, {"blue", ScalarType::uint8}};
  RenderSettings s = front(200, 200);
  s.zoom = RenderSettings::Zoom{{0, 0, 0}, 2};
  s.point_radius = 0.5;  // 25 pixels
  Renderer renderer(s, {});
  renderer.frame(points);
  renderer.draw(points, layout);
  const Image image = renderer.finish();
  EXPECT_NEAR(static_cast<double>(count_covered(image)), 2 * std::numbers::pi * 25 * 25, 80);
  EXPECT_GT(image.at(50, 100)[0], 100);
  EXPECT_GT(image.at(150, 100)[1], 100);
  EXPECT_LT(image.at(150, 100)[0], 80);
}

TEST(Render, PointBatchesAndThreadsDoNotMatter) {
  SampleBatch all;
  for (int i = 0; i < 20000; ++i) {
    const double a = 0.1 * i, b = 0.00015 * i;
    all.x.push_back(std::cos(a) * std::sin(b));
    all.y.push_back(std::sin(a) * std::sin(b));
    all.z.push_back(std::cos(b));
  }
  const auto draw = [&](std::size_t batch, int threads) {
    RunContext context;
    context.threads = threads;
    Renderer renderer(front(150, 150), context);
    renderer.frame(all);
    for (std::size_t first = 0; first < all.size(); first += batch) {
      const auto end = static_cast<std::ptrdiff_t>(std::min(first + batch, all.size())),
                 begin = static_cast<std::ptrdiff_t>(first);
      SampleBatch part;
      part.x.assign(all.x.begin() + begin, all.x.begin() + end);
      part.y.assign(all.y.begin() + begin, all.y.begin() + end);
      part.z.assign(all.z.begin() + begin, all.z.begin() + end);
      renderer.draw(part, {});
    }
    return renderer.finish().pixels;
  };
  const auto whole = draw(all.size(), 1);
  EXPECT_EQ(draw(777, 3), whole);
}

TEST(Render, SurvivesWhatIsNotFiniteOrFlat) {
  TriangleMesh mesh = test::square(2, 0, {9, 9, 9});
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  mesh.positions.push_back({nan, 0, 0});
  mesh.positions.push_back({0, infinity, 0});
  mesh.positions.push_back({1e300, 1e300, 0});
  for (auto& channel : mesh.attributes) channel.resize(7, std::numeric_limits<float>::quiet_NaN());
  mesh.triangles.insert(mesh.triangles.end(), {{0, 1, 4}, {0, 1, 5}, {0, 0, 1}, {2, 2, 2}, {0, 4, 5}});
  RenderSettings s = front(80, 80);
  s.mark_boundary = true;
  s.zoom = RenderSettings::Zoom{{0, 0, 0}, 2};
  EXPECT_GT(count_covered(render(mesh, s)), 1000u);
  SampleBatch points;
  points.x = {nan, 0, infinity};
  points.y = {0, 0, 0};
  points.z = {0, 0, 0};
  Renderer renderer(front(80, 80), {});
  renderer.frame(points);
  renderer.draw(points, {});
  EXPECT_GE(count_covered(renderer.finish()), 1u);
}

TEST(Render, RefusesSettingsThatCannotBeMeant) {
  const auto refused = [](const auto& change) {
    RenderSettings s;
    change(s);
    try {
      const Renderer renderer(s, {});
    } catch (const Error& e) {
      return e.code() == ExitCode::usage;
    }
    return false;
  };
  EXPECT_TRUE(refused([](RenderSettings& s) { s.width = 0; }));
  EXPECT_TRUE(refused([](RenderSettings& s) { s.height = 20000; }));
  EXPECT_TRUE(refused([](RenderSettings& s) { s.supersample = 9; }));
  EXPECT_TRUE(refused([](RenderSettings& s) { s.views = 0; }));
  EXPECT_TRUE(refused([](RenderSettings& s) { s.up = 3; }));
  EXPECT_TRUE(refused([](RenderSettings& s) { s.elevation = 91; }));
  EXPECT_TRUE(refused([](RenderSettings& s) { s.zoom = RenderSettings::Zoom{{0, 0, 0}, 0}; }));
  EXPECT_FALSE(refused([](RenderSettings&) {}));
  RunContext context;
  context.max_memory = 1000;
  EXPECT_THROW(Renderer(RenderSettings{}, context), Error);
  TriangleMesh mesh = test::square(1, 0, {0, 0, 0});
  mesh.triangles.push_back({0, 1, 4});
  EXPECT_THROW(render(mesh, {}), Error);
}

/// Eight vertices, whose normals point along the diagonals.
TriangleMesh box() {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.positions.push_back({double(i & 1), double(i >> 1 & 1), double(i >> 2)});
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

TEST(Render, SharpEdgesAreNotCarriedIntoTheirFaces) {
  RenderSettings s = front(200, 200);
  s.azimuth = 30;
  s.elevation = 20;
  RenderSettings flat = s;
  flat.flat = true;
  EXPECT_EQ(render(box(), s).pixels, render(box(), flat).pixels);
  TriangleMesh turned = box();  // as some programs write them
  for (auto& t : turned.triangles) std::swap(t[1], t[2]);
  EXPECT_EQ(render(turned, s).pixels, render(turned, flat).pixels);
  EXPECT_NE(render(test::sphere(1, 12), s).pixels, render(test::sphere(1, 12), flat).pixels)
      << "and round ones are round";
}

TEST(Render, StopsWhenCancelled) {
  const std::atomic<bool> cancel{true};
  RunContext context;
  context.cancel = &cancel;
  EXPECT_THROW(render(test::sphere(1, 8), {}, context), Error);
}

TEST(Render, ATurnKeepsItsScaleAndItsAxis) {
  // A board far from the origin: its height never changes, and nothing leaves the picture.
  TriangleMesh mesh = test::square(1, 0, {200, 200, 200});
  for (auto& p : mesh.positions) p = {1 + 4 * p[0], p[1], p[2]};
  RenderSettings s = front(160, 120);
  s.frames = 36;
  Renderer renderer(s, {});
  renderer.frame(mesh);
  std::vector<int> widths, heights;
  for (int frame = 0; frame < s.frames; ++frame) {
    renderer.turn(frame);
    renderer.draw(mesh);
    const Image image = renderer.finish();
    const Pixel background = image.at(80, 119);
    int left = image.width, right = -1, top = image.height, bottom = -1;
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        if (image.at(x, y) == background) continue;
        left = std::min(left, x), right = std::max(right, x), top = std::min(top, y), bottom = std::max(bottom, y);
      }
    }
    if (frame % 18 == 9) continue;  // edge on
    EXPECT_GE(left, 1) << frame;
    EXPECT_LE(right, 158) << frame;
    heights.push_back(bottom - top);
    widths.push_back(right - left);
  }
  EXPECT_LE(*std::max_element(heights.begin(), heights.end()) - *std::min_element(heights.begin(), heights.end()), 1);
  EXPECT_LT(*std::min_element(widths.begin(), widths.end()), widths[0] / 2);
  EXPECT_NEAR(widths[0], 0.94 * 160, 3);
  EXPECT_THROW(renderer.turn(36), Error);
  // A picture of the turn has the camera where its azimuth says.
  s.zoom = RenderSettings::Zoom{{1, 0, 0}, 2};
  Renderer turned(s, {});
  turned.frame(mesh);
  turned.turn(9);
  turned.draw(mesh);
  s.frames = 1;
  s.azimuth = 90;
  EXPECT_EQ(turned.finish().pixels, render(mesh, s).pixels);
}

}  // namespace
}  // namespace lamina
