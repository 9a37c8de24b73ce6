// lamina run and --print-job: a command line, printed as a job and run, is the same run; and what is wrong with a job
// is said before anything works.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

/// A folder with a scan, another one and a mesh.
class JobFolder : public TemporaryFolder {
 public:
  JobFolder() {
    write_points(*this / "scan.ply", sphere_rows(1500, 1), sphere_columns());
    write_points(*this / "more.ply", sphere_rows(500, 2), sphere_columns());
    PointColumns plain = sphere_columns();
    plain.attributes.clear();
    SampleBatch rows = sphere_rows(50, 3);
    rows.attributes.clear();
    rows.exact.clear();
    write_points(*this / "plain.ply", rows, plain);
    sphere_mesh(*this / "mesh.ply");
    sphere_mesh(*this / "other.obj", 1.01);
    EXPECT_EQ(shell("lamina convert mesh.ply --voxelsize 0.05 -o mesh.vdb").code, 0);
  }
  [[nodiscard]] Outcome shell(const std::string& line) const { return run_shell("cd " + quoted(path()) + "\n" + line); }
  [[nodiscard]] Outcome run(const std::string& job) const {
    write_file(*this / "job.json", job);
    return shell("lamina run job.json");
  }
  /// What the files hold, but statistics, which tell times.
  [[nodiscard]] std::map<std::string, std::string> contents() const {
    std::map<std::string, std::string> contents;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path())) {
      if (!entry.is_regular_file() || entry.path().extension() == ".json") continue;
      contents[std::filesystem::relative(entry.path(), path()).string()] = read_text(entry.path().string());
    }
    return contents;
  }
};

/// Runs the line in one folder, its job in the other.
void expect_same_run(const JobFolder& typed, const JobFolder& as_job, const std::string& line) {
  const Outcome run = typed.shell(line);
  const std::size_t after_tool = line.find(' ', std::string("lamina ").size());
  const Outcome printed =
      as_job.shell(line.substr(0, after_tool) + " --print-job" + line.substr(after_tool) + " > job.json");
  ASSERT_EQ(printed.code, 0) << line << "\n" << printed.err;
  const Outcome again = as_job.shell("lamina run job.json --print-job | cmp - job.json >&2");
  EXPECT_EQ(again.code, 0) << line << "\n" << again.err << read_text(as_job / "job.json");
  const Outcome job = as_job.shell("lamina run job.json");
  EXPECT_EQ(job.code, run.code) << line << "\n" << job.err;
  if (line.find("json") == std::string::npos) {
    EXPECT_EQ(job.out, run.out) << line;
  }
  EXPECT_TRUE(typed.contents() == as_job.contents()) << line << "\n" << read_text(as_job / "job.json");
}

TEST(Job, EveryExampleOfEveryToolIsTheSameRun) {
  const JobFolder typed, as_job;
  std::istringstream reference(read_text(LAMINA_SOURCE_DIR "/docs/reference.md"));
  bool examples = false;
  int count = 0;
  for (std::string line; std::getline(reference, line);) {
    if (line == "Examples:") examples = true;
    if (line.starts_with("## ")) examples = false;
    if (!examples || !line.starts_with("lamina ") || line.starts_with("lamina run")) continue;
    if (line.find_first_of("|>&;") == std::string::npos) {
      expect_same_run(typed, as_job, line);
      ++count;
    } else {
      ASSERT_EQ(typed.shell(line).code, as_job.shell(line).code) << line;
    }
  }
  EXPECT_GT(count, 30);
}

