// Options that tools share, and the values that options take: one of a few words, a length, or several numbers in one
// word such as 1024x768 or 0.5,1,2.
#pragma once
#include <CLI/CLI.hpp>

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lamina/clean.h"
#include "lamina/length.h"
#include "lamina/normals.h"
#include "lamina/surface.h"

namespace lamina::tools {

/// Takes the words of `map`, whatever their case, for its values.
template <typename T>
CLI::CheckedTransformer words(const std::map<std::string, T>& map) {
  return CLI::CheckedTransformer(map, CLI::ignore_case);
}

/// The value of an option that takes a length (length.h); what cannot be read is a usage error naming the option.
Length length_of(const std::string& option, const std::string& text);
/// Adds an option that takes a length (length.h); what cannot be read is a usage error naming the option.
CLI::Option* add_length(CLI::App& app, const std::string& names, Length& value, const std::string& description);

/// Exactly `count` finite numbers between separators; nothing when the text is anything else.
std::optional<std::vector<double>> read_numbers(std::string_view text, char separator, std::size_t count);

/// How several numbers stand in one word.
struct NumbersForm {
  std::string shown;  ///< for the help, as in X,Y,Z
  std::size_t count = 1;
  char separator = ',';
};

/// Adds an option of that form.
CLI::Option* add_numbers(CLI::App& app, const std::string& name, const NumbersForm& form,
                         const std::string& description, const std::function<void(const std::vector<double>&)>& take);

/// An option that can be repeated, `take` being called once for each.
CLI::Option* add_repeated_numbers(CLI::App& app, const std::string& name, const NumbersForm& form,
                                  const std::string& description,
                                  const std::function<void(const std::vector<double>&)>& take);

/// An option that takes a number, or `auto` where the program chooses: `take` then gets nothing. `usual`: shown as the
/// default.
CLI::Option* add_number_or_auto(CLI::App& app, const std::string& name, const std::string& usual,
                                const std::string& description,
                                const std::function<void(const std::optional<double>&)>& take);

/// An option of `auto`, where the program chooses and `value` stays empty, `yes` and `no`.
CLI::Option* add_yes_no_or_auto(CLI::App& app, const std::string& name, std::optional<bool>& value,
                                const std::string& description);

/// Of a count: why its text cannot be one where it is below 0, which the conversion takes for a huge number.
std::string refuse_below_zero(const std::string& text);

// Options for what happens to points before they are reconstructed, shared by the tools that can: cleaning, and
// normals.

/// --clip, --every, --merge, --outliers, --neighbours, --spacing.
void add_clean_options(CLI::App& app, CleanSettings& settings, const std::string& group);

/// --align.
void add_align(CLI::App& tool, bool& align, const std::string& group);

/// --normals.
void add_normals_choice(CLI::App& tool, std::optional<NormalsChoice>& normals, const std::string& group);

/// --k, --radius, --viewpoint, --up, --flip.
void add_normals_options(CLI::App& tool, NormalsSettings& settings, const std::string& group);

// Options of `lamina surface` by subject.

/// The fit, and the octree's cells.
void add_fit_options(CLI::App& tool, SurfaceSettings& settings);
/// The mesh's holes.
void add_hole_options(CLI::App& tool, SurfaceSettings& settings, const std::string& group);
/// The grids written beside the mesh.
void add_volume_options(CLI::App& tool, VolumeExport& v);

}  // namespace lamina::tools
