// Directions of normals, still without a sign: the plane that fits a sample's neighbours best, by principal component
// analysis in closed form; and the links between neighbours along which signs will travel.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "normals/sample_window.h"
#include "samples/sample_tree.h"

namespace lamina::normals {

/// Sums of offsets from one sample, of any unit: where it is among its neighbours they cannot cancel.
struct Moments {
  double count = 0;  ///< or weight
  std::array<double, 3> sum{};
  std::array<double, 6> products{};  ///< xx xy xz yy yz zz

  void add(const std::array<float, 3>& d) {
    const double x = d[0];
    const double y = d[1];
    const double z = d[2];
    count += 1;
    sum[0] += x;
    sum[1] += y;
    sum[2] += z;
    products[0] += x * x;
    products[1] += x * y;
    products[2] += x * z;
    products[3] += y * y;
    products[4] += y * z;
    products[5] += z * z;
  }
  void add(const std::array<float, 3>& d, double weight) {
    const double x = d[0];
    const double y = d[1];
    const double z = d[2];
    count += weight;
    sum[0] += weight * x;
    sum[1] += weight * y;
    sum[2] += weight * z;
    products[0] += weight * x * x;
    products[1] += weight * x * y;
    products[2] += weight * x * z;
    products[3] += weight * y * y;
    products[4] += weight * y * z;
    products[5] += weight * z * z;
  }
};

struct Plane {
  std::array<float, 3> normal{};           ///< unit length; zero where there is none: samples on a line or a point
  double least = 0, middle = 0, most = 0;  ///< variance along the principal axes

  [[nodiscard]] bool valid() const { return normal[0] != 0 || normal[1] != 0 || normal[2] != 0; }
};

/// Only sums, products, quotients and square roots: the same bits on every processor. The sign of the normal means
/// nothing.
Plane fit_plane(const Moments& moments);

inline constexpr std::size_t kLeastLinked = 12;  ///< neighbours that links are chosen from

struct DirectionSettings {
  int k = 16;               ///< neighbours the plane is fitted to, where they are not noisy
  float radius = 0;         ///< steps; above 0: all neighbours within it, however many
  float search_radius = 0;  ///< steps: samples farther apart are no neighbours
  bool lines = false;       ///< many samples lie on lines far apart: neighbours are to be from several of them
};

/// Finds the links of the samples links.core names, and the normals of those that have none. Where the nearest samples
/// lie on a line, as those of one scan line do, twice and four times as many are taken; where they are noisy, as many
/// as the noise asks for and the shape allows (choose_level()), about the same at neighbouring samples. A sample
/// whose neighbours make no plane is left without a normal.
void find_directions(const SampleTree& tree, const DirectionSettings& settings, WindowSamples& samples, Links& links);

// How far around a sample its plane must reach: among noise the nearest samples say little about the surface's
// direction, and beyond detail or an edge more of them say something else.

/// Level l reaches as far as the nearest samples that the first plane was fitted to, times 2^(l/2): about 2^l times as
/// many samples.
inline constexpr std::uint8_t kMostLevel = 6;

/// Where a plane fit starts.
struct FirstFit {
  std::uint32_t place = 0;
  Plane plane;         ///< of the nearest samples
  double samples = 0;  ///< in it
  float squared = 0;   ///< distance of the farthest of them, steps^2
  float bound = 0;     ///< likewise: farther samples are no neighbours
};

/// The level from which on the direction is certain to a degree or two, or the last one that agrees with those before
/// it: a plane of more samples must lie within the uncertainty of the planes of fewer (Lepski's rule), its residual
/// must not grow as that of an edge or a curved surface does, and its samples must spread to both sides. 0 for samples
/// of little noise, after a look at the first plane alone.
std::uint8_t choose_level(const SampleTree& tree, const FirstFit& first);

/// Squared distance that a level reaches to, steps^2.
float reach_of_level(float first_squared, std::uint8_t level);

/// The plane of the samples within a squared distance; they count the less the farther away they are. Not valid where
/// there is none.
Plane plane_within(const SampleTree& tree, std::uint32_t place, float squared);

// Which sheet a noisy sample belongs to: between the faces of a thin wall noise leaves no gap, and neighbours there say
// that the two are one.

/// Squared distances, steps^2.
struct SheetReach {
  float plane = 0;    ///< of the samples that the normal's plane was fitted to
  float nearest = 0;  ///< of the first plane's, the nearest
};

/// How far along the normal the samples of a slim column around this one lie densest, steps: mean shift from the
/// sample's own height (Fukunaga and Hostetler 1975; Cheng 1995).
float height_of_sheet(const SampleTree& tree, std::uint32_t place, const std::array<float, 3>& normal,
                      const SheetReach& reach);

}  // namespace lamina::normals
