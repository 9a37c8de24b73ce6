// lamina.normals, lamina.radii, lamina.clean: what is found about points, as arrays with a row for each.
#include <fmt/format.h>

#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "arrays.h"
#include "common/console.h"
#include "common/inputs.h"
#include "common/options.h"
#include "functions.h"
#include "keywords.h"
#include "lamina/clean.h"
#include "lamina/edit.h"
#include "lamina/error.h"
#include "lamina/normals.h"
#include "lamina/point_radii.h"
#include "lamina/points.h"
#include "run.h"
#include "tables.h"

namespace lamina::python {
namespace {

/// The attribute that says which row a point was.
constexpr const char* kRow = "row of the input";

/// The same points, each with the number of its row.
class NumberedPoints final : public PointSource {
 public:
  explicit NumberedPoints(std::unique_ptr<PointSource> source) : source_(std::move(source)) {
    info_ = source_->info();
    info_.attributes.push_back({kRow, ScalarType::float64});
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    source_->read(first, count, out);
    const std::size_t before = source_->info().attributes.size();
    out.attributes.resize(before + 1);
    out.exact.resize(before + 1);
    out.attributes[before].resize(out.size());
    out.exact[before].resize(out.size());
    for (std::size_t i = 0; i < out.size(); ++i) {
      out.exact[before][i] = static_cast<double>(first + i);
      out.attributes[before][i] = static_cast<float>(first + i);
    }
  }

 private:
  std::unique_ptr<PointSource> source_;
};

/// Takes rows and tells each to whoever wants it, by its number.
class RowTaker final : public PointsWriter {
 public:
  using Take = std::function<void(std::size_t row, const SampleBatch& batch, std::size_t i)>;
  RowTaker(PointColumns columns, Take take) : PointsWriter(std::move(columns)), take_(std::move(take)) {}
  void append(const SampleBatch& batch) override {
    const std::vector<double>& rows = batch.exact.at(columns_.attributes.size() - 1);
    for (std::size_t i = 0; i < batch.size(); ++i) take_(static_cast<std::size_t>(rows[i]), batch, i);
    rows_ += batch.size();
  }
  void commit() override {}

 private:
  Take take_;
};

/// What the three have in common.
struct PointsCall {
  explicit PointsCall(const std::string& function) : words(function) {}
  /// Adds what is true of all, and takes the keywords.
  void parse(BadSamples& bad, const py::kwargs& keywords) {
    tools::add_point_options(words.app(), reading);
    tools::add_bad_samples(words.app(), bad);
    tools::add_run_options(words.app(), run);
    words.parse(keywords);
  }
  /// The points, as they are numbered in the result.
  [[nodiscard]] std::unique_ptr<PointSource> open(const PointArguments& input, const RunContext& context) const {
    PointSettings settings = reading;
    settings.tmp_dir = context.tmp_dir;
    std::unique_ptr<PointSource> source = input.are_arrays()
                                              ? open_points(std::make_unique<NumberedPoints>(input.view()), settings)
                                              : std::make_unique<NumberedPoints>(input.open(settings));
    for (const std::string& remark : source->info().remarks) context.info(remark);
    require_no_degrees(source->info());
    return source;
  }
  /// How many rows the result has: the points of arrays, whatever is selected of them, else those that are read.
  static std::size_t rows(const PointArguments& input, const PointSource& source) {
    return static_cast<std::size_t>(input.are_arrays() ? input.count() : source.info().count);
  }

