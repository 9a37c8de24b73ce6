// Projection: every corner worth it gets its point, normal, signed distance and attributes from the samples around
// (Cuccuru et al. 2009, section 3.2), on the window's layers of one slab.
#pragma once
#include <cstdint>
#include <limits>
#include <memory>

#include "mls/kernel.h"
#include "octree/window.h"
#include "samples/sample_feed.h"

namespace lamina {

enum class Fit { plane, sphere };

struct ProjectSettings {
  Fit fit = Fit::sphere;  ///< sphere: algebraic sphere (Guennebaud & Gross 2007); plane: Cuccuru et al. 2009, 3.2
  bool centres = false;   ///< project the centres of leaf cells instead of corners (section 3.3; see diffuse_slab())
  int steps = 1;          ///< N >= 1: almost orthogonal projection steps (Alexa & Adamson 2004)
  float tolerance = 0;    ///< a point is done when a step moves it no more than so many supports; 0: next to nothing
  /// A corner keeps a value only if it lies this near to a sample's tangent plane (cells of the sample's level): where
  /// samples say exactly where the surface is.
  float height = std::numeric_limits<float>::infinity();
  /// A point whose samples' mean normal is shorter than this sees two sheets, or one bent sharply, and counts only the
  /// samples on its own side, that face where the mean does; 0: all count always.
  float sheets = 0.8F;
  float apart = 0.7F;           ///< provided that the two lie this far apart (cells): the lattice can tell them
  float trusted_offset = 0.4F;  ///< trusted while |projected point - weighted average| <= this, in support radii
  int trusted_samples = 3;      ///< and at least this many samples contributed
  bool residuals = false;       ///< samples have them (ActiveBucket::residual): what their mean tells is added
  bool leans = true;            ///< values have kLean; else 0
  bool densities = true;        ///< and kDensity
  bool creases = false;         ///< sharp edges where normals fall into two or three groups (creases.h); corners only

  /// Whether values have channels that not all runs want.
  [[nodiscard]] bool rare_channels() const { return leans || densities || creases; }
};

struct ProjectCounts {
  std::uint64_t corners = 0;  ///< corners projected
  std::uint64_t seen = 0;     ///< of these, with samples in reach
  std::uint64_t trusted = 0;  ///< of these, trusted
  std::uint64_t sums = 0;     ///< how often samples were summed up at one: once for each of its steps
  std::uint64_t torn =
      0;  ///< of those with samples, whose normals contradict each other: their mean is under half long
  /// The slab with the largest share of those, among slabs with enough corners to tell.
  std::int32_t torn_slab = 0;
  double torn_share = 0;
};

/// Keeps the threads' scratch memory between slabs.
class Projector {
 public:
  Projector(const ProjectSettings& settings, const Kernel& kernel);
  ~Projector();
  Projector(const Projector&) = delete;
  Projector& operator=(const Projector&) = delete;
  /// Says that a slab is next: what can be done before its corners are placed begins in the background. The feed must
  /// be ready as for project().
  void begin(const Lattice& lattice, std::int32_t slab, SampleFeed& feed);
  /// Fills the values, `seen` and `trusted` of the slab's active corners. Its corners must be placed and the feed be
  /// ready to slab end + largest support (twice that for steps > 1).
  void project(Window& window, std::int32_t slab, SampleFeed& feed);
  [[nodiscard]] const ProjectCounts& counts() const { return counts_; }
  /// Samples may act this much (steps) beyond their support when steps > 1.
  [[nodiscard]] float margin(const Lattice& lattice) const;

 private:
  class Level;
  struct Scratch;
  [[nodiscard]] std::vector<std::vector<std::size_t>> batches_of(const Lattice& lattice, std::int32_t slab,
                                                                 const SampleFeed& feed) const;
  void add_counts(std::int32_t slab);
  ProjectSettings settings_;
  Kernel kernel_;
  ProjectCounts counts_;
  std::unique_ptr<Scratch> scratch_;
};

// Cell-to-vertex diffusion (Cuccuru et al. 2009, section 3.3): corners take the mean of what the projected centres of
// the cells around them say.

/// Fills values, `seen` and `trusted` of the slab's active corners from the centres of the leaf cells that touch them,
/// at whatever level, weights inversely proportional to cell size; trusted centres only, where there is one. The
/// centres of this slab and of the one below must be projected (ProjectSettings::centres).
void diffuse_slab(Window& window, std::int32_t slab);

}  // namespace lamina
