#include "common/inputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>
#include <system_error>
#include <vector>

#include "common/text.h"
#include "lamina/error.h"

namespace lamina::tools {
namespace {

/// Whole numbers of 0 to 255 between commas, or none.
std::vector<int> classes_of(const std::string& option, const std::string& text) {
  std::vector<int> classes;
  if (text == "none") return classes;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    int number = -1;
    const auto [stop, error] = std::from_chars(text.data() + at, text.data() + end, number);
    if (error != std::errc{} || stop != text.data() + end || number < 0 || number > 255) {
      throw CLI::ValidationError(option, fmt::format("'{}' is no list of classes, 0 to 255, as in 2,6", text));
    }
    classes.push_back(number);
    at = end + 1;
  }
  return classes;
}

PointCondition condition_of(const std::string& text) {
  try {
    return parse_condition(text);
  } catch (const Error& e) {
    throw CLI::ValidationError("--where", e.what());
  }
}

}  // namespace

std::string pipe_name(const std::string& name) {
  return name == "stdin.ply" || name == "stdout.ply" ? "-" : name;
}

void add_bad_samples(CLI::App& app, BadSamples& bad, const std::string& what) {
  const std::map<std::string, BadSamples> words{{"drop", BadSamples::drop}, {"refuse", BadSamples::refuse}};
  app.add_option_function<std::string>(
         "--bad-samples", [&bad, words](const std::string& word) { bad = words.at(word); },
         what + " that are not finite: leave out, or refuse the file [drop]")
      ->check(CLI::IsMember({"drop", "refuse"}).description(""))
      ->type_name("drop|refuse")
      ->group("Input");
}

void add_point_options(CLI::App& app, PointSettings& reading, const std::string& group) {
  PointSelection& select = reading.select;
  app.add_option(
         "--columns", reading.columns,
         "What the columns of text files hold: names as in x,y,z,nx,ny,nz,red:uchar,-, where - is a column to skip [by "
         "header line, else by the numbers]")
      ->type_name("NAMES")
      ->group(group);
  app.add_option_function<std::string>(
         "--keep-class", [&select](const std::string& text) { select.keep_classes = classes_of("--keep-class", text); },
         "Points of LAS and LAZ: only those of these classes, as in 2,6")
      ->type_name("N,...")
      ->group(group);
  app.add_option_function<std::string>(
         "--drop-class", [&select](const std::string& text) { select.drop_classes = classes_of("--drop-class", text); },
         "Points of LAS and LAZ: none of these classes; none: all stay [7,18, noise]")
      ->type_name("N,...|none")
      ->group(group);
  const std::map<std::string, PointSelection::Returns> returns{{"all", PointSelection::Returns::all},
                                                               {"first", PointSelection::Returns::first},
                                                               {"last", PointSelection::Returns::last}};
  app.add_option_function<std::string>(
         "--returns", [&select, returns](const std::string& word) { select.returns = returns.at(word); },
         "Points of LAS and LAZ: of a pulse's returns [all]")
      ->check(CLI::IsMember({"all", "first", "last"}).description(""))
      ->type_name("all|first|last")
      ->group(group);
  app.add_option("--resolution", select.resolution,
                 "Points of COPC: levels of its octree until points are at most this far apart [all]")
      ->check(CLI::PositiveNumber.description(""))
      ->type_name("LENGTH")
      ->group(group);
  app.add_option_function<std::vector<std::string>>(
         "--where",
         [&select](const std::vector<std::string>& texts) {
           for (const std::string& text : texts) select.where.push_back(condition_of(text));
         },
         "Only points with such a value, as in 'intensity>10'; of LAS also classification, return_number, "
         "number_of_returns, scan_angle, user_data, point_source, gps_time, class_flags, scanner_channel, "
         "scan_direction and edge_of_flight_line. Given again: all must hold")
      ->type_name("CONDITION")
      ->allow_extra_args(false)
      ->group(group);
  app.add_flag(
         "--project-degrees", reading.project_degrees,
         "x and y are degrees of longitude and latitude: take them to metres, by a transverse Mercator projection "
         "around the whole degrees next to the first point")
      ->group(group);
  app.add_flag("--ignore-checksums", reading.ignore_checksums,
               "Read pages of E57 files with wrong checksums, too: what can be saved")
      ->group(group);
}

std::unique_ptr<PointSource> open_point_input(const std::string& path, const PointSettings& reading,
                                              const RunContext& context) {
  PointSettings settings = reading;
  settings.tmp_dir = context.tmp_dir;
  settings.all_fields = true;
  std::unique_ptr<PointSource> source = open_points(path, settings);
  for (const std::string& remark : source->info().remarks) context.info(remark);
  return source;
}

std::string shown_name(const std::string& path) {
  return path == "-" ? "standard input" : path;
}

TriangleMesh read_mesh_input(const std::string& path, const RunContext& context, NonFinite non_finite) {
  const std::string name = pipe_name(path);
  if (name == "-") content_of(name, context.tmp_dir);
  // Positions become doubles, and most tools make a second mesh of the first.
  constexpr std::uintmax_t kBytesPerByte = 4;
  std::error_code unknown;
  const std::uintmax_t bytes = std::filesystem::file_size(name == "-" ? "/dev/stdin" : name, unknown);
  if (!unknown && context.max_memory > 0 && bytes > context.max_memory / kBytesPerByte) {
    throw Error(ExitCode::budget,
                fmt::format("{}: a mesh of {} needs up to {} of memory, --max-memory allows {}", shown_name(name),
                            bytes_text(bytes), bytes_text(kBytesPerByte * bytes), bytes_text(context.max_memory)));
  }
  return read_mesh(name, non_finite);
}

TriangleMesh read_mesh_input(const std::string& path, const RunContext& context, BadSamples bad) {
  if (bad == BadSamples::refuse) return read_mesh_input(path, context, NonFinite::refuse);
  TriangleMesh mesh = read_mesh_input(path, context, NonFinite::keep);
  if (const std::size_t dropped = drop_non_finite(mesh); dropped > 0) {
    context.warn(fmt::format("{}: {} {} not finite and left out, with the triangles there", shown_name(path),
                             count_text(dropped), dropped == 1 ? "vertex is" : "vertices are"));
  }
  return mesh;
}

SampleBatch vertices_of(const TriangleMesh& mesh) {
  SampleBatch rows;
  for (const auto& p : mesh.positions) {
    rows.x.push_back(p[0]);
    rows.y.push_back(p[1]);
    rows.z.push_back(p[2]);
  }
  for (const auto& n : mesh.normals) {
    rows.nx.push_back(n[0]);
    rows.ny.push_back(n[1]);
    rows.nz.push_back(n[2]);
  }
  rows.attributes = mesh.attributes;
  return rows;
}

}  // namespace lamina::tools
