// The input of a reconstruction: points opened, their normals found, cleaned and put into a store; the samples that
// cleaning leaves out, as a point file beside the mesh.
#pragma once
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lamina/frame.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "lamina/surface.h"
#include "samples/cleaning.h"
#include "samples/support_field.h"
#include "store/ingest.h"

namespace lamina {

struct Job;

/// A cloud in its store, with what is known of where it came from.
struct StoredCloud {
  PointSourceInfo info;
  Frame frame;
  Ingested ingested;
  std::optional<CloudSurvey> survey{};           ///< where it has been made already
  std::optional<std::array<double, 3>> shift{};  ///< what comes out is less this: SurfaceSettings::local
};

/// Files and folders that the settings name, as one list.
std::vector<std::string> input_names(const SurfaceSettings& settings);

/// The names of the mesh's files, the first first.
std::vector<std::string> output_names(const SurfaceSettings& settings);

/// What messages call the input.
std::string input_name(const SurfaceSettings& settings);

/// Whether the settings name one input, and that is a kept one (is_kept_input()).
bool names_kept_input(const SurfaceSettings& settings);

/// Folder for temporary files: next to the output unless told otherwise; the system's for standard output, pipes and
/// devices.
std::string temporary_directory(const SurfaceSettings& settings, const RunContext& run);

/// A mesh in the place of its points would cost the user the scan. Throws Error(usage) where an output is one of the
/// inputs, or two outputs have one name.
void require_two_files(const SurfaceSettings& settings);

/// The frame asked for: the settings' own, else what suits what is wanted.
FrameMode chosen_frame(const SurfaceSettings& settings);

/// Opens everything named, as one stream; says what the readers found worth saying. Throws Error(unreadable) for
/// coordinates in degrees.
std::unique_ptr<PointSource> open_inputs(const SurfaceSettings& settings, const std::string& tmp_dir,
                                         const RunContext& run);

/// The source itself where its normals do, else with the ones found as settings.normals asks (job.stats.normals). In a
/// dry run, which asks for nothing but the plan, they are made up. Says what was found and warns of what is wrong.
std::unique_ptr<PointSource> choose_normals(std::unique_ptr<PointSource> source, const SurfaceSettings& settings,
                                            const std::string& tmp_dir, Job& job);

/// The source itself, or with its scans moved where the settings ask for it and that lets them agree
/// (job.stats.alignment). Says so.
std::unique_ptr<PointSource> choose_poses(std::unique_ptr<PointSource> source, const SurfaceSettings& settings,
                                          Job& job);

/// What the settings ask of normals in words: others where other normals come out.
std::string normals_words(const SurfaceSettings& settings);

/// The settings' input: a kept one is opened, others are read into a store at `place`. Normals are found and samples
/// left out on the way where the settings ask for it.
StoredCloud read_cloud(const SurfaceSettings& settings, const StorePlace& place, Job& job);

/// Everything that comes out, from here on, is less the middle of the cloud, rounded to a power of ten near its size:
/// few digits for people to copy.
void shift_to_origin(StoredCloud& cloud);

/// "4468300 847200 0", every digit of the numbers.
std::string shift_text(const std::array<double, 3>& shift);

/// Throws Error: usage for a name that says no format, budget for a file that cannot be written.
void try_rejected(const SurfaceSettings& settings);

/// Opens the file for samples of the cloud. Throws Error(usage) where their attributes have one called `reason`
/// already, and what open_points_writer() throws.
std::unique_ptr<PointsWriter> open_rejected(const StoredCloud& cloud, const SurfaceSettings& settings);

/// Appends the samples that have a reason: buckets along the sweep axis, in each the input's order.
void write_rejected(const StoredCloud& cloud, const Reasons& reasons, PointsWriter& writer);

// A cloud that has been read once and is kept: its store, and beside it what else a sweep must know.

/// Whether a folder holds a kept input.
bool is_kept_input(const std::string& directory);

/// Completes the folder that read_cloud() kept the store in. Throws Error(budget) when it cannot be written.
void save_input(const StoredCloud& input, const SurfaceSettings& settings, const std::string& directory);

/// Opens it. Throws Error(unreadable) naming the file that is damaged or of another version, Error(usage) where the
/// settings ask for another frame, other samples or other radii than the input was read with.
StoredCloud open_kept_input(const std::string& directory, const SurfaceSettings& settings);

/// A name of the kept input's contents: other samples, another frame, another name.
std::string kept_input_id(const std::string& directory);

}  // namespace lamina