  Keywords words;
  tools::RunOptions run;
  PointSettings reading;
};

py::array normals(const py::object& points, const py::object& given, const py::dict& attributes,
                  const py::object& progress, const py::kwargs& keywords) {
  PointsCall call("normals");
  tools::NormalFinding finding;
  call.words.leave_out({"check"});
  tools::add_normal_finding(call.words.app(), finding);
  call.parse(finding.settings.bad_samples, keywords);
  const PointArguments input(points, given, py::none(), attributes);
  std::vector<std::array<float, 3>> found;
  run_job(call.run, progress, [&](const RunContext& context) {
    NormalsSettings settings = tools::normals_settings(call.words.app(), finding, context);
    std::unique_ptr<PointSource> source = call.open(input, context);
    if (!finding.preset) tools::guess_facing(source->info(), settings, context);
    found.resize(PointsCall::rows(input, *source));
    PointColumns columns = columns_of(source->info());
    columns.normals = true;
    RowTaker taker(columns, [&](std::size_t row, const SampleBatch& batch, std::size_t i) {
      found.at(row) = {batch.nx[i], batch.ny[i], batch.nz[i]};
    });
    NormalsReport report;
    source = with_normals(std::move(source), settings, report, context);
    warn_of_bad_rows(edit_points(*source, taker, {}, settings.bad_samples, context), PointArguments::kName, context);
    context.info(describe(report));
    warn_of_conflicts(report, PointArguments::kName, context);
  });
  return owning_array(std::move(found));
}

py::array radii(const py::object& points, const py::object& progress, const py::kwargs& keywords) {
  PointsCall call("radii");
  PointRadiiSettings settings;
  tools::add_radius_options(call.words.app(), settings);
  call.parse(settings.bad_samples, keywords);
  const PointArguments input(points, py::none(), py::none(), py::dict());
  std::vector<float> found;
  run_job(call.run, progress, [&](const RunContext& context) {
    const std::unique_ptr<PointSource> source = call.open(input, context);
    found.resize(PointsCall::rows(input, *source));
    PointColumns columns = columns_of(source->info());
    columns.radius = "radius";
    RowTaker taker(columns,
                   [&](std::size_t row, const SampleBatch& batch, std::size_t i) { found.at(row) = batch.radius[i]; });
    const PointRadiiReport report = write_point_radii(*source, taker, settings, context);
    warn_of_bad_rows(report.rows, PointArguments::kName, context);
  });
  return owning_array(std::move(found));
}

py::array clean(const py::object& points, const py::object& given, const py::object& radius, const py::dict& attributes,
                const py::object& progress, const py::kwargs& keywords) {
  PointsCall call("clean");
  CleanSettings settings;
  BadSamples bad = BadSamples::drop;
  tools::add_clean_options(call.words.app(), settings, "Cleaning");
  call.parse(bad, keywords);
  const PointArguments input(points, given, radius, attributes);
  std::vector<std::uint8_t> stays;
  run_job(call.run, progress, [&](const RunContext& context) {
    require_sane(settings);
    const std::unique_ptr<PointSource> source = call.open(input, context);
    stays.resize(PointsCall::rows(input, *source));
    RowTaker taker(columns_of(source->info()),
                   [&](std::size_t row, const SampleBatch&, std::size_t) { stays.at(row) = 1; });
    const CleanReport report = clean_points(*source, taker, settings, bad, context);
    warn_of_bad_rows(report.rows, PointArguments::kName, context);
    const std::string said = describe(report.counts);
    context.info(
        fmt::format("kept {} of {} points{}{}", report.rows.written, report.rows.read, said.empty() ? "" : ": ", said));
  });
  return owning_array(std::move(stays)).attr("view")("bool");
}

}  // namespace

void add_point_functions(py::module_& module) {
  const auto described = [&module](const char* text, const char* function, const auto& add) {
    PointsCall call(function);
    add(call.words.app());
    BadSamples bad{};
    call.words.leave_out({"check"});
    call.parse(bad, py::kwargs());
    call.words.list_in(module);
    return fmt::format("{}\n\nRaises lamina.Error, and TypeError or ValueError, as surface() does.\n\n{}", text,
                       call.words.describe());
  };
  tools::NormalFinding finding;
  PointRadiiSettings radius;
  CleanSettings cleaning;
  module.def("normals", &normals, py::arg("points"), py::arg("normals") = py::none(),
             py::arg("attributes") = py::dict(), py::kw_only(), py::arg("progress") = py::none(),
             described("Finds the normal of every point: (n, 3) float32 of length 1, 0 0 0 where there is none.\n\n"
                       "points: (n, 3) float32 or float64, or paths. normals: what is there already, for reorient and "
                       "missing.",
                       "normals", [&](CLI::App& app) { tools::add_normal_finding(app, finding); })
                 .c_str());
  module.def(
      "radii", &radii, py::arg("points"), py::kw_only(), py::arg("progress") = py::none(),
      described("Finds the influence radius of every point from the density around it: (n,) float32, in the units "
                "of the points; 0 for points that are not finite.\n\npoints: (n, 3) float32 or float64, or paths.",
                "radii", [&](CLI::App& app) { tools::add_radius_options(app, radius); })
          .c_str());
  module.def(
      "clean", &clean, py::arg("points"), py::arg("normals") = py::none(), py::arg("radius") = py::none(),
      py::arg("attributes") = py::dict(), py::kw_only(), py::arg("progress") = py::none(),
      described("Tells which points stay: (n,) bool, for points[stays].\n\nThe arguments are those of surface().",
                "clean", [&](CLI::App& app) { tools::add_clean_options(app, cleaning, "Cleaning"); })
          .c_str());
}

}  // namespace lamina::python
