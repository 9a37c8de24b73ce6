#include "points/number.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
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

}  // namespace
}  // namespace lamina
