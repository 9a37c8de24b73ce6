#include "reconstruct/stored_cloud.h"

#include <fmt/format.h>
#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <utility>
#include <vector>

#include "base/descriptor.h"
#include "lamina/attributes.h"
#include "lamina/error.h"
#include "lamina/normals.h"
#include "points/formats.h"
#include "reconstruct/job.h"
#include "samples/cleaning.h"
#include "store/ingest.h"

namespace lamina {
namespace {

/// Fills the store. A large input is read once, in a frame chosen by a part of its rows; twice where samples lie
/// outside what these promised.
StoredCloud ingest_all(PointSource& source, const SurfaceSettings& settings, const StorePlace& place, Job& job) {
  require_samples(source.info());
  const RowPick& pick = settings.clean.pick;
  std::optional<Survey> survey;
  const auto fill = [&] {
    const Frame frame = choose_frame(*survey, chosen_frame(settings));
    std::optional<Ingested> ingested;
    job.watch.time("store", [&] {
      ingested.emplace(ingest(source, *survey, frame, place, job.run, {settings.radius_scale, pick}));
    });
    return StoredCloud{source.info(), frame, std::move(*ingested)};
  };
  job.watch.time("survey", [&] { survey = survey_part(source, pick); });
  if (survey) {
    StoredCloud cloud = fill();
    if (cloud.ingested.complete) {
      judge(cloud.ingested.census, source.info(), settings.bad_samples, job.run);
      return cloud;
    }
  }
  job.watch.time("survey", [&] { survey = survey_input(source, settings.bad_samples, job.run, pick); });
  return fill();
}

/// What is to be left out before anything is measured.
void clean_cloud(StoredCloud& cloud, const SurfaceSettings& settings, const std::string& tmp, Job& job) {
  Ingested& in = cloud.ingested;
  CleanCounts& counts = job.stats.cleaned;
  counts.clipped = in.census.clipped;
  counts.skipped = in.census.skipped;
  Cleaning cleaning{settings.clean, cloud.frame.step, tmp};
  if (cloud.info.found_normals) cleaning.normals = SampleNormals::found;
  if (!settings.rejected.empty() && !settings.dry_run) {
    job.rejected = open_rejected(cloud, settings);
    cleaning.rejected = [&](const Reasons& reasons) { write_rejected(cloud, reasons, *job.rejected); };
  }
  if (settings.clean.looks_around()) {
    job.watch.time("clean", [&] { clean_ingested(in, cleaning, input_name(settings), counts, job.run); });
  }
  if (const std::string said = describe(counts); !said.empty())
    job.run.info(fmt::format("{} of {} samples left: {}", in.store.total(), cloud.info.count, said));
}

}  // namespace

std::string temporary_directory(const SurfaceSettings& settings, const RunContext& run) {
  if (!run.tmp_dir.empty()) return run.tmp_dir;
  std::error_code ignored;
  const auto kind = std::filesystem::status(settings.output, ignored).type();
  const bool beside = kind == std::filesystem::file_type::regular || kind == std::filesystem::file_type::not_found;
  if (settings.output.empty() || settings.output == "-" || !beside) return system_tmp_dir();
  const std::string parent = std::filesystem::path(settings.output).parent_path().string();
  return parent.empty() ? "." : parent;
}

std::vector<std::string> input_names(const SurfaceSettings& settings) {
  std::vector<std::string> names{settings.input};
  names.insert(names.end(), settings.more_inputs.begin(), settings.more_inputs.end());
  return names;
}

std::vector<std::string> output_names(const SurfaceSettings& settings) {
  std::vector<std::string> names{settings.output};
  names.insert(names.end(), settings.more_outputs.begin(), settings.more_outputs.end());
  return names;
}

std::string input_name(const SurfaceSettings& settings) {
  return settings.input == "-" ? "standard input" : settings.input;
}

bool names_kept_input(const SurfaceSettings& settings) {
  return !settings.open && settings.more_inputs.empty() && is_kept_input(settings.input);
}

void require_two_files(const SurfaceSettings& settings) {
  std::error_code ignored;
  const bool no_files = settings.open || names_kept_input(settings);
  const std::vector<PointInput> inputs = no_files ? std::vector<PointInput>{} : expand_inputs(input_names(settings));
  const auto is_input = [&](const std::string& name) {
    return std::filesystem::is_regular_file(name, ignored) &&
           std::any_of(inputs.begin(), inputs.end(),
                       [&](const PointInput& input) { return std::filesystem::equivalent(input.path, name, ignored); });
  };
  const std::vector<std::string> outputs = output_names(settings);
  const auto require_own = [&](const std::string& name, const char* what) {
    if (!name.empty() && (std::find(outputs.begin(), outputs.end(), name) != outputs.end() || is_input(name)))
      throw Error(ExitCode::usage, fmt::format("{}: is named twice; give {} a file of their own", name, what));
  };
  require_own(settings.volume.path, "the grids");
  require_own(settings.volume.points, "the grids");
  require_own(settings.rejected, "the samples left out");
  if (std::find(outputs.begin(), outputs.end(), settings.tiles.folder) != outputs.end() &&
      !settings.tiles.folder.empty())
    throw Error(ExitCode::usage,
                fmt::format("{}: is named twice; give the tiles a folder of their own", settings.tiles.folder));
  for (auto name = outputs.begin(); name != outputs.end(); ++name) {
    if (std::find(outputs.begin(), name, *name) != name)
      throw Error(ExitCode::usage, fmt::format("{}: is named twice; give each --output a name of its own", *name));
    if (*name != "-" && !name->empty() && is_input(*name)) {
      throw Error(ExitCode::usage,
                  fmt::format("{}: is input and output; give the mesh another name with --output", *name));
    }
  }
}

FrameMode chosen_frame(const SurfaceSettings& settings) {
  return settings.frame.value_or(settings.volume.wanted() ? FrameMode::axis : FrameMode::pca);
}

std::unique_ptr<PointSource> open_inputs(const SurfaceSettings& settings, const std::string& tmp_dir,
                                         const RunContext& run) {
  PointSettings reading = settings.reading;
  reading.tmp_dir = tmp_dir;
  const RowPick& pick = settings.clean.pick;
  if (pick.clip && pick.every <= 1) reading.select.box = {pick.clip->low, pick.clip->high};
  std::unique_ptr<PointSource> source =
      settings.open ? open_points(settings.open(), reading) : open_points(input_names(settings), reading);
  const PointSourceInfo& info = source->info();
  for (const std::string& remark : info.remarks) run.info(remark);
  require_no_degrees(info);
  if (settings.guess_trade) run.info(describe(guess_trade(info)));
  return source;
}

std::unique_ptr<PointSource> choose_poses(std::unique_ptr<PointSource> source, const SurfaceSettings& settings,
                                          Job& job) {
  // In a dry run normals that are found are made up.
  if (!settings.align || (settings.dry_run && source->info().found_normals)) return source;
  job.watch.time("align", [&] { source = align_scans(std::move(source), job.stats.alignment, job.run); });
  const ScanAlignment& found = job.stats.alignment;
  if (found.moved()) {
    job.run.info(
        fmt::format("{} scans moved by up to {:.2g}: where two see the same they were {:.2g} apart and are "
                    "{:.2g} (--keep-poses leaves them)",
                    found.scans, found.farthest, found.before, found.after));
  }
  return source;
}

std::string normals_words(const SurfaceSettings& settings) {
  if (settings.normals == NormalsChoice::file) return "file";
  // Every setting by name: one that is added must be dealt with here, or this does not compile.
  const auto& [mode, k, radius, viewpoints, scanners, pose_origins, flip, bad_samples] = settings.normal_search;
  (void)mode, (void)bad_samples;
  std::string words = settings.normals == NormalsChoice::estimate ? "estimate" : "auto";
  words += fmt::format(" k {} radius {} scanners {} poses {} flip {}", k, radius, scanners, pose_origins, flip);
  if (settings.guess_trade) words += " guessed";
  for (const Viewpoint& v : viewpoints)
    words += fmt::format(" {} {} {} {}", v.direction ? "towards" : "from", v.at[0], v.at[1], v.at[2]);
  return words;
}

StoredCloud read_cloud(const SurfaceSettings& settings, const StorePlace& place, Job& job) {
  if (names_kept_input(settings) && !place.keep) {
    if (!settings.rejected.empty()) {
      throw Error(ExitCode::usage,
                  fmt::format("{}: --rejected wants points; a store was cleaned when it was made", settings.input));
    }
    return open_kept_input(settings.input, settings);
  }
  const std::string scratch = place.keep ? temporary_directory(settings, job.run) : place.directory;
  std::unique_ptr<PointSource> source = open_inputs(settings, scratch, job.run);
  if (settings.normals != NormalsChoice::file) {
    job.watch.time("normals", [&] { source = choose_normals(std::move(source), settings, scratch, job); });
  }
  source = choose_poses(std::move(source), settings, job);
  StoredCloud cloud = ingest_all(*source, settings, place, job);
  clean_cloud(cloud, settings, scratch, job);
  return cloud;
}

void shift_to_origin(StoredCloud& cloud) {
  Census& census = cloud.ingested.census;
  const Eigen::Vector3d extent = census.high - census.low;
  const double power = std::floor(std::log10(extent.maxCoeff()));
  // Whole powers of ten are exact doubles, their inverses are not: fractions are made by dividing.
  const double whole = std::pow(10.0, std::abs(power));
  std::array<double, 3>& shift = cloud.shift.emplace();
  for (int k = 0; k < 3; ++k) {
    const double middle = census.low[k] + 0.5 * extent[k];
    const double rounded = power < 0 ? std::round(middle * whole) / whole : std::round(middle / whole) * whole;
    shift[static_cast<std::size_t>(k)] = std::isfinite(rounded) ? rounded + 0.0 : 0.0;
  }
  const Eigen::Vector3d by(shift[0], shift[1], shift[2]);
  cloud.frame.origin -= by;
  census.low -= by;
  census.high -= by;
}

std::string shift_text(const std::array<double, 3>& shift) {
  return fmt::format("{} {} {}", shift[0], shift[1], shift[2]);
}

namespace {

constexpr const char* kReasonName = "reason";

void append_sample(const LocalSamples& from, std::size_t i, const Frame& frame, SampleBatch& to) {
  const Eigen::Vector3d p = frame.to_world(Eigen::Vector3d(from.x[i], from.y[i], from.z[i]));
  to.x.push_back(p.x());
  to.y.push_back(p.y());
  to.z.push_back(p.z());
  const Eigen::Vector3d n =
      frame.rotation.transpose() * Eigen::Vector3f(from.nx[i], from.ny[i], from.nz[i]).cast<double>();
  to.nx.push_back(static_cast<float>(n.x()));
  to.ny.push_back(static_cast<float>(n.y()));
  to.nz.push_back(static_cast<float>(n.z()));
  if (!from.radius.empty()) to.radius.push_back(static_cast<float>(static_cast<double>(from.radius[i]) * frame.step));
  if (!from.quality.empty()) to.quality.push_back(from.quality[i]);
  for (std::size_t a = 0; a < from.attributes.size(); ++a) to.attributes[a].push_back(from.attributes[a][i]);
}

}  // namespace

void try_rejected(const SurfaceSettings& settings) {
  if (!settings.rejected.empty() && settings.rejected != "-") open_points_writer(settings.rejected, {});
}

std::unique_ptr<PointsWriter> open_rejected(const StoredCloud& cloud, const SurfaceSettings& settings) {
  PointColumns columns = columns_of(cloud.info);
  columns.normals = true;
  const bool taken = std::any_of(columns.attributes.begin(), columns.attributes.end(),
                                 [](const AttributeSpec& a) { return a.name == kReasonName; });
  if (taken) {
    throw Error(ExitCode::usage, fmt::format("{}: the points have an attribute called {} already; leave out --rejected",
                                             input_name(settings), kReasonName));
  }
  columns.attributes.push_back({kReasonName, ScalarType::uint8});
  PointsWriterSettings how;
  how.crs = cloud.info.crs;
  how.comments = {"reason 1: merged, 2: outlier, 3: stray far from others, 4: stray on no surface, 5: thinned out"};
  return open_points_writer(settings.rejected, columns, how);
}

void write_rejected(const StoredCloud& cloud, const Reasons& reasons, PointsWriter& writer) {
  const SlabStore& store = cloud.ingested.store;
  LocalSamples samples;
  for (std::size_t b = 0; b < reasons.size(); ++b) {
    if (std::all_of(reasons[b].begin(), reasons[b].end(), [](std::uint8_t r) { return r == 0; })) continue;
    store.read(b, samples);
    SampleBatch batch;
    batch.attributes.resize(samples.attributes.size());
    std::vector<float> why;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (reasons[b][i] == 0) continue;
      append_sample(samples, i, cloud.frame, batch);
      why.push_back(static_cast<float>(reasons[b][i]));
    }
    batch.attributes.push_back(std::move(why));
    writer.append(batch);
  }
}

}  // namespace lamina
