#include "reconstruct/stored_cloud.h"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/number.h"
#include "base/output_file.h"
#include "lamina/error.h"
#include "meshes/mesh_sink.h"
#include "samples/cleaning.h"

namespace lamina {
namespace {

using Json = nlohmann::json;

constexpr const char* kName = "store.json";
constexpr const char* kFormat = "lamina store";
constexpr int kVersion = 1;

std::string path_in(const std::string& directory) {
  return directory + "/" + kName;
}

Json to_json(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

Eigen::Vector3d vector_from(const Json& j) {
  return {j.at(0).get<double>(), j.at(1).get<double>(), j.at(2).get<double>()};
}

Json to_json(const PointSourceInfo& info) {
  Json attributes = Json::array();
  for (const AttributeSpec& a : info.attributes) attributes.push_back({{"name", a.name}, {"type", ply_name(a.type)}});
  return {{"path", info.path},
          {"rows", info.count},
          {"found_normals", info.found_normals},
          {"radius", info.has_radius},
          {"quality", info.has_quality},
          {"crs", info.crs},
          {"scans_told", tells_scans(info)},
          {"attributes", attributes}};
}

PointSourceInfo info_from(const Json& j) {
  PointSourceInfo info;
  info.path = j.at("path").get<std::string>();
  info.count = j.at("rows").get<std::uint64_t>();
  info.has_normals = true;
  info.found_normals = j.value("found_normals", false);  // older stores do not say
  info.has_radius = j.at("radius").get<bool>();
  info.has_quality = j.at("quality").get<bool>();
  info.crs = j.value("crs", std::string());  // older stores have none
  info.scans_told = j.value("scans_told", false);
  for (const Json& a : j.at("attributes")) {
    const auto type = ply_type(a.at("type").get<std::string>());
    if (!type) throw std::invalid_argument("type");
    info.attributes.push_back({a.at("name").get<std::string>(), *type});
  }
  return info;
}

Json to_json(const Frame& frame) {
  Json rows = Json::array();
  for (int r = 0; r < 3; ++r) rows.push_back(to_json(Eigen::Vector3d(frame.rotation.row(r))));
  return {{"origin", to_json(frame.origin)}, {"rotation", rows}, {"step", frame.step}};
}

Frame frame_from(const Json& j) {
  Frame frame;
  frame.origin = vector_from(j.at("origin"));
  for (int r = 0; r < 3; ++r) frame.rotation.row(r) = vector_from(j.at("rotation").at(static_cast<std::size_t>(r)));
  frame.step = j.at("step").get<double>();
  return frame;
}

Json to_json(const Census& c) {
  return {{"usable", c.usable},    {"rejected", c.rejected},  {"first_row", c.first_row},
          {"low", to_json(c.low)}, {"high", to_json(c.high)}, {"unusable_attributes", c.unusable_attributes}};
}

Census census_from(const Json& j) {
  Census c;
  c.usable = j.at("usable").get<std::uint64_t>();
  c.rejected = j.at("rejected").get<std::array<std::uint64_t, kDefects>>();
  c.first_row = j.at("first_row").get<std::array<std::uint64_t, kDefects>>();
  c.low = vector_from(j.at("low"));
  c.high = vector_from(j.at("high"));
  c.unusable_attributes = j.at("unusable_attributes").get<std::uint64_t>();
  return c;
}

/// How the settings ask for the input to be read.
Json reading(const SurfaceSettings& settings, bool has_radius) {
  const FrameMode frame = chosen_frame(settings);
  return {{"frame", frame == FrameMode::pca ? "pca" : "axis"},
          {"bad_samples", settings.bad_samples == BadSamples::drop ? "drop" : "refuse"},
          {"normals", normals_words(settings)},
          {"align", settings.align},
          {"cleaning", cleaning_words(settings.clean)},
          {"select", to_string(settings.reading.select)},
          {"particlescale", has_radius ? settings.radius_scale : 1.0}};
}

bool is_asked_for(const std::string& key, const SurfaceSettings& settings) {
  if (key == "bad_samples") return false;
  if (key == "normals") return settings.normals && settings.normals != NormalsChoice::file;
  if (key == "align") return settings.align;
  if (key == "cleaning") return !cleaning_words(settings.clean).empty();
  if (key == "select") return to_string(settings.reading.select) != to_string(PointSelection{});
  return key != "frame" || settings.frame || settings.volume.wanted();
}

void require_same_reading(const Json& stored, const SurfaceSettings& settings, bool has_radius,
                          const std::string& directory) {
  const Json wanted = reading(settings, has_radius);
  for (const auto& [key, value] : wanted.items()) {
    if (!is_asked_for(key, settings)) continue;
    // Older stores know nothing of cleaning: nothing has been left out of them.
    const Json had = stored.value(key, Json(std::string()));
    if (had == value) continue;
    if (key == "cleaning") {
      const auto words = had.get<std::string>();
      throw Error(ExitCode::usage,
                  fmt::format("{}: was stored {}, not with {}; give 'lamina sort --store' these "
                              "options for another store, or leave them away",
                              directory, words.empty() ? "uncleaned" : "with " + words, value.get<std::string>()));
    }
    if (key == "select") {
      throw Error(ExitCode::usage,
                  fmt::format("{}: holds other points than are asked for; give 'lamina sort --store' the "
                              "options that select them, or leave them away",
                              directory));
    }
    throw Error(ExitCode::usage,
                fmt::format("{}: was stored with --{} {}, not {}; make another store, or leave the option away",
                            directory, key, had.dump(), value.dump()));
  }
}

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) throw Error(ExitCode::unreadable, fmt::format("{}: cannot be read", path));
  return std::move(text).str();
}

}  // namespace

