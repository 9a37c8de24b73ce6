#include "surface_fit.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "console.h"
#include "numbers.h"
#include "words.h"

namespace lamina::tools {
namespace {

/// 0 stands for as many as needed.
int steps_of(const std::optional<double>& number) {
  if (!number) return 0;
  if (!(*number >= 1 && *number <= 16) || *number != std::floor(*number))
    throw CLI::ValidationError("--steps", fmt::format("{:g}: is neither a whole number in 1..16 nor auto", *number));
  return static_cast<int>(*number);
}

}  // namespace

void add_fit_options(CLI::App& tool, SurfaceSettings& s) {
  const std::string fit = "Fit";
  add_number_or_auto(
      tool, "--blend", fmt::format("{:g}", *s.blend),
      "H: the influence radius R is H times a sample's radius r; auto: H, and --cell and --refit where these "
      "are not given, by the cloud's noise and the evenness of its sampling",
      [&s](const std::optional<double>& number) { s.blend = number; })
      ->group(fit);
  add_number_or_auto(
      tool, "--refit", "0, with --blend auto: auto",
      "first replace normals by those fitted to the samples within so many radii; 0: keep them; auto: keep "
      "them but for noise that --blend auto finds",
      [&s](const std::optional<double>& number) { s.refit = number; })
      ->group(fit);
  add_number_or_auto(tool, "--steps", "1", "N: projection steps; auto: as many as each corner needs",
                     [&s](const std::optional<double>& number) { s.steps = steps_of(number); })
      ->option_text("N|auto [1]")
      ->group(fit);
  tool.add_option("--step-tolerance", s.step_tolerance,
                  "with --steps auto: a corner is done when a step moves it no more than so many radii r")
      ->capture_default_str()
      ->group(fit);
  tool.add_option("--fit", s.fit, "surface fitted to the samples around a corner")
      ->transform(words<FitMode>({{"plane", FitMode::plane}, {"sphere", FitMode::sphere}}))
      ->option_text("plane|sphere [sphere]")
      ->group(fit);
  tool.add_flag("--diffuse", s.diffuse, "project cell centres and average them at the corners: smoother")->group(fit);

  const std::string lattice = "Octree";
  tool.add_option_function<std::string>(
          "--cell", [&s](const std::string& text) { s.cell = length_of("--cell", text); },
          "largest leaf cell: a length, or times the smallest r or R around")
      ->option_text("LENGTH [0.9R, with --blend auto: chosen]")
      ->group(lattice);
  tool.add_option("--levels", s.levels, "octree levels; 0: as the radii ask, at least 4")
      ->capture_default_str()
      ->group(lattice);
}

}  // namespace lamina::tools
