#include "base/number.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

namespace lamina {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The value, and through `rest` what was not taken.
double parsed(std::string_view text, std::string& rest) {
  double value = -12345;
  const char* stop = parse_number(text.data(), text.data() + text.size(), value);
  rest = stop == nullptr ? "nothing taken" : std::string(stop, text.data() + text.size());
  return value;
}

TEST(Number, IsWhatPeopleAndProgramsWrite) {
  struct Case {
    const char* text;
    double value;
    const char* rest = "";
  };
  for (const Case& c : {Case{"1", 1},
                        {"-2.5e3", -2500},
                        {"+.5", 0.5},
                        {"3.", 3},
                        {"1e400", kInfinity},
                        {"-1e400", -kInfinity},
                        {"1e-400", 0},
                        {"inf", kInfinity},
                        {"7,8", 7, ",8"},
                        {"1.5D+02", 150},
                        {"-1.5d2", -150},
                        {"2D-1 3", 0.2, " 3"},
                        {"1.#INF", kInfinity},
                        {"-1.#INF00 4", -kInfinity, " 4"},
                        {"4#note", 4, "#note"},
                        {"3d", 3, "d"},
                        {"3D+", 3, "D+"},
                        {"1e5d3", 1e5, "d3"},
                        {"2.#x", 2, "#x"}}) {
    std::string rest;
    EXPECT_EQ(parsed(c.text, rest), c.value) << c.text;
    EXPECT_EQ(rest, c.rest) << c.text;
  }
}

TEST(Number, NoNumberIsOneAsWell) {
  for (const char* text :
       {"nan", "NaN", "-nan", "nan(ind)", "-nan(ind)", "1.#QNAN", "1.#QNAN0", "-1.#IND", "-1.#IND00", "1.#SNAN"}) {
    std::string rest;
    EXPECT_TRUE(std::isnan(parsed(text, rest))) << text;
    EXPECT_EQ(rest, "") << text;
  }
}

TEST(Number, WordsAreNone) {
  for (const char* text : {"", "x1", "+-1", "-", ".", "#1"}) {
    std::string rest;
    parsed(text, rest);
    EXPECT_EQ(rest, "nothing taken") << text;
  }
}

TEST(Number, LongFortranNumbersEndBeforeTheExponent) {
  std::string rest;
  EXPECT_EQ(parsed("1." + std::string(80, '0') + "D+02", rest), 1);
  EXPECT_EQ(rest, "D+02");  // no number for whoever reads it, instead of another one
}

TEST(Number, DecimalsAreOfTheOrdinaryKindOnly) {
  const auto left = [](std::string_view text) {
    const std::optional<double> value = take_decimal(text);
    return value ? fmt::format("{}|{}", *value, text) : "none|" + std::string(text);
  };
  EXPECT_EQ(left(" \t+1.5e1 2"), "15| 2");
  EXPECT_EQ(left("1.5D+02"), "1.5|D+02");
  EXPECT_EQ(left("-1e400"), "-inf|");
  EXPECT_EQ(left("1e-400 "), "0| ");
  EXPECT_EQ(left("x"), "none|x");
  EXPECT_EQ(left("  "), "none|");
}

TEST(Number, WordsAreNumbersAsAWhole) {
  EXPECT_TRUE(is_number("1.5D+02"));
  for (const char* word : {"", "1 ", "1x", "x"}) EXPECT_FALSE(is_number(word)) << word;
  EXPECT_EQ(parse_whole("18446744073709551615"), std::uint64_t{18446744073709551615U});
  for (const char* word : {"", "-1", "+1", "1.0", "18446744073709551616"}) {
    EXPECT_EQ(parse_whole(word), std::nullopt) << word;
  }
  EXPECT_EQ(trimmed("\t a b \r"), "a b");
  EXPECT_EQ(trimmed(" \t"), "");
}

}  // namespace
}  // namespace lamina
