// Every sample's normal replaced by that of the sphere fitted to the samples around it, where these face about one way:
// noise averages out, and what the projection sums up are normals that agree.
#pragma once
#include <map>
#include <memory>

#include "lattice/lattice.h"
#include "mls/kernel.h"
#include "mls/row_samples.h"
#include "samples/sample_feed.h"
#include "samples/support_field.h"

namespace lamina {

/// A fit that turns a normal around, or has fewer samples than this, is no better than what came.
inline constexpr float kLeastRefitSamples = 6;

/// Variance of the normals around a sample, of length one, up to which none of them can be blurred: they turn by less
/// than four degrees.
inline constexpr float kBlurredVariance = 0.0005F;

/// Variances of the normals around a sample, of length one, up to which they are taken for noise, where twice what the
/// cloud's normals have is not more: within the support, and within one so many times as wide. Up to the former the fit
/// within the support is the best there is. Normals that vary more than that turn with the surface, which that fit
/// would level: the fit within the narrow support is taken, and where they vary even there, the normal that came.
/// Noise of neighbours that share samples is much the same, so that more of it is allowed in the narrow one.
inline constexpr float kSmoothVariance = 0.03F;
inline constexpr float kRoughVariance = 0.1F;
inline constexpr float kNarrow = 0.5F;

/// From so many times that variance on, none of the fit is left; between them it is a mixture.
inline constexpr float kShapeRatio = 3;

struct RefitSettings {
  double support = 0;    ///< radii within which a sample acts, about that where it follows places; 0: normals stay
  float max_radius = 0;  ///< a longer radius acts as this, steps, > 0: how far is known before streaming
  int level = 0;         ///< whose cells are about a radius long: only time depends on it
  float noise = 0;       ///< of the normals, median angle, radians
  /// Instead of all normals, noisy ones, only those are replaced that were interpolated over a sharp edge, by those of
  /// the planes that the samples' neighbours lie on (samples/consensus_plane.h).
  bool only_blurred = false;
  /// Null: the same everywhere; else the radii are so many times H.
  std::shared_ptr<const SupportField> by_place{};
  float per_blend = 0;

  /// The largest support of a sample, radii.
  [[nodiscard]] float widest() const { return by_place ? per_blend * by_place->most() : static_cast<float>(support); }
};

/// The fit is the projection's (kernel.h) at the sample's own place, with the weights of projection, without the
/// samples whose normals point away from its own. A function of the samples within halo() alone.
class RefitNormals final : public NormalFilter {
 public:
  RefitNormals(const RefitSettings& settings, const Lattice& lattice, const Kernel& kernel);
  ~RefitNormals() override;
  [[nodiscard]] double halo() const override;
  void add(std::size_t bucket, const LocalSamples& samples, const std::vector<float>& radii) override;
  FilteredNormals find(std::size_t bucket) override;
  void forget_below(std::int64_t z) override;

 private:
  struct Added;
  RefitSettings settings_;
  Lattice lattice_;
  Kernel kernel_;
  std::map<std::size_t, std::unique_ptr<Added>> added_;
};

}  // namespace lamina
