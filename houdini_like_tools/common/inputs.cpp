#include "common/inputs.h"

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <system_error>

#include "common/text.h"
#include "lamina/error.h"

namespace lamina::tools {

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

void add_columns(CLI::App& app, std::string& columns, const std::string& group) {
  app.add_option(
         "--columns", columns,
         "What the columns of text files hold: names as in x,y,z,nx,ny,nz,red:uchar,-, where - is a column to skip [by "
         "header line, else by the numbers]")
      ->type_name("NAMES")
      ->group(group);
}

std::unique_ptr<PointSource> open_point_input(const std::string& path, const std::string& columns,
                                              const RunContext& context) {
  std::unique_ptr<PointSource> source = open_points(path, PointSettings{context.tmp_dir, columns});
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

}  // namespace lamina::tools
