// Small meshes and scratch files for the tests of these rooms.
#pragma once
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include "lamina/error.h"
#include "lamina/mesh.h"

namespace lamina::testing_meshes {

/// A folder that goes away with the test.
class ScratchFolder {
 public:
  ScratchFolder() {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::temp_directory_path() /
            (std::string("lamina_") + info->test_suite_name() + "_" + info->name() + "_" + std::to_string(::getpid()));
    std::filesystem::create_directories(path_);
  }
  ~ScratchFolder() { std::filesystem::remove_all(path_); }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }
  [[nodiscard]] std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path_), {}));
  }
  std::string write(const std::string& name, const std::string& bytes) const {
    std::ofstream(file(name), std::ios::binary) << bytes;
    return file(name);
  }

 private:
  std::filesystem::path path_;
};

inline std::string bytes_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Expects an Error of `code` whose one line holds every word.
inline void expect_error(ExitCode code, const std::function<void()>& act, const std::vector<std::string>& words) {
  try {
    act();
    FAIL() << "no error";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), code) << e.what();
    const std::string text = e.what();
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    for (const auto& w : words) EXPECT_NE(text.find(w), std::string::npos) << "\"" << w << "\" is missing in: " << text;
  }
}

inline TriangleMesh tetrahedron() {
  TriangleMesh m;
  m.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  m.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return m;
}

/// A sphere of `rings` x `around` quads cut in two, poles single.
inline TriangleMesh sphere(double radius, std::uint32_t rings, std::uint32_t around) {
  TriangleMesh m;
  m.positions.push_back({0, 0, -radius});
  const double pi = std::acos(-1.0);
  for (std::uint32_t r = 1; r < rings; ++r)
    for (std::uint32_t k = 0; k < around; ++k) {
      const double polar = pi * r / rings, turn = 2 * pi * k / around;
      m.positions.push_back({radius * std::sin(polar) * std::cos(turn), radius * std::sin(polar) * std::sin(turn),
                             -radius * std::cos(polar)});
    }
  const auto top = static_cast<std::uint32_t>(m.positions.size());
  m.positions.push_back({0, 0, radius});
  const auto at = [&](std::uint32_t r, std::uint32_t k) { return 1 + (r - 1) * around + k % around; };
  for (std::uint32_t k = 0; k < around; ++k) {
    m.triangles.push_back({0, at(1, k + 1), at(1, k)});
    for (std::uint32_t r = 1; r + 1 < rings; ++r) {
      m.triangles.push_back({at(r, k), at(r, k + 1), at(r + 1, k + 1)});
      m.triangles.push_back({at(r, k), at(r + 1, k + 1), at(r + 1, k)});
    }
    m.triangles.push_back({at(rings - 1, k), at(rings - 1, k + 1), top});
  }
  return m;
}

/// The unit square at z = 0 in n x n quads cut in two.
inline TriangleMesh grid(std::uint32_t n) {
  TriangleMesh m;
  for (std::uint32_t j = 0; j <= n; ++j)
    for (std::uint32_t i = 0; i <= n; ++i) m.positions.push_back({double(i) / n, double(j) / n, 0});
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = j * (n + 1) + i;
      m.triangles.push_back({a, a + 1, a + n + 2});
      m.triangles.push_back({a, a + n + 2, a + n + 1});
    }
  return m;
}

}  // namespace lamina::testing_meshes
