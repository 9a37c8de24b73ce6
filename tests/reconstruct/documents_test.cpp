// What the documents say of the code holds: the table of tuned constants in docs/method.md, both ways, and the sources
// that pages name.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <utility>

#include "support/paths.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

fs::path in_sources(const std::string& path) {
  return fs::path(LAMINA_SOURCE_DIR) / (path.starts_with("lamina/") ? "include" : "src") / path;
}

/// Source and name, as in "mls/project.h" and "band".
using Name = std::pair<std::string, std::string>;

/// Rows `| `file` `name` | value | ...` of the section on constants.
std::map<Name, double> documented() {
  std::string page = text_of(fs::path(LAMINA_SOURCE_DIR) / "docs/method.md");
  page.erase(0, page.find("\n## Constants"));
  std::map<Name, double> rows;
  const std::regex row(R"(\n\| `([\w/]+\.\w+)` `(\w+)` \| (-?[0-9.e-]+) \|)");
  for (std::sregex_iterator i(page.begin(), page.end(), row), end; i != end; ++i)
    rows[{(*i)[1], (*i)[2]}] = std::strtod((*i)[3].str().c_str(), nullptr);
  return rows;
}

/// Constants of floating point, or of whole numbers, that a source defines by a plain number (products of such
/// included).
std::map<std::string, double> defined_in(const std::string& source) {
  std::map<std::string, double> found;
  const std::string text = text_of(source);
  const std::regex definition(
      R"((?:float|double|std::optional<double>|int|std::int32_t|std::uint32_t|std::uint64_t|std::size_t) (\w+) = (-?[0-9.e-]+)F?U?(?: \* ([0-9.]+)F?)?[;,])");
  for (std::sregex_iterator i(text.begin(), text.end(), definition), end; i != end; ++i) {
    const double factor = (*i)[3].matched ? std::strtod((*i)[3].str().c_str(), nullptr) : 1;
    found[(*i)[1]] = factor * std::strtod((*i)[2].str().c_str(), nullptr);
  }
  return found;
}

TEST(Constants, TheTableSaysWhatTheCodeHas) {
  const auto rows = documented();
  ASSERT_GE(rows.size(), 25u);
  for (const auto& [name, value] : rows) {
    const auto found = defined_in(in_sources(name.first));
    const auto at = found.find(name.second);
    if (at == found.end()) {
      ADD_FAILURE() << name.first << " defines no " << name.second;
    } else {
      EXPECT_NEAR(at->second, value, 1e-6 * std::abs(value)) << name.first << ": " << name.second;
    }
  }
}

// What is tuned is a number with a fraction; of these none is missing from the table.
TEST(Constants, TheTableHasAllOfTheCore) {
  const auto rows = documented();
  // Definitions, powers of two, what is only told or changes the time alone, and the cost model, whose coefficients are
  // in docs/performance.md.
  const std::set<std::string> not_tuned{
      "kLow",          "kMedianDeviation", "kPositive",         "kPlaces",       "kEfficiency",    "kVerticesPerFace",
      "kAllButATenth", "kMuchNoisier",     "kMedianOfRayleigh", "kGuessedReach", "kGatheredReach", "kLeafReach"};
  const std::regex fraction(R"(constexpr (?:float|double) (\w+) = -?[0-9]*\.[0-9]+F?)");
  for (const char* room : {"octree", "mls", "isosurface", "boundary", "clustering", "samples", "reconstruct"}) {
    for (const auto& entry : fs::directory_iterator(in_sources(room))) {
      const std::string text = text_of(entry.path());
      const std::string source = std::string(room) + "/" + entry.path().filename().string();
      if (source == "reconstruct/cost.cpp") continue;
      for (std::sregex_iterator i(text.begin(), text.end(), fraction), end; i != end; ++i)
        EXPECT_TRUE(not_tuned.contains((*i)[1]) || rows.contains({source, (*i)[1]}))
            << source << ": " << (*i)[1] << " is not in docs/method.md";
    }
  }
}

TEST(Documents, NameSourcesThatExist) {
  const fs::path root = LAMINA_SOURCE_DIR;
  const std::regex source(R"(`((?:src|include|tests|houdini_like_tools)/[\w/]+\.\w+)`)");
  for (const auto& entry : fs::directory_iterator(root / "docs")) {
    if (entry.path().extension() != ".md") continue;
    const std::string page = text_of(entry.path());
    for (std::sregex_iterator i(page.begin(), page.end(), source), end; i != end; ++i)
      EXPECT_TRUE(fs::exists(root / (*i)[1].str())) << entry.path().filename() << " names " << (*i)[1];
  }
}

}  // namespace
}  // namespace lamina
