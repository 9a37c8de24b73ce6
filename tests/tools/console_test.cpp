#include "common/console.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>

#include "common/options.h"
#include "support/program.h"

namespace lamina::tools {
namespace {

using ::testing::HasSubstr;

// A console that writes into memory under a clock of the test's.
class ConsoleTest : public ::testing::Test {
 protected:
  ~ConsoleTest() override {
    if (stream_ != nullptr) std::fclose(stream_);
    std::free(text_);
  }
  Console::Settings settings(bool terminal, bool quiet = false) {
    return {stream_, terminal, quiet, [this] { return now_; }};
  }
  std::string said() {
    std::fflush(stream_);
    return {text_, size_};
  }

  char* text_ = nullptr;
  std::size_t size_ = 0;
  std::FILE* stream_ = open_memstream(&text_, &size_);
  double now_ = 100;
};

TEST_F(ConsoleTest, PlainLinesAreFew) {
  {
    Console console(settings(false));
    for (std::uint64_t i = 0; i <= 1000; ++i) {
      now_ = 100 + 0.001 * static_cast<double>(i);  // a second in all
      console.progress({"surface", i * 1000, 1'000'000, static_cast<std::int64_t>(i / 10), 100});
    }
  }
  const std::string text = said();
  const auto lines = std::count(text.begin(), text.end(), '\n');
  EXPECT_GE(lines, 2);
  EXPECT_LE(lines, 4);
  EXPECT_THAT(text, HasSubstr("lamina: surface  1.00 M of 1.00 M samples  slab 100 of 100  100 %"));
  EXPECT_EQ(text.find('\r'), std::string::npos);
}

TEST_F(ConsoleTest, TimeLeftFollowsTheRate) {
  Console console(settings(false));
  console.progress({"read", 0, 1000, 0, 0});
  now_ += 30;
  console.progress({"read", 250, 1000, 0, 0});
  EXPECT_THAT(said(), HasSubstr("25 %  1 min 30 s left"));
}

TEST_F(ConsoleTest, ATerminalLineIsRewrittenAtMostTenTimesASecond) {
  {
    Console console(settings(true));
    for (std::uint64_t i = 0; i < 1000; ++i) {
      now_ = 100 + 0.001 * static_cast<double>(i);
      console.progress({"read", i, 1000, 0, 0});
    }
    console.message(LogLevel::warning, "odd");
  }
  const std::string text = said();
  EXPECT_LE(std::count(text.begin(), text.end(), '\r'), 11);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2);
  EXPECT_THAT(text, HasSubstr("\nlamina: warning: odd\n"));
}

TEST_F(ConsoleTest, QuietKeepsWarnings) {
  Console console(settings(false, true));
  console.progress({"read", 1, 2, 0, 0});
  console.message(LogLevel::info, "nothing to see");
  console.message(LogLevel::warning, "look here");
  EXPECT_EQ(said(), "lamina: warning: look here\n");
}

TEST(RunOptions, AreParsedWithUnits) {
  CLI::App app;
  RunOptions options;
  add_run_options(app, options);
  app.parse("--threads 3 --max-memory 2G -q --tmp-dir /");
  EXPECT_EQ(options.threads, 3);
  EXPECT_EQ(options.max_memory, std::size_t{2} << 30);
  EXPECT_TRUE(options.quiet);
  EXPECT_EQ(options.tmp_dir, "/");
  const RunContext context = make_context(options);
  EXPECT_EQ(context.threads, 3);
  EXPECT_EQ(context.tmp_dir, "/");
  EXPECT_FALSE(context.cancelled());
}

TEST(RunOptions, RefuseWhatCannotBeMeant) {
  for (const char* line : {"--threads -1", "--threads many", "--max-memory lots", "--tmp-dir /no/such/folder"}) {
    CLI::App app;
    RunOptions options;
    add_run_options(app, options);
    EXPECT_THROW(app.parse(line), CLI::ParseError) << line;
  }
}

TEST(LengthOption, ReadsAndRefuses) {
  CLI::App app;
  Length length{0.9, Length::Unit::influence_radius};
  add_length(app, "-b,--boundary", length, "Where surfaces end");
  EXPECT_THAT(app.help(), HasSubstr("0.9R"));
  app.parse("--boundary 0.5r");
  EXPECT_EQ(length, (Length{0.5, Length::Unit::sample_radius}));
  try {
    app.parse("--boundary wide");
    FAIL();
  } catch (const CLI::ValidationError& e) {
    EXPECT_THAT(e.what(), HasSubstr("--boundary"));
    EXPECT_THAT(e.what(), HasSubstr("'wide' is not a length"));
  }
}

TEST(CancelDeathTest, TheFirstSignalAsksAndTheSecondEnds) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        cancel_on_signals();
        std::raise(SIGTERM);
        if (!cancel_requested()) std::_Exit(1);
        std::raise(SIGTERM);
        std::_Exit(2);
      },
      ::testing::KilledBySignal(SIGTERM), "");
}

}  // namespace
}  // namespace lamina::tools
