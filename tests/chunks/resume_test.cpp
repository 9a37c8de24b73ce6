// A run that was stopped goes on to the same bytes, and with nothing else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>

#include "chunks/chunked.h"

namespace lamina {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class Resumable : public ::testing::Test {
 protected:
  Resumable() {
    settings_.input = test::write_cloud(test::torus_cloud(6000), folder_ / "in.ply");
    settings_.output = folder_ / "out.ply";
    whole_ = test::whole_bytes(settings_, folder_);
  }
  void run(bool resume, const RunContext& context = {}) const {
    reconstruct_resumable(settings_, {checkpoint_, resume}, context);
  }
  /// Stops the run after so many reports of progress.
  void interrupt(bool resume, int reports) const {
    std::atomic<bool> cancel = false;
    int left = reports;
    RunContext context;
    context.cancel = &cancel;
    context.threads = 1;
    context.progress = [&](const Progress&) { cancel = --left <= 0; };
    try {
      run(resume, context);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::internal) << error.what();
    }
  }
  [[nodiscard]] std::string refusal(bool resume) const {
    try {
      run(resume);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::usage);
      return error.what();
    }
    ADD_FAILURE() << "ran";
    return {};
  }
  void expect_done() const {
    EXPECT_TRUE(test::read_file(settings_.output) == whole_);
    EXPECT_FALSE(std::filesystem::exists(checkpoint_));
  }
  [[nodiscard]] int parts() const {
    int n = 0;
    for (const auto& entry : std::filesystem::directory_iterator(checkpoint_))
      n += entry.path().extension() == ".lmesh" ? 1 : 0;
    return n;
  }

  test::TemporaryFolder folder_;
  SurfaceSettings settings_;
  std::string whole_;
  const std::string checkpoint_ = folder_ / "checkpoint";
};

TEST_F(Resumable, Uninterrupted) {
  run(false);
  expect_done();
}

TEST_F(Resumable, NothingToResumeBegins) {
  run(true);
  expect_done();
}

TEST_F(Resumable, StoppedAnywhere) {
  int most = 0;
  for (int reports = 1; reports < 40; reports += 5) {
    interrupt(false, reports);
    if (!std::filesystem::exists(checkpoint_)) break;  // it came to its end
    EXPECT_FALSE(std::filesystem::exists(settings_.output));
    most = std::max(most, parts());
    interrupt(true, 12);
    run(true);
    expect_done();
    std::filesystem::remove(settings_.output);
  }
  EXPECT_GT(most, 0) << "never stopped behind a finished part";
}

TEST_F(Resumable, WithOtherSettingsItIsRefused) {
  interrupt(false, 15);
  ASSERT_TRUE(std::filesystem::exists(checkpoint_));
  EXPECT_THAT(refusal(false), HasSubstr("add --resume"));
  settings_.blend = 1.3;
  EXPECT_THAT(refusal(true), AllOf(HasSubstr("another run"), HasSubstr("blend 1.2")));
  EXPECT_THAT(refusal(false), HasSubstr("another run"));
  settings_.blend = 1.2;
  run(true);
  expect_done();
}

TEST_F(Resumable, WithAnotherInputItIsRefused) {
  interrupt(false, 15);
  test::write_cloud(test::torus_cloud(6001), settings_.input);
  EXPECT_THAT(refusal(true), AllOf(HasSubstr("another run"), HasSubstr("in.ply")));
}

TEST_F(Resumable, ADamagedPartIsMadeAgain) {
  for (int reports = 30; reports > 5; reports -= 3) {
    interrupt(false, reports);
    if (std::filesystem::exists(checkpoint_) && parts() > 1) break;
    std::filesystem::remove_all(checkpoint_);
  }
  ASSERT_GT(parts(), 1);
  const std::string part = checkpoint_ + "/part_0001.lmesh";
  const std::string bytes = test::read_file(part);
  test::write_file(part, bytes.substr(0, bytes.size() - 9));
  run(true);
  expect_done();
}

TEST_F(Resumable, OtherPeoplesFilesAreSafe) {
  std::filesystem::create_directory(checkpoint_);
  const std::string theirs = test::write_file(checkpoint_ + "/thesis.txt", "years of work");
  EXPECT_THAT(refusal(false), HasSubstr("thesis.txt"));
  EXPECT_THAT(refusal(true), HasSubstr("thesis.txt"));
  EXPECT_EQ(test::read_file(theirs), "years of work");
}

TEST_F(Resumable, WhatCannotBeResumedIsRefused) {
  settings_.input = "-";
  EXPECT_THAT(refusal(false), HasSubstr("standard input"));
  settings_.input = folder_ / "in.ply";
  settings_.volume.path = folder_ / "out.vdb";
  EXPECT_THAT(refusal(false), HasSubstr("--vdb"));
  EXPECT_FALSE(std::filesystem::exists(checkpoint_));
}

TEST_F(Resumable, AStoreServesToo) {
  const std::string store = folder_ / "store";
  write_store(settings_, store, {});
  settings_.input = store;
  interrupt(false, 12);
  run(true);
  expect_done();
  reconstruct_surface(settings_, {});  // and is still there
  EXPECT_TRUE(test::read_file(settings_.output) == whole_);
}

TEST_F(Resumable, AFailureLeavesNothingToResume) {
  test::write_file(settings_.input, "no points at all");
  EXPECT_THROW(run(false), Error);
  EXPECT_FALSE(std::filesystem::exists(checkpoint_));
}

}  // namespace
}  // namespace lamina
