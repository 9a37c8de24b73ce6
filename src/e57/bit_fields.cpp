#include "e57/bit_fields.h"

#include <algorithm>

#include "base/little_endian.h"

namespace lamina::e57 {
namespace {

/// Integers of a whole number of bytes that begin at one: as many as a compiler does at once.
template <class Word, class Out, class Value>
void unpack_words(const std::byte* bytes, std::size_t count, const Value& value, Out* out) {
  for (std::size_t i = 0; i < count; ++i) out[i] = value(load_little<Word>(bytes + i * sizeof(Word)));
}

template <class Out, class Value>
void unpack_bits(const std::byte* bytes, unsigned bit, unsigned bits, std::size_t count, const Value& value, Out* out) {
  const std::uint64_t mask = bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
  std::uint64_t at = bit;
  for (std::size_t i = 0; i < count; ++i, at += bits) {
    const std::byte* const from = bytes + at / 8;
    const auto shift = static_cast<unsigned>(at % 8);
    std::uint64_t word = load_little<std::uint64_t>(from) >> shift;
    if (shift + bits > 64) word |= std::to_integer<std::uint64_t>(from[8]) << (64 - shift);
    out[i] = value(word & mask);
  }
}

template <class Out>
void unpack_integers(const Field& field, const std::byte* bytes, unsigned bit, std::size_t count, Out* out) {
  const auto minimum = static_cast<std::uint64_t>(field.minimum);
  const double scale = field.kind == Field::Kind::scaled_integer ? field.scale : 1;
  const double offset = field.kind == Field::Kind::scaled_integer ? field.offset : 0;
  const auto value = [=](std::uint64_t above) {
    return static_cast<Out>(static_cast<double>(static_cast<std::int64_t>(minimum + above)) * scale + offset);
  };
  switch (const unsigned bits = field.bits(); bit == 0 ? bits : 1) {
    case 0:
      return void(std::fill_n(out, count, value(0)));
    case 8:
      return unpack_words<std::uint8_t>(bytes, count, value, out);
    case 16:
      return unpack_words<std::uint16_t>(bytes, count, value, out);
    case 32:
      return unpack_words<std::uint32_t>(bytes, count, value, out);
    default:
      return unpack_bits(bytes, bit, bits, count, value, out);
  }
}

}  // namespace

template <class Out>
void unpack(const Field& field, const std::byte* bytes, unsigned bit, std::size_t count, Out* out) {
  const auto as_is = [](auto v) { return static_cast<Out>(v); };
  switch (field.kind) {
    case Field::Kind::single_float:
      return unpack_words<float>(bytes, count, as_is, out);
    case Field::Kind::double_float:
      return unpack_words<double>(bytes, count, as_is, out);
    case Field::Kind::integer:
    case Field::Kind::scaled_integer:
      return unpack_integers(field, bytes, bit, count, out);
    case Field::Kind::text:
      return;
  }
}

template void unpack(const Field&, const std::byte*, unsigned, std::size_t, float*);
template void unpack(const Field&, const std::byte*, unsigned, std::size_t, double*);

}  // namespace lamina::e57
