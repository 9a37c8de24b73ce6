#include "points/ply_header.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <sstream>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "lamina/points.h"

namespace lamina {
namespace {

using testing::HasSubstr;

std::string refused_header(const std::string& text) {
  try {
    parse_ply_header(text, "a.ply");
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::unreadable);
    return e.what();
  }
  return "nothing";
}

TEST(PlyHeader, IsRead) {
  const std::string text =
      "ply\r\nformat   binary_big_endian\t1.0 \r\ncomment element x\r\nobj_info y\r\n\r\nelement vertex 12\r\n"
      "property float32 x\r\nproperty uint8 red\r\nelement face 3\r\nproperty list uchar int "
      "vertex_indices\r\nend_header\r\n";
  const PlyHeader header = parse_ply_header(text + "\nmore", "a.ply");
  EXPECT_EQ(header.format, PlyFormat::big_endian);
  EXPECT_EQ(header.bytes, text.size());
  EXPECT_EQ(header.lines, 11);
  EXPECT_EQ(header.line_end, '\n');
  ASSERT_EQ(header.elements.size(), 2);
  EXPECT_EQ(header.elements[0].name, "vertex");
  EXPECT_EQ(header.elements[0].count, 12);
  EXPECT_EQ(header.elements[0].properties[1].name, "red");
  EXPECT_EQ(header.elements[0].properties[1].type, ScalarType::uint8);
  EXPECT_EQ(header.elements[0].row_bytes(), 5);
  EXPECT_FALSE(header.elements[0].has_list());
  EXPECT_TRUE(header.elements[1].has_list());
  EXPECT_EQ(header.elements[1].properties[0].list_count, ScalarType::uint8);
  EXPECT_EQ(header.elements[1].properties[0].type, ScalarType::int32);
}

TEST(PlyHeader, LinesMayEndInCarriageReturnAlone) {
  const std::string text = "ply\rformat binary_little_endian 1.0\relement vertex 1\rproperty uchar x\rend_header\r";
  const PlyHeader header = parse_ply_header(text + "\n", "a.ply");  // the data's first byte looks like a line feed
  EXPECT_EQ(header.bytes, text.size());
  EXPECT_EQ(header.line_end, '\r');
}

TEST(PlyHeader, OfAStreamLeavesTheDataThere) {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    std::string text;
    for (const char* line : {"ply", "comment end_header", "format ascii 1.0", " end_header "}) text += line + end;
    std::stringbuf stream(text + "1 end_header" + end);
    EXPECT_EQ(read_ply_header(stream, "a.ply").lines, 4);
    EXPECT_EQ(stream.sbumpc(), '1');
  }
}

TEST(PlyHeader, ErrorsNameFileAndLine) {
  const std::string start = "ply\nformat ascii 1.0\n";
  EXPECT_THAT(refused_header("ply\nformat utf8 1.0\n"), HasSubstr("a.ply, line 2: format 'utf8' is not supported"));
  EXPECT_THAT(refused_header("ply\nformat ascii 2.0\n"), HasSubstr("a.ply, line 2: PLY version '2.0'"));
  EXPECT_THAT(refused_header("ply\nformat ascii\n"), HasSubstr("a version expected"));
  EXPECT_THAT(refused_header(start + start.substr(4)), HasSubstr("a.ply, line 3: a second format line"));
  EXPECT_THAT(refused_header(start + "element vertex 1\nproperty float x\nelement vertex 2\n"),
              HasSubstr("a.ply, line 5: element 'vertex' is there already"));
  EXPECT_THAT(refused_header("ply\nelement vertex 0\nend_header\n"),
              HasSubstr("a.ply, line 3: the header ends without a format"));
  EXPECT_THAT(refused_header(start + "element vertex -1\n"),
              HasSubstr("a.ply, line 3: the count of element 'vertex' is '-1'"));
  EXPECT_THAT(refused_header(start + "element vertex 99999999999999999999\n"), HasSubstr("a whole number expected"));
  EXPECT_THAT(refused_header(start + "element vertex 10 20\n"), HasSubstr("'20' is too much here"));
  EXPECT_THAT(refused_header(start + "element vertex\n"), HasSubstr("a count expected, the line ends"));
  EXPECT_THAT(refused_header(start + "property float x\n"), HasSubstr("a property before the first element"));
  EXPECT_THAT(refused_header(start + "element v 1\nproperty half x\n"),
              HasSubstr("a.ply, line 4: 'half' is no PLY type"));
  EXPECT_THAT(refused_header(start + "element v 1\nproperty list float int x\n"), HasSubstr("of an integer type"));
  EXPECT_THAT(refused_header(start + "elements\n"), HasSubstr("'elements' is no keyword"));
  EXPECT_THAT(refused_header(start + std::string(300, '\x01') + "\n"),
              HasSubstr("'????????????????????????????????????????...'"));
  EXPECT_THAT(refused_header(start + "element vertex 0\nend_header"), HasSubstr("no end_header"));
}

TEST(PlyHeader, EndIsSoughtInTheFirstMegabyteOnly) {
  const test::TemporaryFolder folder;
  std::string text = "ply\nformat ascii 1.0\n";
  while (text.size() < 3u << 20) text += "comment a long story\n";
  const std::string path = test::write_file(folder / "long.ply", text + "element vertex 0\nend_header\n");
  try {
    open_points(path);
    FAIL();
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("long.ply: no end_header in the first 1048576 bytes"));
  }
}

// Other readers hold so many bytes of a line.
RC_GTEST_PROP(PlyHeader, KeepsALongCrsInShortLines, ()) {
  const auto word = rc::gen::container<std::string>(rc::gen::element<char>('a', ',', '"', '[', '+'));
  const auto words = *rc::gen::container<std::vector<std::string>>(*rc::gen::inRange(1, 120), rc::gen::nonEmpty(word));
  std::string crs;
  for (const std::string& w : words) crs += (crs.empty() ? "" : " ") + w + "\u00e9";
  const std::string comment = ply_comment("crs " + crs);
  for (std::size_t at = 0; at < comment.size();) {
    const std::size_t end = comment.find('\n', at);
    RC_ASSERT(end != std::string::npos && end - at <= 256);
    RC_ASSERT(comment.substr(at, 8) == "comment ");
    at = end + 1;
  }
  RC_ASSERT(parse_ply_header("ply\nformat ascii 1.0\n" + comment + "comment -\ncomment + x\nend_header\n", "a").crs ==
            crs);
  RC_ASSERT(parse_ply_header("ply\nformat ascii 1.0\ncomment + x\nend_header\n", "a").crs.empty());
}

}  // namespace
}  // namespace lamina
