#include "normals/judgement.h"

#include <cstring>

#include "base/four.h"

namespace lamina::normals {
namespace {

using FourVectors = std::array<FourFloats, 3>;

FourFloats dot(const FourVectors& a, const FourVectors& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Four links of a sample, side by side.
class FourLinks {
 public:
  /// From one end to the other, and the normals there.
  FourLinks(const FourVectors& offset, const FourVectors& here, const FourVectors& there)
      : squared_(dot(offset, offset)),
        cosine_(dot(here, there)),
        along_here_(dot(here, offset)),
        along_there_(dot(there, offset)) {}

  [[nodiscard]] FourFloats agreement(float scale) const {
    constexpr float kNoise = 0.25F;  // offsets of half the neighbourhood's radius are mirrored by half
    const FourFloats squared = squared_ + kNoise * scale;
    return squared > 0 ? cosine_ - 2 * along_here_ * along_there_ / squared : cosine_;
  }
  [[nodiscard]] FourInts lie_along() const {
    constexpr float kSine2 = 0.25F;
    const FourFloats most = kSine2 * squared_;
    const FourFloats cosine = cosine_ < 0 ? -cosine_ : cosine_;
    return (squared_ > 0) & (along_here_ * along_here_ < most) & (along_there_ * along_there_ < most) & (cosine > 0.5F);
  }
  [[nodiscard]] FourInts face_one_side() const { return cosine_ > 0; }

 private:
  FourFloats squared_, cosine_, along_here_, along_there_;
};

FourLinks four_links(const SampleTree& tree, const WindowSamples& s, std::uint32_t place, const std::uint32_t* others) {
  const FourVectors n{FourFloats{} + s.nx[place], FourFloats{} + s.ny[place], FourFloats{} + s.nz[place]};
  const FourVectors m{four_at(s.nx, others), four_at(s.ny, others), four_at(s.nz, others)};
  const FourFloats lift = four_at(s.lift, others);
  FourVectors d = tree.offsets(place, others);
  for (std::size_t a = 0; a < 3; ++a) d[a] += lift * m[a] - s.lift[place] * n[a];
  return {d, n, m};
}

}  // namespace

Judgement judge_links(const SampleTree& tree, const WindowSamples& samples, const Links& links, std::size_t i) {
  Judgement out;
  for (std::size_t first = 0; first < Links::kMost; first += 4) {
    const FourLinks four = four_links(tree, samples, links.core[i], &links.neighbours[i][first]);
    const FourFloats agreement = four.agreement(links.scale[i]);
    std::memcpy(&out.agreement[first], &agreement, sizeof(agreement));
    out.along = static_cast<std::uint8_t>(out.along | bits_of(four.lie_along()) << first);
    out.same = static_cast<std::uint8_t>(out.same | bits_of(four.face_one_side()) << first);
  }
  return out;
}

}  // namespace lamina::normals