TEST(Job, OptionsOfEveryKindAreTheSameRun) {
  const JobFolder typed, as_job;
  for (const char* line : {
           "lamina surface scan.ply more.ply -o a.ply -o a.glb --frame axis --cluster free --fit plane --keep-strays "
           "--bad-samples drop --vdb a.vdb --vdb-grids N,Cd --vdb-precision float --max-radius 3r --prune 5 -q",
           "lamina surface scan.ply -oa.ply --blend=1.50 --steps=1e0 --normals estimate --viewpoint -3,0,0.5 --threads "
           "1",
           "lamina surface scan.ply -o a.ply --preset handheld --where 'id>10' --where 'id<1200' --frame PCA",
           "lamina clip scan.ply --plane 0,0,-0.5,0,0,1 --plane 0,0,0.5,0,0,-1 -o clipped.ply",
           "lamina transform mesh.ply --rotate -90,0,0 --scale 2 -o turned.ply",
           "lamina attribtransfer mesh.ply scan.ply --attributes red,green,blue -o coloured.ply",
           "lamina render mesh.ply -o mesh.png --size 64x48 --wire --color none",
           "lamina check mesh.ply --expect closed",
       }) {
    expect_same_run(typed, as_job, line);
  }
  // Failing is the same, too: an open mesh is not closed.
  ASSERT_EQ(typed.shell("lamina clip mesh.ply --plane 0,0,0,0,0,1 -o half.ply").code, 0);
  ASSERT_EQ(as_job.shell("lamina clip mesh.ply --plane 0,0,0,0,0,1 -o half.ply").code, 0);
  expect_same_run(typed, as_job, "lamina check half.ply --expect closed");
}

TEST(Job, PrintsNumbersWordsFlagsAndLists) {
  const Outcome printed =
      run_lamina({"surface", "2", "-o", "3", "--frame", "axis", "--vdb-precision", "half", "--blend", "2", "--prune",
                  "auto", "--max-radius", "3r", "--keep-strays", "--diffuse", "--vdb-grids", "N,Cd", "--print-job"});
  ASSERT_EQ(printed.code, 0) << printed.err;
  EXPECT_EQ(nlohmann::json::parse(printed.out), nlohmann::json::parse(R"({"lamina_job": 1, "steps": [{
    "tool": "surface", "input": ["2"], "output": ["3"], "frame": "axis", "vdb-precision": "half", "blend": 2,
    "prune": "auto", "max-radius": "3r", "strays": false, "diffuse": true, "vdb-grids": ["N", "Cd"]}]})"));
}

TEST(Job, StepsHandFilesOn) {
  const JobFolder folder;
  const Outcome outcome = folder.run(R"({"lamina_job": 1, "steps": [
    {"tool": "clip", "INPUT": "scan.ply", "plane": [0, 0, -0.5, 0, 0, 1], "o": "clipped.ply"},
    {"tool": "surface", "input": "./clipped.ply", "output": "typed.ply", "threads": 1.0, "diffuse": false}]})");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("lamina: step 1 of 2: clip\n"));
  EXPECT_THAT(outcome.err, HasSubstr("lamina: step 2 of 2: surface\n"));
  ASSERT_EQ(folder.shell("lamina surface clipped.ply -o mesh_of_clipped.ply").code, 0);
  EXPECT_TRUE(read_text(folder / "typed.ply") == read_text(folder / "mesh_of_clipped.ply"));
}

TEST(Job, TheExampleOfThePageRuns) {
  const JobFolder folder;
  const std::string page = read_text(LAMINA_SOURCE_DIR "/docs/jobs.md"), fence = "```json\n";
  const std::size_t begin = page.find(fence) + fence.size();
  ASSERT_EQ(folder.shell("lamina convert scan.ply -o scan.xyz").code, 0);
  const Outcome outcome = folder.run(page.substr(begin, page.find("```", begin) - begin));
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("manifold"));
}

TEST(Job, AFailingStepEndsTheJobWithItsCode) {
  const JobFolder folder;
  const Outcome outcome = folder.run(R"({"lamina_job": 1, "steps": [
    {"tool": "clip", "input": "scan.ply", "plane": "0,0,-0.5,0,0,1", "output": "clipped.ply"},
    {"tool": "surface", "input": "other.obj", "output": "a.ply", "max-radius": 1e-9},
    {"tool": "check", "mesh": "mesh.ply"}]})");
  EXPECT_EQ(outcome.code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("lamina: job.json: step 2 (surface): "));
  EXPECT_EQ(outcome.out, "") << "no third step";
  EXPECT_TRUE(std::filesystem::exists(folder / "clipped.ply"));
}

