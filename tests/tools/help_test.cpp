// What a user learns from the program itself: examples in the helps, completion, manual pages.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <sstream>

#include "lamina/mesh.h"
#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::vector<std::string> tools() {
  std::vector<std::string> names;
  std::istringstream lines(run_lamina({"--help"}).out);
  bool listing = false;
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (line == "Tools:") listing = true;
    if (listing && std::regex_match(line, match, std::regex("^  ([a-z]+) .*"))) names.push_back(match[1]);
  }
  return names;
}

/// The command lines behind "Examples:".
std::vector<std::string> examples(const std::string& help) {
  std::vector<std::string> found;
  std::istringstream lines(help.substr(std::min(help.find("Examples:\n"), help.size())));
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with("  lamina ")) found.push_back(line.substr(2));
  return found;
}

/// Parameterised by nothing but run once for every tool, so that a failure names the line.
TEST(Help, EveryExampleOfEveryToolWorks) {
  const TemporaryFolder folder;
  write_points(folder / "scan.ply", sphere_rows(1500, 1), sphere_columns());
  write_points(folder / "more.ply", sphere_rows(500, 2), sphere_columns());
  PointColumns plain = sphere_columns();
  plain.attributes.clear();
  SampleBatch rows = sphere_rows(50, 3);
  rows.attributes.clear();
  rows.exact.clear();
  write_points(folder / "plain.ply", rows, plain);
  sphere_mesh(folder / "mesh.ply");
  sphere_mesh(folder / "other.obj", 1.01);
  ASSERT_EQ(run_lamina({"convert", folder / "mesh.ply", "--voxelsize", "0.05", "-o", folder / "mesh.vdb"}).code, 0);
  write_file(folder / "job.json", run_lamina({"check", folder / "mesh.ply", "--print-job"}).out);
  // Pages want a part that the build takes from npm, where that is.
  const bool pages =
      std::filesystem::exists(std::filesystem::path(LAMINA_PROGRAM).parent_path() / "share/lamina/viewer.js");
  for (const std::string& tool : tools()) {
    const auto lines = examples(run_lamina({tool, "--help"}).out);
    EXPECT_FALSE(lines.empty()) << tool << " has no example";
    for (const std::string& line : lines) {
      EXPECT_THAT(line, StartsWith("lamina " + tool + " "));
      const auto outcome = run_shell("cd " + test::quoted(folder.path()) + " && " + line);
      EXPECT_EQ(outcome.code, tool == "view" && !pages ? 2 : 0) << line << "\n" << outcome.err;
    }
  }
}

/// What bash would offer for each command line, the last word of which is unfinished; a line each.
std::string completed(const std::vector<std::string>& lines) {
  const TemporaryFolder folder;
  std::string script = "complete -p lamina >/dev/null || exit 1\n";
  for (const std::string& line : lines)
    script += "COMP_WORDS=(" + line + "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _lamina; echo \"${COMPREPLY[*]}\"\n";
  write_file(folder / "script", script);
  const auto outcome = run_shell("cd " + test::quoted(folder.path()) +
                                 " && lamina completion bash > completion && cat completion script | bash");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  return outcome.out;
}

TEST(Completion, OffersToolsOptionsAndWords) {
  EXPECT_EQ(completed({"lamina cl", "lamina clip --pl", "lamina clip a.ply --keep ''", "lamina surface --fit s",
                       "lamina scatter --shape to", "lamina clip a.p"}),
            "clean clip\n--plane\ninside outside\nsphere\ntorus\n\n")
      << "file names are bash's own";
  std::vector<std::string> lines;
  std::string expected;
  for (const std::string& tool : tools()) {
    lines.push_back("lamina " + tool + " --hel");
    expected += "--help\n";
  }
  EXPECT_EQ(completed(lines), expected);
}

TEST(Manual, HasAPageForEveryToolAndOption) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_lamina({"man", "--all", folder.path()}).code, 0);
  const auto names = tools();
  EXPECT_EQ(folder.entries(), static_cast<long>(names.size()) + 1);
  for (const std::string& tool : names) {
    const std::string page = folder / ("lamina-" + tool + ".1");
    const std::string text = read_text(page);
    EXPECT_THAT(text, StartsWith(".TH lamina-" + tool + " 1"));
    const std::string help = run_lamina({tool, "--help"}).out;
    const std::regex option("--[a-z][a-z-]+");
    const std::string usage = help.substr(0, help.find("Examples:"));
    std::istringstream lines(usage);
    for (std::string line; std::getline(lines, line);) {
      std::smatch match;
      if (!std::regex_match(line, match, std::regex("^  (?:-[a-z], ?)?(--[a-z-]+).*"))) continue;
      EXPECT_THAT(text, HasSubstr(std::regex_replace(match[1].str(), std::regex("-"), "\\-"))) << tool;
    }
  }
  EXPECT_EQ(run_lamina({"man", "nothing"}).code, 2);
  if (run_shell("command -v groff").code != 0) return;
  const auto formatted = run_shell("cd " + test::quoted(folder.path()) + " && groff -man -ww -Tascii -P-cbou *.1");
  EXPECT_EQ(formatted.code, 0);
  EXPECT_EQ(formatted.err, "");
  EXPECT_THAT(formatted.out, HasSubstr("EXAMPLES"));
}

TEST(Help, HiddenToolsAreNotShown) {
  const std::string help = run_lamina({"--help"}).out;
  EXPECT_THAT(help, testing::Not(HasSubstr("completion")));
  EXPECT_THAT(run_lamina({"clipp"}).err, HasSubstr("did you mean 'clip'?"));
  EXPECT_THAT(run_lamina({"sort", "--atribute", "x"}).err, HasSubstr("did you mean '--attribute'?"));
  EXPECT_THAT(run_lamina({"--size", "4x4", "render", "x.ply"}).err,
              HasSubstr("option '--size' comes behind the tool: lamina render --size ..."));
}

TEST(Help, FiveToolsInOnePipe) {
  const TemporaryFolder folder;
  write_points(folder / "scan.ply", sphere_rows(4000, 1), sphere_columns());
  const auto outcome =
      run_shell("cd " + test::quoted(folder.path()) +
                " && lamina clip scan.ply --plane 0,0,-0.5,0,0,1 -o - -q | lamina transform - --scale 10 "
                "-o - -q | lamina radius - -o - -q | lamina surface - -o - -q | lamina render - --size "
                "64x64 -o picture.png -q");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(read_text(folder / "picture.png"), StartsWith("\x89PNG"));
}

}  // namespace
}  // namespace lamina::tools
