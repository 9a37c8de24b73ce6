// Where the vertices of a piece as it was lie on the piece as it is: an estimate of how far it has moved.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "meshes/vec3.h"
#include "simplify/old_mesh.h"
#include "simplify/stars.h"

namespace lamina::simplify {

/// Every old vertex has its home, the present triangle that it was found nearest to when its last one changed. Allows
/// contractions after which old vertices are near their homes and the new vertex is near the old triangles. What lies
/// between them is not asked: Proof tells whether the bound is kept.
class Tracker {
 public:
  /// Refers to the mesh, which is also the present one.
  explicit Tracker(const OldMesh& old);

  /// May u and v become one vertex at `to`?
  bool allows(const Stars& stars, std::span<const meshes::Vec3> positions, std::uint32_t u, std::uint32_t v,
              const meshes::Vec3& to);
  /// What was allowed last is done.
  void accept();
  /// It has been taken back: finds homes for the old vertices of these triangles, some of which are not there, among
  /// those that are.
  void settle(const Stars& stars, std::span<const meshes::Vec3> positions, std::span<const std::uint32_t> triangles);

  /// The old vertices there have to stay nearer from now on.
  void tighten(std::uint32_t triangle);

  /// Of the old vertices.
  [[nodiscard]] const std::vector<std::uint32_t>& homes() const { return homes_; }

 private:
  static constexpr std::uint32_t kEnd = 0xFFFFFFFFU;
  static constexpr std::size_t kLanes = 4;
  /// Of four triangles around the new vertex the planes: their own, and those upright on their sides, inwards. Points
  /// count from the new vertex; three of the planes hold it.
  struct alignas(16) Fan {
    std::array<std::array<float, kLanes>, 3> own{}, first{}, second{}, far{};
    std::array<float, kLanes> far_offset{};
  };

  /// Of an old vertex, how far it lies from planes of a fan.
  struct alignas(16) Seen {
    std::array<float, kLanes> height, first, second, far;
  };

  void gather(const Stars& stars, std::uint32_t u, std::uint32_t v);
  void make_fans(const Stars& stars, std::span<const meshes::Vec3> positions, std::uint32_t u, std::uint32_t v,
                 const meshes::Vec3& to);
  void look(std::size_t point, const std::array<float, 3>& at);
  bool find_home(std::size_t point);
  bool find_home_exactly(std::size_t point, const meshes::Vec3& at);
  bool crossings_near(const meshes::Vec3& to);
  [[nodiscard]] bool crossing_near(std::size_t from, std::size_t to, float slack) const;
  [[nodiscard]] bool near_old(const meshes::Vec3& at, std::uint32_t vertex) const;
  void put_home(std::uint32_t vertex, std::uint32_t triangle);

  const OldMesh& old_;
  std::vector<float> slack_;  ///< how far old vertices may be from their homes
  std::vector<std::uint32_t> homes_;
  std::vector<std::uint32_t> head_;  ///< of the present triangles: the first of the old vertices there
  std::vector<std::uint32_t> next_;  ///< of the old vertices: the next one in the same triangle

  // Of the contraction in question.
  std::vector<std::uint32_t> star_;                   ///< triangles around it
  std::vector<std::uint32_t> after_;                  ///< those that stay
  std::vector<std::array<meshes::Vec3, 3>> corners_;  ///< of these, from the new vertex on, which is the first
  std::vector<std::uint32_t> points_;                 ///< old vertices at home there
  std::vector<std::uint32_t> chosen_;                 ///< their new homes
  std::vector<Fan> fans_;
  std::vector<Seen> seen_;           ///< of every point for every fan
  std::vector<std::uint32_t> slot_;  ///< of old vertices: where in points_, if they are there
};

}  // namespace lamina::simplify
