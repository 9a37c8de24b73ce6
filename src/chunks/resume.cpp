#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "base/descriptor.h"
#include "base/output_file.h"
#include "chunks/part_file.h"
#include "lamina/chunk.h"
#include "lamina/error.h"
#include "lamina/run.h"
#include "reconstruct/job.h"
#include "reconstruct/stored_cloud.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

constexpr const char* kDescription = "checkpoint";
constexpr const char* kLock = "lock";
constexpr std::string_view kFirstLine = "lamina checkpoint 1\n";

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw Error(ExitCode::usage, fmt::format("{}: {}", path, why));
}

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return std::move(text).str();
}

/// What a killed run was writing.
bool is_unfinished(const std::string& name) {
  return name.starts_with(".") && name.find(".partial-") != std::string::npos;
}

bool is_ours(const std::string& name) {
  return name == kDescription || name == kLock || name == "store" || is_unfinished(name) ||
         (name.starts_with("part_") && name.ends_with(".lmesh"));
}

std::vector<std::string> names_in(const std::string& path) {
  std::vector<std::string> names;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(path, error))
    names.push_back(entry.path().filename().string());
  return names;
}

std::string first_difference(const std::string& a, const std::string& b) {
  std::istringstream left(a), right(b);
  for (std::string l, r; std::getline(left, l);) {
    if (!std::getline(right, r) || l != r) return l;
  }
  return "the number of inputs";
}

/// The folder that a run which can go on keeps its store and its finished parts in.
class CheckpointFolder {
 public:
  /// Makes the folder, or enters the one there is. `run`: the settings and inputs it is for, lines of KEY VALUE.
  /// Throws Error(usage) for a folder of another run, of any run unless `resume`, with other files, or in use by
  /// another program; Error(budget) when it cannot be written.
  CheckpointFolder(const std::string& path, const std::string& run, bool resume);
  CheckpointFolder(const CheckpointFolder&) = delete;
  CheckpointFolder& operator=(const CheckpointFolder&) = delete;

  [[nodiscard]] bool resumed() const { return resumed_; }  ///< there was something
  [[nodiscard]] std::string store() const { return path_ + "/store"; }
  [[nodiscard]] std::string part(int number) const;
  [[nodiscard]] const std::string& path() const { return path_; }
  /// Removes all that belongs to it, and the folder unless the user has put something else there.
  void remove();

 private:
  std::string path_;
  Descriptor lock_;
  bool resumed_ = false;
};

