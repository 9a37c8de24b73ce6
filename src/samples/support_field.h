// How wide supports are from place to place where a cloud is noisy or lies on lines: H, a sample's support in units of
// its radius.
//
// A wide support averages noise and a narrow one keeps detail, and how much there is of both changes from place to
// place. So samples all over the cloud are compared with the surface that their neighbours suggest over disks of
// several widths: the disk that predicts them best is as wide as noise asks for and detail allows (cross-validation,
// Stone 1974). Neighbours count by their distance along the surface, since those nearest in space to a noisy sample
// share its error.
//
// And a support has to hold samples on all sides. Those of profile scanners and of grazing rays lie on lines; a support
// that ends before the next line makes a ribbon of each.
#pragma once
#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "base/hashing.h"
#include "samples/sampling_survey.h"
#include "store/slab_store.h"

namespace lamina {

/// H at a sample of the cloud.
struct SupportPlace {
  std::array<float, 3> at{};  ///< steps
  float blend = 0;            ///< H
};

/// The least H that is chosen, the most for noise, and the most to reach the next line.
inline constexpr float kLeastSupport = 1.2F;
inline constexpr float kMostSupport = 6;
inline constexpr float kMostAllRound = 4;

/// Supports are to hold samples on all sides, or to be as wide as noise asks for as well.
enum class SupportAim : std::uint8_t { all_round, noise };

struct SupportSurvey {
  std::vector<SupportPlace> places;
  bool lines = false;  ///< at most places the least H does not reach neighbours on all sides
  /// H in the middle of the places; 0 where there are none.
  [[nodiscard]] float median() const;
};

/// H at some four thousand samples from all over the cloud, one in sixteen at the most; `survey` is of the same store.
/// Empty where no sample has neighbours to tell, and where all_round is the aim and samples do not lie on lines. A
/// function of the store alone. Reads some four million samples, each about twice, in runs of buckets, from all over
/// the store where it has more. Memory: 28 bytes for each sample of a run, which is as tall as some fifty radii.
SupportSurvey survey_support(const SlabStore& store, const ReadBucket& read, const RadiusSurvey& survey,
                             SupportAim aim);

/// What is seen of a cloud before it is streamed.
struct CloudSurvey {
  RadiusSurvey radii;
  bool noisy = false;     ///< supports are to average
  SupportSurvey support;  ///< without places where supports do not follow them
};

/// H anywhere: a continuous function of the places alone, between the least and the most of theirs. It is the weighted
/// mean of the nearest places at the corners of a grid whose cubes are about as wide as places lie apart, and trilinear
/// between them.
class SupportField {
 public:
  /// `places`: at least one.
  explicit SupportField(const std::vector<SupportPlace>& places);
  SupportField(const SupportField&) = delete;
  SupportField& operator=(const SupportField&) = delete;

  [[nodiscard]] float least() const { return least_; }
  [[nodiscard]] float median() const { return median_; }
  [[nodiscard]] float most() const { return most_; }

  /// H at point after point, quick where they lie close together. For one thread; the field must outlive it.
  class Cursor {
   public:
    explicit Cursor(const SupportField& field) : field_(&field) {}
    /// Steps.
    float at(std::int32_t x, std::int32_t y, std::int32_t z);

   private:
    using Corner = std::array<std::int64_t, 3>;
    struct Hash {
      std::size_t operator()(const Corner& c) const { return cell_hash(c[0], c[1], c[2]); }
    };
    float corner(const Corner& at);

    const SupportField* field_;
    Corner cube_{};
    std::array<float, 8> blend_{};  ///< at the corners of `cube_`
    bool any_ = false;
    std::unordered_map<Corner, float, Hash> corners_;  ///< seen lately
  };
  /// The calling thread's own, which knows what it was asked before.
  [[nodiscard]] Cursor& cursor() const { return cursors_.local(); }

 private:
  [[nodiscard]] float interpolated(const std::array<float, 3>& at) const;

  /// Places that lie close together: [begin, end).
  struct Group {
    std::size_t begin = 0, end = 0;
    std::array<float, 3> low{}, high{};
  };
  void put_in_order(std::vector<SupportPlace> places);

  std::vector<float> x_, y_, z_, blend_;
  std::vector<Group> groups_;
  std::int64_t edge_ = 1;  ///< of the grid's cubes, steps
  float least_ = 1, median_ = 1, most_ = 1;
  mutable tbb::enumerable_thread_specific<Cursor> cursors_{[this] { return Cursor(*this); }};
};

}  // namespace lamina