TEST(Job, WhatCannotBeMeantIsSaidBeforeAnythingRuns) {
  const JobFolder folder;
  const std::string first = R"({"tool": "clip", "input": "scan.ply", "plane": "0,0,0,0,0,1", "o": "made.ply"})";
  const auto second = [&](const std::string& step) {
    return folder.run("{\"lamina_job\": 1, \"steps\": [" + first + ", {" + step + "}]}");
  };
  struct Case {
    const char *step, *said;
    int code = 2;
  };
  for (const Case& c : {
           Case{R"("tool": "surfac", "input": "made.ply")",
                "(surfac): key 'tool': there is no tool 'surfac' for a job; "
                "did you mean 'surface'?"},
           Case{R"("tool": "run", "job": "job.json")", "there is no tool 'run' for a job"},
           Case{R"("input": "made.ply")", "step 2: key 'tool' must name one"},
           Case{R"("tool": "surface", "inputs": ["made.ply"], "o": "x.ply")",
                "step 2 (surface): there is no key 'inputs'; did you mean 'input'?"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "--blend": 2)", "did you mean 'blend'?"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "help": true)", "there is no key 'help'"},
           Case{R"("tool": "surface", "o": "x.ply")", "key 'input' is missing"},
           Case{R"("tool": "surface", "input": "made.ply")", "'output' is required"},
           Case{R"("tool": "sort", "input": "made.ply")", "'output' is required"},
           Case{R"("tool": "surface", "input": "made.ply", "o": 7)", "key 'o' takes a list of a name in quotes, not 7"},
           Case{R"("tool": "surface", "input": [], "o": "x.ply")", "key 'input' is an empty list"},
           Case{R"("tool": "surface", "input": "a\u0000b", "o": "x.ply")", "key 'input' holds a zero byte"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "diffuse": 1)", "takes true or false, not 1"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "blend": null)", "takes H|auto, not null"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "blend": [1, 2])", "takes one value (H|auto)"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "blend": "wide")",
                "key 'blend': wide: is neither a number nor auto"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "particlescale": "x")",
                "key 'particlescale' cannot be \"x\"; it takes K"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "frame": "up")",
                "key 'frame' cannot be \"up\"; it takes pca|axis"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "threads": 5000)",
                "key 'threads': Value 5000 not in range 0 to 4096"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "resume": true)",
                "'resume' requires 'checkpoint'"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "output": "y.ply")",
                "key 'output' says the same as 'o'"},
           Case{R"("tool": "surface", "input": "made.ply", "o": "x.ply", "o": "y.ply")",
                "step 2: key 'o' stands twice"},
           Case{R"("tool": "surface", "input": "none.ply", "o": "x.ply")",
                "key 'input': none.ply is not there, and no step before writes it", 3},
       }) {
    const Outcome outcome = second(c.step);
    EXPECT_EQ(outcome.code, c.code) << c.step << "\n" << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("job.json: step 2"));
    EXPECT_THAT(outcome.err, HasSubstr(c.said)) << c.step;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "made.ply"));
}

TEST(Job, FilesThatAreNoJobs) {
  const JobFolder folder;
  struct Case {
    const char *text, *said;
    int code;
  };
  for (const Case& c : {
           Case{"", "is no job", 3},
           Case{"ply\n", "is no job", 3},
           Case{"{\"lamina_job\": 1,\n \"steps\": [}", "is not JSON: parse error at line 2", 3},
           Case{"{\"steps\": []}", "key 'lamina_job' is missing", 2},
           Case{"{\"lamina_job\": 2, \"steps\": []}", "key 'lamina_job': this program knows version 1, not 2", 2},
           Case{"{\"lamina_job\": 1}", "key 'steps' must be a list", 2},
           Case{"{\"lamina_job\": 1, \"steps\": []}", "key 'steps' must be a list of at least one step", 2},
           Case{"{\"lamina_job\": 1, \"step\": []}", "there is no key 'step'; did you mean 'steps'?", 2},
           Case{"{\"lamina_job\": 1, \"steps\": [\"surface\"]}", "step 1: is not an object", 2},
       }) {
    const Outcome outcome = folder.run(c.text);
    EXPECT_EQ(outcome.code, c.code) << c.text;
    EXPECT_THAT(outcome.err, HasSubstr("lamina: job.json: ")) << c.text;
    EXPECT_THAT(outcome.err, HasSubstr(c.said)) << c.text;
  }
  EXPECT_EQ(folder.shell("lamina run none.json").code, 3);
  EXPECT_EQ(folder.shell("lamina run mesh.vdb").code, 3);
  EXPECT_EQ(folder.shell("lamina info scan.ply --print-job | lamina run -").code, 0);
}

}  // namespace
}  // namespace lamina::tools