CheckpointFolder::CheckpointFolder(const std::string& path, const std::string& run, bool resume) : path_(path) {
  while (path_.size() > 1 && path_.back() == '/') path_.pop_back();
  std::error_code error;
  if (path_.empty()) refuse("--checkpoint", "names no folder");
  if (fs::exists(path_, error) && !fs::is_directory(path_, error)) refuse(path_, "is no folder");
  if (!fs::exists(path_, error) && !fs::create_directories(path_, error))
    throw Error(ExitCode::budget, fmt::format("{}: cannot be made: {}", path_, error.message()));
  for (const std::string& name : names_in(path_)) {
    if (!is_ours(name))
      refuse(path_, fmt::format("holds other files ({}); give --checkpoint a folder of its own", name));
  }
  lock_ = Descriptor(::open((path_ + "/" + kLock).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
  if (!lock_) throw Error(ExitCode::budget, fmt::format("{}: cannot be written: {}", path_, system_message(errno)));
  if (::flock(lock_.get(), LOCK_EX | LOCK_NB) != 0) refuse(path_, "another run is using this checkpoint");

  const std::string description = path_ + "/" + kDescription;
  const std::string text = std::string(kFirstLine) + run;
  resumed_ = fs::exists(description, error);
  if (resumed_) {
    const std::string found = read_text(description);
    if (!found.starts_with(kFirstLine))
      refuse(path_, "is the checkpoint of another version of lamina; remove it to begin anew");
    if (found != text) {
      refuse(path_, fmt::format("is the checkpoint of another run (there: {}); give the inputs and settings it was "
                                "made with, or remove it to begin anew",
                                first_difference(found, text)));
    }
    if (!resume)
      refuse(path_, "is the checkpoint of a run that did not end; add --resume to go on, or remove it to begin anew");
  }
  for (const std::string& name : names_in(path_)) {
    // Without a description nothing else counts.
    if (is_unfinished(name) || (!resumed_ && name != kLock)) fs::remove_all(path_ + "/" + name, error);
  }
  if (resumed_) return;
  OutputFile file(description, {});
  if (const int failed = write_all(file.fd(), text.data(), text.size()); failed != 0)
    report_write_error(file.name(), failed);
  file.publish();
}

std::string CheckpointFolder::part(int number) const {
  return fmt::format("{}/part_{:04}.lmesh", path_, number);
}

void CheckpointFolder::remove() {
  std::error_code ignored;
  // The description goes first: what is left, should the program be killed here, is then no checkpoint any more.
  fs::remove(path_ + "/" + kDescription, ignored);
  for (const std::string& name : names_in(path_)) {
    if (is_ours(name)) fs::remove_all(path_ + "/" + name, ignored);
  }
  fs::remove(path_, ignored);
}

/// A part at least for so many samples, some ten seconds' work.
constexpr std::uint64_t kSamplesPerPart = 2'000'000;
constexpr std::uint64_t kFewestParts = 4, kMostParts = 64;

std::string describe_file(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) throw Error(ExitCode::unreadable, fmt::format("{}: cannot be read", path));
  return fmt::format("input {} of {} bytes, changed {}.{:09}\n", std::filesystem::absolute(path).string(),
                     status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec);
}

/// What a checkpoint is for: with anything else than this it is of no use.
std::string describe_run(const SurfaceSettings& settings) {
  std::string text = fmt::format("lamina {}\n{}", version(), mesh_settings(settings));
  if (names_kept_input(settings)) return text + describe_file(settings.input + "/store.json");
  for (const PointInput& input : expand_inputs(input_names(settings))) {
    if (input.path == "-") {
      throw Error(ExitCode::usage,
                  "standard input cannot be read again after a kill: give --checkpoint a file, or a "
                  "store made by 'lamina sort - --store DIR'");
    }
    text += describe_file(input.path);
    for (const auto& row : input.pose) {
      if (input.posed) text += fmt::format("pose {} {} {} {}\n", row[0], row[1], row[2], row[3]);
    }
  }
  return text;
}

/// The input as it lies in the checkpoint; read into it where it does not.
StoredCloud open_input(const SurfaceSettings& settings, const CheckpointFolder& folder, Job& job, std::string& id) {
  if (names_kept_input(settings)) {
    id = kept_input_id(settings.input);
    return open_kept_input(settings.input, settings);
  }
  if (!is_kept_input(folder.store())) {
    StagedFolder made(folder.store());
    {
      const StoredCloud cloud = read_cloud(settings, {made.hidden(), /*stays=*/true}, job);
      job.watch.time("store", [&] { save_input(cloud, settings, made.hidden()); });
    }
    made.publish();
  }
  id = kept_input_id(folder.store());
  StoredCloud cloud = open_kept_input(folder.store(), settings);
  cloud.info.path = settings.input;
  return cloud;
}

/// Whether a part is there and whole; a damaged one is made again.
bool is_done(const PartSlabs::Part& part, int count, std::uint64_t job, const RunContext& run) {
  std::error_code ignored;
  if (!std::filesystem::exists(part.path, ignored)) return false;
  try {
    const PartInfo info = PartReader(part.path).info();
    return info.job == job && info.count == count && info.number == part.number && info.span == part.span;
  } catch (const Error& error) {
    run.warn(fmt::format("{}; it is made again", error.what()));
    return false;
  }
}

class ResumableRun {
 public:
  ResumableRun(const SurfaceSettings& settings, const Checkpoint& checkpoint, Job& job)
      : settings_(settings), job_(job), folder_(checkpoint.directory, describe_run(settings), checkpoint.resume) {}

  void finish() {
    try {
      reconstruct();
      join();
    } catch (const Error& error) {
      // Nothing to go on with, or nothing that going on would change.
      const bool useless = !any_part() && error.code() != ExitCode::internal;
      if (useless || error.code() == ExitCode::empty) {
        folder_.remove();
      } else {
        job_.run.info(fmt::format("{}: keeps what is done; the same command with --resume goes on", folder_.path()));
      }
      throw;
    }
    folder_.remove();
    job_.finish();
  }

 private:
  void reconstruct() {
    std::string id;
    StoredCloud cloud = open_input(settings_, folder_, job_, id);
    const ReconstructionPlan plan = plan_surface(settings_, cloud, job_);
    const SlabStore& store = cloud.ingested.store;
    const auto count = static_cast<int>(std::clamp(store.total() / kSamplesPerPart, kFewestParts, kMostParts));
    const std::uint64_t hash = job_hash(settings_, id, plan);
    const std::vector<SlabSpan> spans = cut(plan, store, count);
    std::vector<PartSlabs::Part> left;
    int done = 0;
    for (int number = 1; number <= count; ++number) {
      const PartSlabs::Part part{number, spans[static_cast<std::size_t>(number - 1)], folder_.part(number)};
      parts_.push_back(part.path);
      if (left.empty() && is_done(part, count, hash, job_.run)) {
        ++done;
      } else {
        left.push_back(part);
      }
    }
    if (folder_.resumed()) job_.run.info(fmt::format("{}: {} of {} parts are done", folder_.path(), done, count));
    if (left.empty()) return;
    const SlabSpan span{left.front().span.begin, plan.slabs.end};
    PartSlabs slabs(std::move(left), count, hash, plan.holes, plan.simplify.deviation, mesh_layout(plan));
    if (!span.empty()) sweep(plan, cloud, span, {slabs}, job_);
    slabs.finish();
  }

  [[nodiscard]] bool any_part() const {
    std::error_code ignored;
    return std::any_of(parts_.begin(), parts_.end(),
                       [&](const std::string& part) { return std::filesystem::exists(part, ignored); });
  }

  void join() {
    try {
      job_.watch.time("commit", [&] {
        const MergedParts merged =
            merge_parts(parts_, output_names(settings_), job_.run,
                        settings_.simplify.wanted() ? std::optional(settings_.simplify) : std::nullopt);
        job_.stats.vertices = merged.vertices;
        job_.stats.triangles = merged.triangles;
        job_.stats.holes = merged.holes;
        job_.stats.simplified = merged.simplified;
      });
    } catch (const Error& error) {
      if (error.code() != ExitCode::unreadable) throw;
      throw Error(error.code(), fmt::format("{}; remove it and go on with --resume", error.what()));
    }
  }

  const SurfaceSettings& settings_;
  Job& job_;
  CheckpointFolder folder_;
  std::vector<std::string> parts_;
};

}  // namespace

SurfaceStats reconstruct_resumable(const SurfaceSettings& settings, const Checkpoint& checkpoint,
                                   const RunContext& run) {
  check_settings(settings);
  require_mesh_alone(settings, "--checkpoint");
  require_two_files(settings);
  for (const std::string& output : output_names(settings)) const OutputFile trial(output, run.tmp_dir);
  Job job(run);
  run_in_arena(job, [&] { ResumableRun(settings, checkpoint, job).finish(); });
  return job.stats;
}

}  // namespace lamina
