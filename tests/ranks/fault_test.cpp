// A rank that fails ends the job: one message, its exit code, nothing under the output's name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/stat.h>

#include "lamina/error.h"
#include "ranks/launched.h"
#include "reconstruct/clouds.h"
#include "support/program.h"

namespace lamina {
namespace {

int occurrences(const std::string& text, const std::string& word) {
  int n = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

class RankFaults : public ::testing::Test {
 protected:
  void SetUp() override {
    if (const std::string reason = test::no_ranks(); !reason.empty()) GTEST_SKIP() << reason;
    input_ = test::write_cloud(test::sphere_cloud(3000), folder_ / "in.ply");
    entries_ = folder_.entries();
  }
  /// The message once, the code, and nothing new in the folder.
  void expect_failure(const test::Outcome& outcome, ExitCode code, const std::string& message) {
    EXPECT_EQ(outcome.code, static_cast<int>(code)) << outcome.err;
    EXPECT_EQ(occurrences(outcome.err, message), 1) << outcome.err;
    EXPECT_EQ(occurrences(outcome.err, "lamina: "), 1) << outcome.err;
    EXPECT_EQ(folder_.entries(), entries_);
  }
  test::TemporaryFolder folder_;
  std::string input_;
  long entries_ = 0;
};

TEST_F(RankFaults, MissingInput) {
  expect_failure(test::run_ranks(2, {"surface", folder_ / "none.ply", "-o", folder_ / "out.ply", "-q"}),
                 ExitCode::unreadable, "none.ply");
}

TEST_F(RankFaults, OutputThatCannotBeWritten) {
  expect_failure(test::run_ranks(2, {"surface", input_, "-o", folder_ / "none/out.ply", "-q"}), ExitCode::budget,
                 "does not exist");
}

TEST_F(RankFaults, OneRankAlone) {
  // Only rank 1 has a limit on the size of its files: it fails in the middle, the others wait for it.
  const std::string command = test::mpirun(1) + " surface " + input_ + " -o " + (folder_ / "out.ply") + " -q";
  const std::string program = command.substr(0, command.find(" -np"));
  const std::string arguments = " -np 1 " LAMINA_PROGRAM " surface " + input_ + " -o " + (folder_ / "out.ply") + " -q ";
  const test::Outcome outcome =
      test::run_shell(program + arguments + ":" + " -np 1 bash -c 'ulimit -f 4; exec \"$@\"' x " LAMINA_PROGRAM +
                      " surface " + input_ + " -o " + (folder_ / "out.ply") + " -q :" + arguments);
  expect_failure(outcome, ExitCode::budget, "cannot grow");
}

TEST_F(RankFaults, WhatRanksCannotDo) {
  const std::string out = folder_ / "out.ply";
  const std::vector<std::vector<std::string>> cases{
      {"surface", input_, "-o", out, "--vdb", folder_ / "out.vdb"},
      {"surface", input_, "-o", "-"},
      {"surface", input_, "-o", out, "--levles", "3"},
  };
  for (const auto& words : cases) {
    const test::Outcome outcome = test::run_ranks(2, words);
    EXPECT_EQ(outcome.code, static_cast<int>(ExitCode::usage)) << outcome.err;
    EXPECT_EQ(occurrences(outcome.err, "lamina"), 1 + occurrences(outcome.err, "see 'lamina")) << outcome.err;
    EXPECT_EQ(folder_.entries(), entries_);
  }
}

TEST_F(RankFaults, OtherWaysToShareOutTheWork) {
  const test::Outcome outcome =
      test::run_shell("OMPI_COMM_WORLD_SIZE=2 OMPI_COMM_WORLD_RANK=0 lamina surface " + input_ + " -o " +
                      (folder_ / "out.ply") + " --checkpoint " + (folder_ / "kept"));
  expect_failure(outcome, ExitCode::usage, "--checkpoint and mpirun contradict each other");
}

TEST_F(RankFaults, LauncherOfAnotherMpi) {
  const test::Outcome outcome = test::run_shell(test::kMpiEnvironment + "PMI_SIZE=3 PMI_RANK=0 lamina surface " +
                                                input_ + " -o " + (folder_ / "out.ply"));
  expect_failure(outcome, ExitCode::usage, "of which this MPI sees 1");
}

TEST_F(RankFaults, KilledRank) {
  // Rank 0 waits for an input that never comes. Until it begins to, opening the pipe to write waits: the other one is
  // killed while the job is under way, and not while MPI is starting it. Should no rank begin, something else reads.
  const std::string pipe = folder_ / "pipe.ply";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const std::string quoted = test::quoted(pipe);
  const test::Outcome outcome = test::run_shell(
      test::mpirun(2) + " surface " + quoted + " -o " + test::quoted(folder_ / "out.ply") + " -q & run=$!\n" +
      "(sleep 60; exec cat " + quoted + ") >/dev/null 2>&1 & other=$!\n" + "exec 3>" + quoted +
      "; kill $other; set -- $(ps -o pid= --ppid $run); kill -9 ${2:-$run}; wait $run");
  std::filesystem::remove(pipe);
  EXPECT_NE(outcome.code, 0);
  EXPECT_THAT(outcome.out + outcome.err, testing::HasSubstr("signal 9"));
  EXPECT_EQ(folder_.entries(), entries_);
}

}  // namespace
}  // namespace lamina
