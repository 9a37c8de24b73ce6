// Text clouds: columns told, named and guessed; separators; counts; what is refused and why.
#include "points/formats.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/temporary_folder.h"
#include "points/point_rows.h"

namespace lamina {
namespace {

using test::all_rows;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class TextPoints : public ::testing::Test {
 protected:
  std::unique_ptr<PointSource> open(const std::string& text, const std::string& columns = {}) const {
    return open_points(test::write_file(folder_ / "cloud.txt", text), PointSettings{{}, columns});
  }
  std::string refusal(const std::string& text, const std::string& columns = {}) const {
    return test::refusal(test::write_file(folder_ / "cloud.txt", text), PointSettings{{}, columns});
  }
  test::TemporaryFolder folder_;
};

TEST_F(TextPoints, PositionsAloneInAnyDress) {
  for (const char* text : {"1 2 3\n4 5 6\n", "1 2 3\r\n4 5 6", "1\t2\t3\r4\t5\t6\r", "1,2,3\n4,5,6\n",
                           "1, 2, 3\n4,5 ,6\n", "1;2;3\n4; 5;6\n", "# x\n\n1 2 3\n// y\n4 5 6\n#",
                           "\xEF\xBB\xBF"
                           "1 2 3\n4 5 6\n",
                           "\xEF\xBB\xBF"
                           "2\n1 2 3\n4 5 6\n",
                           "1,2,3,\n4,5,6,\n", "x,y,z\n1,2,3,\n4,5,6,\n", "x,y,z,\n1,2,3\n4,5,6\n",
                           "\"1\",\"2\",\"3\"\n\"4\", \" 5 \" ,6\n", "\"1\" \"2\" \"3\"\n4 5 6", "1D0 2 3\n4 .5D+1 6\n",
                           "2\n1 2 3\n4 5 6\n", "+1 2e0 3.\n 4 5 6 \n"}) {
    const auto source = open(text);
    EXPECT_EQ(source->info().count, 2) << text;
    EXPECT_TRUE(source->info().random_access);
    EXPECT_THAT(source->info().remarks, IsEmpty());
    const SampleBatch rows = all_rows(*source);
    EXPECT_THAT(rows.x, ElementsAre(1, 4)) << text;
    EXPECT_THAT(rows.y, ElementsAre(2, 5)) << text;
    EXPECT_THAT(rows.z, ElementsAre(3, 6)) << text;
  }
}

TEST_F(TextPoints, AHeaderLineNamesColumns) {
  for (const char* text : {"//X Y Z R G B Nx Ny Nz I\n1 2 3 10 20 30 0 0 1 5\n",
                           "x,y,z,red,green,blue,normal_x,normal_y,normal_z,intensity\n1,2,3,10,20,30,0,0,1,5",
                           "# made by\n# x y z r g b nx ny nz i\n1 2 3 10 20 30 0 0 1 5\n",
                           "\"X\";\"Y\";\"Z\";\"Red\";\"Green\";\"Blue\";\"NormalX\";\"NormalY\";\"NormalZ\";"
                           "\"Intensity\"\n1;2;3;10;20;30;0;0;1;5\n"}) {
    const auto source = open(text);
    EXPECT_THAT(test::attribute_names(source->info()), ElementsAre("red", "green", "blue", "intensity")) << text;
    EXPECT_EQ(source->info().attributes[0].type, ScalarType::uint8);
    EXPECT_TRUE(source->info().has_normals);
    const SampleBatch rows = all_rows(*source);
    EXPECT_THAT(rows.nz, ElementsAre(1));
    EXPECT_THAT(rows.attributes[2], ElementsAre(30));
    EXPECT_THAT(rows.attributes[3], ElementsAre(5));
  }
  EXPECT_THAT(refusal("x y z a\n1 2 3\n"), HasSubstr("4 columns are named in its header line, the rows have 3"));
}

TEST_F(TextPoints, NamesMayBeOfMoreWordsBetweenTabs) {
  const auto source = open("//X\tY\tZ\tScalar field\tNx\tNy\tNz\n1\t2\t3\t7\t0\t0\t1\n");
  EXPECT_THAT(test::attribute_names(source->info()), ElementsAre("scalar_field"));
  EXPECT_THAT(all_rows(*source).nz, ElementsAre(1));
}

TEST_F(TextPoints, PositionsMayHaveNamesOfOtherTrades) {
  for (const char* names : {"id,Easting,Northing,Elevation,Nx,Ny,Nz", "ptnum,P.x,P.y,P.z,N.x,N.y,N.z",
                            ",\"Points:0\",\"Points:1\",\"Points:2\",\"Normals:0\",\"Normals:1\",\"Normals:2\""}) {
    const auto source = open(fmt::format("{}\n7,1,2,3,0,0,1\n", names));
    const SampleBatch rows = all_rows(*source);
    EXPECT_THAT(rows.z, ElementsAre(3)) << names;
    EXPECT_THAT(rows.nz, ElementsAre(1)) << names;
    // The column without a name, as tables of data frames begin with, is left out without a word.
    EXPECT_EQ(source->info().attributes.size(), names[0] == ',' ? 0 : 1);
    EXPECT_THAT(source->info().remarks, IsEmpty());
  }
  // Beside x, y and z they are attributes.
  EXPECT_THAT(test::attribute_names(open("x y z elevation\n1 2 3 4\n")->info()), ElementsAre("elevation"));
}

TEST_F(TextPoints, WordsAndEmptyPlacesAreLeftOutAndSaidSo) {
  const auto source = open("name,x,y,z,class,i,note\nP1,1,2,3,my class,5,\n\"P2, new\",4,5,6,\"a; b\",6,\n");
  EXPECT_THAT(test::attribute_names(source->info()), ElementsAre("intensity"));
  const SampleBatch rows = all_rows(*source);
  EXPECT_THAT(rows.x, ElementsAre(1, 4));
  EXPECT_THAT(rows.attributes[0], ElementsAre(5, 6));
  ASSERT_EQ(source->info().remarks.size(), 3);
  EXPECT_THAT(source->info().remarks[0], HasSubstr("column 'name' is left out"));
  EXPECT_THAT(source->info().remarks[1], HasSubstr("column 'class' is left out"));
  EXPECT_THAT(source->info().remarks[2], HasSubstr("column 'note' is left out"));
}

TEST_F(TextPoints, TheUserKnowsBest) {
  const auto source = open("x y z a b c d\nP1 1 2 3 9 1 0\nP2 4 5 6 8 0 1\n", "-,x,y,z,radius,red:ushort,label:int");
  const SampleBatch rows = all_rows(*source);
  EXPECT_THAT(rows.z, ElementsAre(3, 6));
  EXPECT_THAT(rows.radius, ElementsAre(9, 8));
  EXPECT_EQ(source->info().attributes, (AttributeLayout{{"red", ScalarType::uint16}, {"label", ScalarType::int32}}));
  EXPECT_THAT(rows.exact[1], ElementsAre(0, 1));
  EXPECT_THAT(refusal("1 2 3\n", "x,y"), HasSubstr("no z"));
  EXPECT_THAT(refusal("1 2 3\n", "x,y,z:wide"), HasSubstr("'wide' is no type"));
  EXPECT_THAT(refusal("1 2 3\n", "x,y,z,a"), HasSubstr("4 columns are named, the rows have 3"));
  EXPECT_THAT(refusal("1 2 3 4\n", "x,y,z,x"), HasSubstr("'x' of the points is there twice"));
  EXPECT_THAT(refusal("1 2 3 4 5\n", "x,y,z,nx,ny"), HasSubstr("normals are incomplete"));
}

/// `n` rows of the given columns: p position, n unit normal, c colours 0-255, f colours 0-1, i an integer, s a scalar.
std::string random_rows(const std::string& columns, int n, std::mt19937& random) {
  std::string text;
  std::normal_distribution<> normal(0, 10);
  std::uniform_real_distribution<> unit(0, 1);
  for (int row = 0; row < n; ++row) {
    for (const char kind : columns) {
      double v[3] = {normal(random), normal(random), normal(random)};
      const double length = std::hypot(v[0], v[1], v[2]);
      if (kind == 'p') text += fmt::format("{:.6f} {:.6f} {:.6f} ", v[0], v[1], v[2]);
      if (kind == 'n') text += fmt::format("{:.5f} {:.5f} {:.5f} ", v[0] / length, v[1] / length, v[2] / length);
      if (kind == 'c') text += fmt::format("{} {} {} ", random() % 256, random() % 256, random() % 256);
      if (kind == 'w') text += fmt::format("{} {} {} ", random() % 65536, random() % 65536, random() % 65536);
      if (kind == 'f') text += fmt::format("{:.4f} {:.4f} {:.4f} ", unit(random), unit(random), unit(random));
      if (kind == 'i') text += fmt::format("{} ", static_cast<int>(random() % 4096) - 2048);
      if (kind == 's') text += fmt::format("{:.3f} ", v[0]);
    }
    text.back() = '\n';
  }
  return text;
}

TEST_F(TextPoints, GuessesWhatUnnamedColumnsAreAndSaysSo) {
  struct Case {
    const char* columns;
    const char* taken;
  };
  const Case cases[] = {{"pn", "x,y,z,nx,ny,nz"},
                        {"pc", "x,y,z,red:uchar,green:uchar,blue:uchar"},
                        {"pw", "x,y,z,red:ushort,green:ushort,blue:ushort"},
                        {"pf", "x,y,z,red:float,green:float,blue:float"},
                        {"pi", "x,y,z,intensity"},
                        {"pss", "x,y,z,intensity,value1"},
                        {"pic", "x,y,z,intensity,red:uchar,green:uchar,blue:uchar"},
                        {"pci", "x,y,z,red:uchar,green:uchar,blue:uchar,intensity"},
                        {"pcn", "x,y,z,red:uchar,green:uchar,blue:uchar,nx,ny,nz"},
                        {"pnc", "x,y,z,nx,ny,nz,red:uchar,green:uchar,blue:uchar"},
                        {"picn", "x,y,z,intensity,red:uchar,green:uchar,blue:uchar,nx,ny,nz"}};
  std::mt19937 random(5);
  for (const Case& c : cases) {
    const auto source = open(random_rows(c.columns, 300, random));
    EXPECT_EQ(source->info().count, 300);
    ASSERT_EQ(source->info().remarks.size(), 1) << c.columns;
    EXPECT_THAT(source->info().remarks[0], HasSubstr(fmt::format("taken as {};", c.taken))) << c.columns;
  }
  // Leica's intensity may itself look like a colour.
  std::string pts = "300\n";
  for (int i = 0; i < 300; ++i) pts += fmt::format("{} 2 3 {} {} 7 9\n", i, i % 250, i % 100);
  EXPECT_THAT(open(pts)->info().remarks[0], HasSubstr("taken as x,y,z,intensity,red:uchar"));
}

TEST_F(TextPoints, APointsNumberIsNotItsX) {
  const auto source = open("7 431001.7 5213003.7 303.5\n8 430999.4 5213003.1 303.25\n9 430999.8 5213003.3 303.8\n");
  EXPECT_THAT(all_rows(*source).x, ElementsAre(431001.7, 430999.4, 430999.8));
  EXPECT_THAT(all_rows(*source).z, ElementsAre(303.5, 303.25, 303.8));
  EXPECT_THAT(source->info().attributes, IsEmpty());
  EXPECT_THAT(source->info().remarks, ElementsAre(HasSubstr("taken as -,x,y,z")));
  // Whole numbers all over may be a raster.
  EXPECT_THAT(all_rows(*open("1 5 6 7\n2 5 6 7\n3 5 6 7\n")).x, ElementsAre(1, 2, 3));
  EXPECT_THAT(all_rows(*open("1 5.5 6.5 7.5\n2 5.5 6.5 7.5\n4 5.5 6.5 7.5\n")).x, ElementsAre(1, 2, 4));
}

TEST_F(TextPoints, EndingsTellWhatNumbersDoNot) {
  const auto open_as = [&](const char* name, const std::string& text) {
    return open_points(test::write_file(folder_ / name, text), PointSettings{});
  };
  EXPECT_TRUE(open_as("cloud.xyzn", "1 2 3 0 0 2.5\n1 2 4 0 2 2\n")->info().has_normals);
  const auto black = open_as("cloud.XYZRGB", "1 2 3 0 0 0\n1 2 4 0 0 0\n");
  ASSERT_EQ(black->info().attributes.size(), 3U);
  EXPECT_EQ(black->info().attributes[0].name, "red");
}

TEST_F(TextPoints, HeadersThatNobodyKnowsAreReplacedByTheUsers) {
  const std::string text = "east side up amp\n1 2 3 4\n5 6 7 8\n";
  EXPECT_THAT(refusal(text), AllOf(HasSubstr("line 1"), HasSubstr("--columns x,y,z")));
  const auto source = open(text, "x,y,z,amp");
  EXPECT_THAT(all_rows(*source).x, ElementsAre(1, 5));
  EXPECT_THAT(all_rows(*source).attributes[0], ElementsAre(4, 8));
  EXPECT_THAT(all_rows(*open("Station1 1 2 3\nStation2 4 5 6\n", "-,x,y,z")).x, ElementsAre(1, 4));
  EXPECT_THAT(refusal("east side up amp\nin metres each -\n1 2 3 4\n", "x,y,z,amp"), HasSubstr("line 2"));
}

TEST_F(TextPoints, HeadersMayTellUnitsAndPlacesInArrays) {
  for (const char* text : {"X[m],Y[m],Z[m],RGB:0,RGB:1,RGB:2\n1,2,3,10,20,30\n",
                           "X (m),Y (m),Z (m),R,G,B\n1,2,3,10,20,30\n", "P[x],P[y],P[z],r,g,b\n1,2,3,10,20,30\n"}) {
    const auto source = open(text);
    EXPECT_THAT(all_rows(*source).z, ElementsAre(3)) << text;
    ASSERT_EQ(source->info().attributes.size(), 3U) << text;
    EXPECT_EQ(source->info().attributes[2], (AttributeSpec{"blue", ScalarType::uint8})) << text;
  }
}

TEST_F(TextPoints, ASecondColumnOfANameIsLeftOutAndSaidSo) {
  const auto source = open("//X Y Z Nx Ny Nz Dip Nx Ny Nz\n1 2 3 0 0 1 0 0.5 0.5 0.5\n");
  EXPECT_THAT(all_rows(*source).nz, ElementsAre(1));
  EXPECT_EQ(source->info().remarks.size(), 3U);
  EXPECT_THAT(source->info().remarks[0], HasSubstr("second column 'nx'"));
  EXPECT_THAT(refusal("1 2 3 4 5\n", "x,y,z,a,a"), HasSubstr("there twice"));
}

TEST_F(TextPoints, AttributesOfManyDigitsAreDoubles) {
  const auto source = open("x,y,z,gps_time,amplitude\n1,2,3,312345678.123456,0.123456789\n");
  EXPECT_EQ(source->info().attributes[0].type, ScalarType::float64);
  EXPECT_EQ(source->info().attributes[1].type, ScalarType::float32);
  EXPECT_THAT(all_rows(*source).exact[0], ElementsAre(312345678.123456));
}

TEST_F(TextPoints, AColourUnlikeThoseBeforeIsAnErrorNotAWrongPicture) {
  std::string text;
  for (int i = 0; i < 60'000; ++i) text += fmt::format("1 2 3 {} 5 6\n", i == 20'000 ? 256 : 50);
  EXPECT_THAT(refusal(text), HasSubstr("line 20001: 'red' is '256', outside 0 to 255"));
  EXPECT_EQ(refusal(text, "x,y,z,red:ushort,green:ushort,blue:ushort"), "");
}

TEST_F(TextPoints, CountedBlocksAreScansBehindEachOther) {
  const auto source = open("2\n1 2 3\n4 5 6\n0\n1\n7 8 9\n");
  EXPECT_THAT(all_rows(*source, 2).x, ElementsAre(1, 4, 7));
  EXPECT_THAT(refusal("3\n1 2 3\n4 5 6\n"), HasSubstr("1 more rows promised when it ends at line 3"));
  EXPECT_THAT(refusal("1\n1 2 3\n4 5 6\n"), HasSubstr("line 3: the number of rows of the next scan expected"));
  EXPECT_THAT(refusal("99999999999999999999999\n1 2 3\n"), HasSubstr("line 1: the number of rows"));
  EXPECT_THAT(refusal("18446744073709551615\n1 2 3\n"), HasSubstr("more rows promised"));
}

TEST_F(TextPoints, RefusalsNameTheLineAndTheRemedy) {
  EXPECT_THAT(refusal("1,5;2,5;3,5\n"), HasSubstr("line 1: the commas look like decimal commas"));
  EXPECT_THAT(refusal("1,5 2,5 3,5\n"), HasSubstr("decimal commas"));
  EXPECT_THAT(refusal("1 2 3\n4 5\n"), HasSubstr("line 2: 2 values, but 3 on line 1"));
  EXPECT_THAT(refusal("# a\n\nhello, world\n"), HasSubstr("line 3: 'hello, world' is no row of numbers"));
  EXPECT_THAT(refusal("Longitude,Latitude,Height\n-80.1,43.2,300\n"),
              HasSubstr("line 1: longitude and latitude are deg"));
  EXPECT_THAT(refusal("1 2 3\n4 five 6\n"), HasSubstr("line 2: 'five' is no number ('y' expected)"));
  EXPECT_THAT(refusal("1,2,3\n4,,6\n"), HasSubstr("line 2: '' is no number ('y' expected)"));
  EXPECT_THAT(refusal("1,2,3\n4,\"5,6\n"), HasSubstr("line 2: 2 values, but 3 on line 1"));
  EXPECT_THAT(refusal("x,y,z,i\n1,2,3,4\n4,5,6,\n", "x,y,z,i"), HasSubstr("line 3: 4 values expected, only 3"));
  std::string late;
  for (int i = 0; i < 5000; ++i) late += i == 4321 ? "1 2 3 4\n" : "1 2 3\n";
  EXPECT_THAT(refusal(late), HasSubstr("line 4322: 3 values expected, more stand there, from '4' on"));
}

TEST_F(TextPoints, KeepsAllDigitsAndSaysThatTheyMatter) {
  const auto source = open("4512345.123456789 -5412345.25 78.5\n1 2 3\n");
  EXPECT_TRUE(source->info().double_precision);
  EXPECT_EQ(all_rows(*source).x[0], 4512345.123456789);
  EXPECT_FALSE(open("0.125 2 3\n")->info().double_precision);
}

TEST_F(TextPoints, AnyRowCanBeReadFirst) {
  std::mt19937 random(11);
  const std::string text = "# head\n" + random_rows("pn", 20'000, random);
  const auto source = open(text);
  const SampleBatch rows = all_rows(*source, 999);
  ASSERT_EQ(rows.size(), 20'000);
  SampleBatch batch;
  for (int i = 0; i < 30; ++i) {
    const std::uint64_t first = random() % 20'000;
    source->read(first, random() % 3000, batch);
    for (std::size_t k = 0; k < batch.size(); ++k) {
      ASSERT_EQ(batch.x[k], rows.x[first + k]);
      ASSERT_EQ(batch.nz[k], rows.nz[first + k]);
    }
  }
  source->read(20'000, 5, batch);
  EXPECT_EQ(batch.size(), 0);
}

}  // namespace
}  // namespace lamina
