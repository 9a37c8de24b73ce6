// Body of the kernel of the search for nearest samples; included by near_kernel_v*.cpp inside a namespace of its own,
// once per processor kind, behind what differs between the kinds:
//   Ints, Floats     vectors of kLanes
//   not_above(floats, float), below(ints, int), equal(ints, ints)  a bit for each lane that it holds for
//   Order, order_of(bits), in_order(ints, order)  the lanes with a bit one after another, behind them anything
//   count_nearer(one, others, counts)  adds 1 to the counts of those of the others that are farther than the one
//   kVectorsAtOnce   so many vectors of counts fit the registers
// No include guard on purpose.

inline constexpr std::size_t kLanes = sizeof(Ints) / sizeof(std::int32_t);
static_assert(kLanes <= kNearLanes);

/// The lanes that a mask has a bit for, one after another.
class Packed {
 public:
  explicit Packed(unsigned mask) : mask_(mask), order_(order_of(mask)) {}
  [[nodiscard]] std::size_t count() const { return static_cast<std::size_t>(__builtin_popcount(mask_)); }
  template <class V>
  void write(const V& v, void* to) const {
    const Ints packed = in_order(std::bit_cast<Ints>(v), order_);
    __builtin_memcpy(to, &packed, sizeof(packed));
  }

 private:
  unsigned mask_;
  Order order_;
};

inline Ints load_ints(const std::int32_t* from) {
  Ints v;
  __builtin_memcpy(&v, from, sizeof(v));
  return v;
}
inline Floats load_floats(const float* from) {
  Floats v;
  __builtin_memcpy(&v, from, sizeof(v));
  return v;
}
typedef std::uint32_t Words __attribute__((vector_size(sizeof(Ints))));  // NOLINT(modernize-use-using)
/// Lanes behind the last sample hold anything: their differences may pass the range of an int, and do not count.
inline Ints difference(const Ints& a, const Ints& b) {
  return std::bit_cast<Ints>(std::bit_cast<Words>(a) - std::bit_cast<Words>(b));
}
inline Floats floats_of(const Ints& v) {
  return __builtin_convertvector(v, Floats);
}
inline Ints lane_numbers() {
  Ints v{};
  for (std::size_t i = 0; i < kLanes; ++i) v[i] = static_cast<std::int32_t>(i);
  return v;
}

inline Floats past_of(const Ints& at, std::int32_t low, std::int32_t high) {
  const Ints below = difference(Ints{} + low, at);
  const Ints above = difference(at, Ints{} + high);
  const Ints more = below > above ? below : above;
  return floats_of(more > 0 ? more : Ints{});
}

inline bool gather(const PlacedAxes& from, const PlaceRange* ranges, std::size_t count, const NearBox& box,
                   SamplesNearLeaf& out) {
  std::int32_t* const x = out.at[0].data();
  std::int32_t* const y = out.at[1].data();
  std::int32_t* const z = out.at[2].data();
  std::int32_t* const places = out.places.data();
  const Ints numbers = lane_numbers();
  std::size_t n = 0;
  for (std::size_t r = 0; r < count; ++r) {
    const std::int32_t end = static_cast<std::int32_t>(ranges[r].end);
    for (std::int32_t p = static_cast<std::int32_t>(ranges[r].begin); p < end; p += static_cast<std::int32_t>(kLanes)) {
      const Ints px = load_ints(from.x + p);
      const Ints py = load_ints(from.y + p);
      const Ints pz = load_ints(from.z + p);
      const Floats dx = past_of(px, box.low[0], box.high[0]);
      const Floats dy = past_of(py, box.low[1], box.high[1]);
      const Floats dz = past_of(pz, box.low[2], box.high[2]);
      const Ints all = p + numbers;
      const Packed near(not_above(dx * dx + dy * dy + dz * dz, box.squared) & below(all, end));
      near.write(px, x + n);
      near.write(py, y + n);
      near.write(pz, z + n);
      near.write(all, places + n);
      n += near.count();
    }
    if (n > SamplesNearLeaf::kMost) return false;
  }
  out.count = n;
  return true;
}

