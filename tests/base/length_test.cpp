#include "lamina/length.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>

#include "lamina/error.h"

namespace lamina {
namespace {

TEST(Length, ReadsTheThreeUnits) {
  EXPECT_EQ(parse_length("0.01"), (Length{0.01, Length::Unit::world}));
  EXPECT_EQ(parse_length("0.6r"), (Length{0.6, Length::Unit::sample_radius}));
  EXPECT_EQ(parse_length("1e-3R"), (Length{1e-3, Length::Unit::influence_radius}));
  EXPECT_EQ(parse_length("0"), (Length{0, Length::Unit::world}));
}

TEST(Length, RefusesWhatIsNoLength) {
  for (const char* text :
       {"", "r", "R", "-1", "-0", "1 r", "1rr", "1m", "nan", "inf", "1e999", "0,5", "+1", " 1", "1 "}) {
    try {
      parse_length(text);
      ADD_FAILURE() << "accepted '" << text << "'";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ExitCode::usage);
      EXPECT_NE(std::string(e.what()).find("0.6r"), std::string::npos) << e.what();
    }
  }
}

TEST(Length, ResolvesAgainstRadiusAndBlend) {
  EXPECT_DOUBLE_EQ(resolve(parse_length("0.25"), 2, 3), 0.25);
  EXPECT_DOUBLE_EQ(resolve(parse_length("0.25r"), 2, 3), 0.5);
  EXPECT_DOUBLE_EQ(resolve(parse_length("0.25R"), 2, 3), 1.5);
}

TEST(Length, TextRoundTrips) {
  EXPECT_TRUE(rc::check("parse_length(to_string(l)) == l", [](double value, int unit) {
    RC_PRE(std::isfinite(value));
    const Length length{std::abs(value), static_cast<Length::Unit>(std::abs(unit % 3))};
    RC_ASSERT(parse_length(to_string(length)) == length);
  }));
}

}  // namespace
}  // namespace lamina
