// Parts that do not belong together are named, not joined.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "chunks/chunked.h"
#include "chunks/part_file.h"

namespace lamina {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class MergeParts : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new test::TemporaryFolder;
    const test::Cloud cloud = test::torus_cloud(4000);
    SurfaceSettings s;
    s.input = test::write_cloud(cloud, *folder_ / "in.ply");
    write_store(s, *folder_ / "store", {});
    parts_ = new std::vector<std::string>(test::make_parts({}, *folder_ / "store", 4, *folder_));
  }
  static void TearDownTestSuite() {
    delete parts_;
    delete folder_;
  }
  static std::string refusal(const std::vector<std::string>& parts, ExitCode code = ExitCode::unreadable) {
    const std::string output = *folder_ / "refused.ply";
    try {
      merge_parts(parts, {output}, {});
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code);
      EXPECT_FALSE(std::filesystem::exists(output));
      return error.what();
    }
    ADD_FAILURE() << "was merged";
    return {};
  }
  static std::vector<std::string> with(std::size_t place, const std::string& other) {
    std::vector<std::string> parts = *parts_;
    parts[place] = other;
    return parts;
  }
  static const test::TemporaryFolder& folder() { return *folder_; }
  static const std::vector<std::string>& parts() { return *parts_; }

 private:
  static test::TemporaryFolder* folder_;
  static std::vector<std::string>* parts_;
};
test::TemporaryFolder* MergeParts::folder_ = nullptr;
std::vector<std::string>* MergeParts::parts_ = nullptr;

TEST_F(MergeParts, NamesTheMissing) {
  const auto& p = parts();
  EXPECT_THAT(refusal({p[0], p[1], p[3]}), AllOf(HasSubstr("chunk 3 of 4 is missing"), HasSubstr("--chunk 3/4")));
  EXPECT_THAT(refusal({p[1], p[2], p[3]}), HasSubstr("chunk 1 of 4 is missing"));
  EXPECT_THAT(refusal({p[2], p[1], p[0]}), HasSubstr("chunk 4 of 4 is missing"));
  EXPECT_THAT(refusal({}), HasSubstr("no parts"));
  EXPECT_THAT(refusal(with(2, folder() / "nowhere.lmesh")), HasSubstr("nowhere.lmesh"));
}

TEST_F(MergeParts, NamesTheDuplicate) {
  auto twice = parts();
  twice.push_back(twice[1]);
  EXPECT_THAT(refusal(twice), AllOf(HasSubstr(parts()[1]), HasSubstr("both chunk 2 of 4")));
}

TEST_F(MergeParts, NamesTheForeign) {
  SurfaceSettings other;
  other.blend = 1.3;
  const test::TemporaryFolder place;
  const auto foreign = test::make_parts(other, folder() / "store", 4, place);
  EXPECT_THAT(refusal(with(1, foreign[1])), AllOf(HasSubstr(foreign[1]), HasSubstr("another run")));
  const auto fifths = test::make_parts({}, folder() / "store", 5, place);
  EXPECT_THAT(refusal(with(1, fifths[1])), AllOf(HasSubstr(fifths[1]), HasSubstr("one of 5 chunks")));
  EXPECT_THAT(refusal(with(1, folder() / "in.ply")), AllOf(HasSubstr("in.ply"), HasSubstr("no part of a mesh")));
}

TEST_F(MergeParts, NamesTheTruncatedAndTheDamaged) {
  std::string bytes = test::read_file(parts()[2]);
  const std::string bad = folder() / "bad.lmesh";
  test::write_file(bad, bytes.substr(0, bytes.size() / 2));
  EXPECT_THAT(refusal(with(2, bad)), AllOf(HasSubstr(bad), HasSubstr("truncated")));
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  test::write_file(bad, bytes);
  EXPECT_THAT(refusal(with(2, bad)), AllOf(HasSubstr(bad), HasSubstr("is damaged")));
  bytes = test::read_file(parts()[2]);
  bytes[12] = '9';
  test::write_file(bad, bytes);
  EXPECT_THAT(refusal(with(2, bad)), AllOf(HasSubstr(bad), HasSubstr("version")));
}

/// A part of the job whose border is not what its neighbour has.
TEST_F(MergeParts, NamesThoseThatDoNotFit) {
  std::size_t at = 1;  // the first one with surface below it
  while (at + 1 < parts().size() && PartReader(parts()[at]).info().below.vertices == 0) ++at;
  const PartReader reader(parts()[at]);
  ASSERT_GT(reader.info().below.vertices, 0u);
  const std::string odd = folder() / "odd.lmesh";
  PartInfo info = reader.info();
  info.below.checksum ^= 1;
  PartWriter writer(odd, reader.info().layout());
  writer.commit(info);
  EXPECT_THAT(refusal(with(at, odd)), AllOf(HasSubstr(odd), HasSubstr(parts()[at - 1]), HasSubstr("do not agree")));
}

TEST_F(MergeParts, MadeAgainIsTheSame) {
  const std::string before = test::read_file(parts()[2]);
  const test::TemporaryFolder place;
  const auto again = test::make_parts({}, folder() / "store", 4, place);
  EXPECT_TRUE(test::read_file(again[2]) == before);
}

TEST_F(MergeParts, NoSurfaceIsNoMesh) {
  const test::TemporaryFolder place;
  const std::string path = place / "empty.lmesh";
  PartWriter writer(path, {});
  PartInfo info;
  info.span = {0, 9};
  writer.commit(info);
  EXPECT_THAT(refusal({path}, ExitCode::empty), HasSubstr("no surface"));
}

}  // namespace
}  // namespace lamina
