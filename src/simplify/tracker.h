// How far a piece has moved away from what it was.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "meshes/vec3.h"
#include "simplify/cover.h"
#include "simplify/stars.h"

namespace lamina::simplify {

/// How far a triangle is from the mesh that simplification began with, at most.
struct Errors {
  float out = 0;   ///< every point of that mesh is within `out` of a triangle
  float back = 0;  ///< every point of the triangle is within `back` of that mesh
};

/// Allows contractions after which every point of the piece as it was, its errors added, is still within the bound of
/// the piece as it is, and the other way round. Every old triangle knows the present ones that it was proved near, and
/// these know it: a contraction has to prove again only the old triangles of those it changes.
class Tracker {
 public:
  Tracker(const std::vector<meshes::Vec3>& positions, const std::vector<Triangle>& triangles,
          std::vector<Errors> errors, double bound);

  /// May u and v become one vertex at `to`?
  bool allows(const Stars& stars, std::span<const meshes::Vec3> positions, std::uint32_t u, std::uint32_t v,
              const meshes::Vec3& to);
  /// What was allowed last is done.
  void accept();
  /// Gives back the memory that questions need, until the next one.
  void rest();

  /// Of the triangles, those present now.
  [[nodiscard]] std::vector<Errors> errors() const;

 private:
  static constexpr std::size_t kFaces = 12;  ///< an old triangle lies near no more
  static constexpr std::uint32_t kEnd = 0xFFFFFFFFU;
  /// An old triangle.
  struct Old {
    Triangle corners{};
    Errors errors;    ///< its own
    float error = 0;  ///< of its points to the present mesh, its own added
    std::uint8_t size = 0;
    std::array<std::uint32_t, kFaces> faces{};
    std::uint32_t seen = 0;
  };
  struct Link {
    std::uint32_t old, next;
  };
  struct Proof {
    std::uint32_t old;
    float error;
    std::uint8_t size;
    std::array<std::uint32_t, kFaces> faces;
  };

  void gather(const Stars& stars, std::uint32_t u, std::uint32_t v);
  void prepare(const Stars& stars, std::span<const meshes::Vec3> positions);
  bool still_covered();
  bool covers();
  [[nodiscard]] std::array<meshes::Vec3, 3> old_corners(const Old& old) const {
    return {base_[old.corners[0]], base_[old.corners[1]], base_[old.corners[2]]};
  }
  void link(std::uint32_t face, std::uint32_t old);

  std::vector<meshes::Vec3> base_;  ///< positions as they were
  std::vector<Old> olds_;
  std::vector<float> back_;          ///< of the present triangles
  std::vector<std::uint32_t> head_;  ///< their first links
  std::vector<Link> links_;
  std::uint32_t free_ = kEnd;
  double bound_;
  meshes::Vec3 origin_;  ///< of facets

  // Of the contraction in question.
  std::uint32_t question_ = 0;
  std::vector<std::uint32_t> star_;      ///< triangles around it
  std::vector<std::uint32_t> affected_;  ///< old triangles near them
  std::vector<Facet> before_, after_;    ///< these triangles; those that stay
  std::vector<const Facet*> before_list_, facets_;
  std::vector<Facet> faces_, old_facets_;  ///< of the present triangles and the old ones, while questions are asked
  std::vector<Proof> proofs_;
  std::vector<float> after_back_;
  Cover cover_;
};

}  // namespace lamina::simplify
