// What the README says is true as far as a program can tell: options, links, and the example of the library.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "support/program.h"

namespace lamina::tools {
namespace {

using test::read_text;

std::string readme() {
  return read_text(LAMINA_SOURCE_DIR "/README.md");
}

std::set<std::string> options_in(const std::string& text) {
  std::set<std::string> options;
  const std::regex option("(?:^|[^a-z-])(--[a-z][a-z-]*[a-z]|--k)(?![a-z-])");
  for (auto it = std::sregex_iterator(text.begin(), text.end(), option); it != std::sregex_iterator(); ++it)
    options.insert((*it)[1]);
  return options;
}

/// The commands of a line's pipes and lists that run lamina: name of the tool, and the whole command.
std::vector<std::pair<std::string, std::string>> commands(const std::string& line) {
  std::vector<std::pair<std::string, std::string>> found;
  const std::regex command("lamina ([a-z]+)( [^|&;>]*)?");
  for (auto it = std::sregex_iterator(line.begin(), line.end(), command); it != std::sregex_iterator(); ++it)
    found.emplace_back((*it)[1], (*it)[2]);
  return found;
}

TEST(Readme, ItsCommandsHaveToolsAndOptionsThatExist) {
  std::istringstream lines(readme());
  std::map<std::string, std::set<std::string>> known;
  bool code = false;
  int seen = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("```")) code = !code;
    if (!code) continue;
    for (const auto& [tool, words] : commands(line)) {
      if (!known.contains(tool)) {
        const auto help = test::run_lamina({tool, "--help"});
        ASSERT_EQ(help.code, 0) << line;
        known[tool] = options_in(help.out);
      }
      for (const std::string& option : options_in(words)) {
        EXPECT_TRUE(known[tool].contains(option)) << "lamina " << tool << " has no " << option << "\n" << line;
        ++seen;
      }
    }
  }
  EXPECT_GT(seen, 20);
}

TEST(Readme, EveryOptionInItsTextExists) {
  std::set<std::string> known = options_in(read_text(LAMINA_SOURCE_DIR "/docs/reference.md"));
  known.insert({"--help", "--build", "--preset", "--install", "--bind-to"});
  for (const std::string& option : options_in(readme())) EXPECT_TRUE(known.contains(option)) << option;
}

TEST(Readme, ItsLinksLeadSomewhere) {
  const std::string text = readme();
  const std::regex link(R"(\]\(([^)#:]+)(#[^)]*)?\))");
  int seen = 0;
  for (auto it = std::sregex_iterator(text.begin(), text.end(), link); it != std::sregex_iterator(); ++it, ++seen)
    EXPECT_TRUE(std::filesystem::exists(LAMINA_SOURCE_DIR "/" + (*it)[1].str())) << (*it)[1];
  EXPECT_GT(seen, 10);
}

TEST(Readme, ItsProgramIsTheOneThatIsCompiled) {
  EXPECT_THAT(readme(),
              ::testing::HasSubstr("```cpp\n" + read_text(LAMINA_SOURCE_DIR "/tests/consumer/main.cpp") + "```\n"));
}

TEST(Readme, IsShort) {
  const std::string text = readme();
  EXPECT_LE(std::count(text.begin(), text.end(), '\n'), 200);
}

}  // namespace
}  // namespace lamina::tools