inline void find(SamplesNearLeaf& from, const std::array<std::int32_t, 3>& at, std::int32_t place, float squared,
                 NearSamples& out) {
  const std::int32_t* const x = from.at[0].data();
  const std::int32_t* const y = from.at[1].data();
  const std::int32_t* const z = from.at[2].data();
  std::int32_t* const places = from.places.data();
  const std::size_t end = from.count;
  const Ints itself = Ints{} + place;
  __builtin_memcpy(places + end, &itself, sizeof(itself));
  std::size_t n = 0;
  for (std::size_t i = 0; i < end; i += kLanes) {
    const Floats dx = floats_of(difference(load_ints(x + i), Ints{} + at[0]));
    const Floats dy = floats_of(difference(load_ints(y + i), Ints{} + at[1]));
    const Floats dz = floats_of(difference(load_ints(z + i), Ints{} + at[2]));
    const Floats far = dx * dx + dy * dy + dz * dz;
    const Ints others = load_ints(places + i);
    const Packed near(not_above(far, squared) & ~equal(others, itself));
    near.write(far, out.squared.data() + n);
    near.write(others, out.places.data() + n);
    n += near.count();
  }
  out.count = n;
}

/// Counts of how many are nearer than each.
inline bool sort(NearSamples& near, Neighbour* sorted) {
  constexpr std::size_t kCounted = kVectorsAtOnce * kLanes;
  constexpr std::size_t kStep = 8;  // more of them, and where the last one is could not be guessed
  static_assert(kCounted <= SamplesNearLeaf::kRoom - NearSamples::kMost && kCounted <= 2 * kNearLanes);
  float* const squared = near.squared.data();
  const std::size_t count = near.count;
  const std::size_t stepped = (count + kStep - 1) / kStep * kStep;
  const Floats infinite = Floats{} + __builtin_inff();
  for (std::size_t i = 0; i < kCounted; i += kLanes) __builtin_memcpy(squared + count + i, &infinite, sizeof(infinite));
  std::int32_t ranks[SamplesNearLeaf::kRoom];
  Ints sum{};
  std::size_t counted = 0;
  for (; counted < count; counted += kCounted) {
    Floats here[kVectorsAtOnce];
    Ints nearer[kVectorsAtOnce];
    for (std::size_t v = 0; v < kVectorsAtOnce; ++v) {
      here[v] = load_floats(squared + counted + v * kLanes);
      nearer[v] = Ints{};
    }
    for (std::size_t j = 0; j < stepped; ++j) {
      const Floats one = squared[j] - Floats{};
      for (std::size_t v = 0; v < kVectorsAtOnce; ++v) count_nearer(one, here[v], nearer[v]);
    }
    for (std::size_t v = 0; v < kVectorsAtOnce; ++v) {
      __builtin_memcpy(ranks + counted + v * kLanes, &nearer[v], sizeof(Ints));
      sum += nearer[v];
    }
  }
  // All of them: which ones are among the first is as good as random. Those behind the last one come behind it.
  static_assert(sizeof(Neighbour) == sizeof(std::uint64_t) && sizeof(__m128) == 2 * sizeof(Neighbour));
  std::uint64_t pairs[SamplesNearLeaf::kRoom];
  for (std::size_t i = 0; i < stepped; i += 4) {
    const __m128 four = _mm_loadu_ps(squared + i);
    const __m128 places = _mm_castsi128_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(near.places.data() + i)));
    const __m128 low = _mm_unpacklo_ps(four, places);
    const __m128 high = _mm_unpackhi_ps(four, places);
    __builtin_memcpy(pairs + i, &low, sizeof(low));
    __builtin_memcpy(pairs + i + 2, &high, sizeof(high));
  }
  for (std::size_t i = 0; i < stepped; i += kStep) {
    for (std::size_t k = i; k < i + kStep; ++k)
      __builtin_memcpy(static_cast<void*>(sorted + ranks[k]), pairs + k, sizeof(Neighbour));
  }
  std::size_t all = 0;
  for (std::size_t i = 0; i < kLanes; ++i) all += static_cast<std::size_t>(sum[i]);
  return all - (counted - count) * count == count * (count - 1) / 2;
}
