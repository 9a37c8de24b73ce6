// Comparisons of the kernel of the search for nearest samples for processors that compare into vectors; included by
// near_kernel_v*.cpp inside a namespace of its own, behind
//   bits_of(ints)    the sign of each lane as a bit
// No include guard on purpose.

inline unsigned not_above(const Floats& v, float most) {
  return bits_of(v <= most);
}
inline unsigned below(const Ints& v, std::int32_t end) {
  return bits_of(v < end);
}
inline unsigned equal(const Ints& v, const Ints& other) {
  return bits_of(v == other);
}
inline void count_nearer(const Floats& one, const Floats& others, Ints& counts) {
  counts -= one < others;
}
