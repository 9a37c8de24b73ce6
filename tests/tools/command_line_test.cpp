#include "common/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <new>

#include "lamina/error.h"
#include "lamina/run.h"
#include "support/program.h"

namespace lamina::tools {
namespace {

using test::run_lamina;
using ::testing::HasSubstr;

// Tools that fail in every way a tool can.
void add_failing(CLI::App& app) {
  CLI::App* tool = app.add_subcommand("failing", "Throws");
  static std::string how;
  tool->add_option("--how", how, "What to throw")->required();
  tool->callback([] {
    if (how == "memory") throw std::bad_alloc();
    if (how == "unreadable") throw Error(ExitCode::unreadable, "nothing there");
    if (how == "empty") throw Error(ExitCode::empty, "no surface");
    if (how == "defect") throw std::logic_error("impossible");
  });
}

int run(const std::vector<const char*>& words) {
  std::vector<const char*> arguments{"lamina"};
  arguments.insert(arguments.end(), words.begin(), words.end());
  return run_program(static_cast<int>(arguments.size()), arguments.data(), {add_failing});
}

TEST(CommandLine, ExitCodesSayWhatWentWrong) {
  EXPECT_EQ(run({"failing", "--how", "nothing"}), 0);
  EXPECT_EQ(run({"failing", "--how", "defect"}), 1);
  EXPECT_EQ(run({"failing"}), 2);
  EXPECT_EQ(run({"failing", "--how", "unreadable"}), 3);
  EXPECT_EQ(run({"failing", "--how", "memory"}), 4);
  EXPECT_EQ(run({"failing", "--how", "empty"}), 5);
}

TEST(CommandLine, AnUnknownOptionExplainsBeforeAMissingOne) {
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(run({"failing", "--hwo", "memory"}), 2);
  EXPECT_THAT(::testing::internal::GetCapturedStderr(),
              HasSubstr("lamina failing: unknown option '--hwo'; did you mean '--how'?"));
}

TEST(CommandLine, FarOffWordsGetNoSuggestion) {
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(run({"failing", "--completely-else=3"}), 2);
  const std::string said = ::testing::internal::GetCapturedStderr();
  EXPECT_THAT(said, HasSubstr("unknown option '--completely-else'"));
  EXPECT_THAT(said, Not(HasSubstr("did you mean")));
}

TEST(CommandLine, UnknownToolsAreAnswered) {
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(run({"faling"}), 2);
  EXPECT_THAT(::testing::internal::GetCapturedStderr(),
              HasSubstr("lamina: unknown tool 'faling'; did you mean 'failing'?"));
}

TEST(Program, VersionAndHelpGoToStandardOutput) {
  const auto version = run_lamina({"--version"});
  EXPECT_EQ(version.code, 0);
  EXPECT_EQ(version.out, "lamina " + std::string(lamina::version()) + "\n");
  const auto help = run_lamina({"--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.out, HasSubstr("Usage: lamina"));
  EXPECT_EQ(help.err, "");
}

TEST(Program, WithoutAToolItIsAUsageError) {
  const auto outcome = run_lamina({});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(outcome.out, "");
  EXPECT_THAT(outcome.err, HasSubstr("lamina --help"));
}

}  // namespace
}  // namespace lamina::tools