bool is_kept_input(const std::string& directory) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path_in(directory), ignored);
}

void save_input(const StoredCloud& input, const SurfaceSettings& settings, const std::string& directory) {
  const Extent& e = input.ingested.extent;
  const Json j{{"format", kFormat},
               {"version", kVersion},
               {"program", sink_signature()},
               {"input", to_json(input.info)},
               {"frame", to_json(input.frame)},
               {"extent", {e.x_min, e.x_max, e.y_min, e.y_max, e.z_min, e.z_max}},
               {"census", to_json(input.ingested.census)},
               {"read_with", reading(settings, input.info.has_radius)},
               {"index_checksum", input.ingested.store.save()}};
  const std::string text = j.dump(2) + "\n";
  OutputFile file(path_in(directory), {});
  if (const int error = write_all(file.fd(), text.data(), text.size()); error != 0)
    report_write_error(file.name(), error);
  file.publish();
}

StoredCloud open_kept_input(const std::string& directory, const SurfaceSettings& settings) {
  const std::string path = path_in(directory);
  const std::string text = read_text(path);
  PointSourceInfo info;
  Frame frame;
  Extent extent;
  Census census;
  Json read_with;
  std::uint32_t checksum = 0;
  try {
    const Json j = Json::parse(text);
    if (j.at("format") != kFormat) throw std::invalid_argument("format");
    if (j.at("version") != kVersion) {
      throw Error(ExitCode::unreadable, fmt::format("{}: is of version {}, this program reads version {}; make the "
                                                    "store again",
                                                    path, j.at("version").dump(), kVersion));
    }
    info = info_from(j.at("input"));
    frame = frame_from(j.at("frame"));
    const auto e = j.at("extent").get<std::array<std::int32_t, 6>>();
    extent = Extent{{e[0], e[1], e[2], e[3]}, e[4], e[5]};
    census = census_from(j.at("census"));
    read_with = j.at("read_with");
    checksum = j.at("index_checksum").get<std::uint32_t>();
  } catch (const Error&) {
    throw;
  } catch (const std::exception&) {
    throw Error(ExitCode::unreadable, fmt::format("{}: is damaged; make the store again", path));
  }
  require_same_reading(read_with, settings, info.has_radius, directory);
  SlabStore store = SlabStore::open(directory, {info.has_radius, info.has_quality, info.attributes});
  if (store.checksum() != checksum)
    throw Error(ExitCode::unreadable,
                fmt::format("{}: is not the one of the index beside it; make the store again", path));
  return {info, frame, {std::move(store), extent, census, true}};
}

std::string kept_input_id(const std::string& directory) {
  return read_text(path_in(directory));
}

}  // namespace lamina
