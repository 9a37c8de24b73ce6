// The documents that tell what the program takes and gives say what it does: docs/reference.md and docs/statistics.md.
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>

#include "common/stats.h"
#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using Json = nlohmann::ordered_json;
using Fields = std::set<std::string>;

TEST(Reference, IsWhatTheProgramPrints) {
  const auto printed = run_lamina({"man", "--reference"});
  ASSERT_EQ(printed.code, 0) << printed.err;
  EXPECT_TRUE(read_text(LAMINA_SOURCE_DIR "/docs/reference.md") == printed.out)
      << "docs/reference.md is out of date: lamina man --reference > docs/reference.md";
}

/// The names of everything in it: a.b of objects, a[] of lists.
void add_fields(const Json& node, const std::string& path, Fields& fields) {
  if (node.is_object() && !node.empty()) {
    const bool free_names = path.ends_with("].attributes") || path.ends_with("].metadata");
    for (const auto& [name, value] : node.items())
      add_fields(value, (path.empty() ? "" : path + ".") + (free_names ? "NAME" : name), fields);
  } else if (node.is_array()) {
    if (node.empty()) fields.insert(path + "[]");
    for (const Json& value : node) add_fields(value, path + "[]", fields);
  } else {
    fields.insert(path);
  }
}

/// Section title -> names in the first column of its table.
std::map<std::string, Fields> statistics_page() {
  std::map<std::string, Fields> page;
  std::istringstream lines(read_text(LAMINA_SOURCE_DIR "/docs/statistics.md"));
  std::string section;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("## ")) section = line.substr(3);
    if (line.starts_with("| `")) page[section].insert(line.substr(3, line.find('`', 3) - 3));
  }
  return page;
}

/// What was empty in one run is known from another.
Fields without_empty(const Fields& fields) {
  Fields kept;
  for (const std::string& field : fields) {
    const auto next = fields.upper_bound(field);
    if (next == fields.end() || !next->starts_with(field + ".")) kept.insert(field);
  }
  return kept;
}

void expect_section(const std::string& section, const Fields& written) {
  const auto page = statistics_page();
  const auto told = page.find(section);
  ASSERT_NE(told, page.end()) << "docs/statistics.md has no section '" << section << "'";
  const Fields fields = without_empty(written);
  for (const std::string& field : fields)
    EXPECT_TRUE(told->second.contains(field)) << section << ": docs/statistics.md lacks " << field;
  for (const std::string& field : told->second)
    EXPECT_TRUE(fields.contains(field)) << section << ": docs/statistics.md promises " << field;
}

Json json_of(const std::string& line) {
  const auto outcome = run_shell(line);
  EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
  return Json::parse(outcome.out, nullptr, false);
}

class Statistics : public ::testing::Test {
 protected:
  void SetUp() override {
    SampleBatch rows = sphere_rows(3000, 1);
    rows.radius.assign(rows.size(), 0.08F);
    rows.radius[7] = 0;  // left out, and said so
    PointColumns columns = sphere_columns();
    columns.radius = "radius";
    write_points(folder_ / "scan.ply", rows, columns);
    write_points(folder_ / "more.ply", sphere_rows(500, 2), sphere_columns());
    sphere_mesh(folder_ / "mesh.ply");
  }
  [[nodiscard]] Fields fields_of(const std::vector<std::string>& lines) const {
    Fields fields;
    for (const std::string& line : lines)
      add_fields(json_of("cd " + quoted(folder_.path()) + " && " + line), "", fields);
    return fields;
  }
  const TemporaryFolder folder_;
};

TEST_F(Statistics, OfSurfaceAndNormalAreDocumented) {
  const Fields normal = fields_of({"lamina normal more.ply --check --stats - -q"});
  expect_section("lamina normal --stats", normal);
  Fields surface =
      fields_of({"lamina surface scan.ply more.ply -o out.ply -o out.glb --clip -2,-2,-2,2,2,0.3 --normals estimate "
                 "--local --prune 5 "
                 "--vdb out.vdb --tiles out_tiles --ratio 0.5 --stats - -q",
                 "lamina sort scan.ply --store scan.store -q && lamina surface scan.store --chunk 1/2 -o out.lmesh "
                 "--stats - -q"});
  add_fields({{"ranks", ranks_json({RankStats{}})}}, "", surface);
  std::erase_if(surface, [](const std::string& field) { return field.starts_with("normals."); });
  surface.insert("normals");  // the page refers to the other section
  expect_section("lamina surface --stats", surface);
}

TEST_F(Statistics, OfTheOtherToolsAreDocumented) {
  expect_section("lamina surface --print-tasks --json",
                 fields_of({"lamina surface scan.store -o out.ply --print-tasks 2 --json"}));
  expect_section("lamina check --json", fields_of({"lamina check mesh.ply --json"}));
  expect_section("lamina compare --json", fields_of({"lamina compare mesh.ply mesh.ply --count 100 --json"}));
  expect_section("lamina measure --json", fields_of({"lamina measure mesh.ply --json"}));
  expect_section("lamina info --json",
                 fields_of({"lamina info scan.ply --json", "lamina info mesh.ply --json",
                            "lamina convert mesh.ply -o mesh.vdb -q && lamina info mesh.vdb --json",
                            "lamina convert more.ply -o more.vdb -q && lamina info more.vdb --json"}));
}

}  // namespace
}  // namespace lamina::tools
