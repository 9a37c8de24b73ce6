// The README's option tables and the program's help must name the same options.
#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "support/program.h"

namespace lamina::tools {
namespace {

using Options = std::set<std::string>;

// Section title -> long options in the first column of its tables.
std::map<std::string, Options> readme_tables() {
  std::map<std::string, Options> tables;
  std::istringstream lines(test::read_text(LAMINA_SOURCE_DIR "/README.md"));
  std::string line, section;
  const std::regex option("--[a-z0-9][a-z0-9-]*");
  while (std::getline(lines, line)) {
    if (line.starts_with("#")) section = line.substr(line.find(' ') + 1);
    if (!line.starts_with("| `-")) continue;
    const std::string cell = line.substr(0, line.find(" | ", 2));
    for (auto it = std::sregex_iterator(cell.begin(), cell.end(), option); it != std::sregex_iterator(); ++it) {
      tables[section].insert(it->str());
    }
  }
  return tables;
}

// The options a help text defines: those that begin a line, after an optional short name.
Options help_options(const std::vector<std::string>& words) {
  const test::Outcome outcome = test::run_lamina(words);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  Options options;
  std::istringstream lines(outcome.out);
  std::string line;
  const std::regex definition("^  (?:-[A-Za-z0-9], ?)*((?:--[a-z0-9][a-z0-9-]*(?:, ?)?)+).*");
  const std::regex option("--[a-z0-9][a-z0-9-]*");
  while (std::getline(lines, line)) {
    std::smatch match;
    if (!std::regex_match(line, match, definition)) continue;
    const std::string names = match[1];
    for (auto it = std::sregex_iterator(names.begin(), names.end(), option); it != std::sregex_iterator(); ++it) {
      options.insert(it->str());
    }
  }
  return options;
}

std::set<std::string> tool_names() {
  std::set<std::string> names;
  std::istringstream lines(test::run_lamina({"--help"}).out);
  std::string line;
  bool listing = false;
  while (std::getline(lines, line)) {
    std::smatch match;
    if (line == "Tools:") listing = true;
    if (listing && std::regex_match(line, match, std::regex("^  ([a-z][a-z0-9_-]*) .*"))) names.insert(match[1]);
  }
  return names;
}

TEST(Readme, OptionTablesMatchTheProgram) {
  const auto tables = readme_tables();
  const Options& shared = tables.at("Every working tool");
  Options shared_seen;
  for (const std::string& tool : tool_names()) {
    const Options in_help = help_options({tool, "--help"});
    const auto table = tables.find("lamina " + tool);
    if (table == tables.end()) {
      ADD_FAILURE() << "README has no section 'lamina " << tool << "' with an option table";
      continue;
    }
    for (const std::string& option : in_help) {
      EXPECT_TRUE(table->second.contains(option) || shared.contains(option)) << tool << ": README lacks " << option;
      if (shared.contains(option)) shared_seen.insert(option);
    }
    for (const std::string& option : table->second) {
      EXPECT_TRUE(in_help.contains(option)) << tool << ": README promises " << option;
    }
  }
  EXPECT_EQ(shared_seen, shared) << "an option of the shared table is in no tool";
}

TEST(Readme, EverySectionOfAToolHasItsTool) {
  const auto tools = tool_names();
  for (const auto& [section, options] : readme_tables()) {
    if (section.starts_with("lamina ")) {
      EXPECT_TRUE(tools.contains(section.substr(7))) << section;
    }
  }
}

}  // namespace
}  // namespace lamina::tools
