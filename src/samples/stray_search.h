// What lies around the samples that may be strays: their neighbours, found as they are asked for, slab by slab.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "samples/cleaning.h"
#include "samples/neighbourhoods.h"

namespace lamina {

enum Verdict : std::uint8_t { kStays, kIsLonely, kIsOffSurface };

enum Suspicion : std::uint8_t {
  kClear,      ///< no stray
  kInCompany,  ///< perhaps off all surfaces, but not lonely
  kToCompare,  ///< perhaps either: its neighbours' own have to be known
};

/// What is known of the places of a slab.
struct Surroundings {
  /// Neighbours looked for, so that enough are left when some of them are strays.
  static constexpr std::size_t kLookedAt = Neighbourhoods::kNeighbours;

  std::vector<float> distance;            ///< mean distance to the neighbours; negative: not looked at
  std::vector<std::uint32_t> neighbours;  ///< kLookedAt for each place searched around, nearest first
  std::vector<std::uint32_t> row;         ///< of the place in `neighbours`
  std::vector<std::uint8_t> count;        ///< of them
  std::vector<std::uint8_t> stray;        ///< Verdict
  std::vector<std::uint8_t> suspect;      ///< Suspicion
  std::vector<std::uint8_t> look;         ///< Search's
  std::vector<std::uint8_t> beside;       ///< 1: few neighbours, but many samples not much farther away
  std::vector<std::uint8_t> far;          ///< 1: may be clutter by its distance, whether it stays or not
  std::vector<float> scatter;             ///< scatter_of() where samples are sparse, else negative

  /// Of a place that has been searched around: `count` of them.
  [[nodiscard]] const std::uint32_t* neighbours_of(std::size_t place) const {
    return neighbours.data() + std::size_t{row[place]} * kLookedAt;
  }
};

/// The neighbours of a place that have not been found to be strays.
struct Company {
  std::array<std::uint32_t, kStrayNeighbours> places;
  std::size_t count = 0;
};

Company company_of(const Surroundings& known, std::size_t place);

/// The mean distance to the company, as if there were kStrayNeighbours: those not found are at least at `reach`.
float mean_distance(const Placed& s, std::size_t place, const Company& company, float reach);

/// Finds the neighbours of a slab's places as they are asked for.
class Search {
 public:
  /// `reach` in steps.
  Search(const Neighbourhoods& around, float reach, Surroundings& out) : around_(around), reach_(reach), out_(out) {}

  /// Of those that may be strays within reach of the slab, and of the neighbours that these are compared with.
  void start();
  /// And of those that places with strays among their neighbours are compared with.
  void go_on();

 private:
  enum Look : std::uint8_t { kNot, kWanted, kDone };

  template <class Each>
  void for_suspects(const Each& each);
  void search_wanted();
  void search_leaf(const SampleLeaf& leaf);
  /// Around the places compared with their neighbours.
  void search_around();

  const Neighbourhoods& around_;
  float reach_;
  Surroundings& out_;
};

}  // namespace lamina
