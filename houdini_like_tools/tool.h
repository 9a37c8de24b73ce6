// A sub-command of `lamina`: options in, settings out. Each tool is one file and stands in main.cpp's list.
#pragma once
#include <CLI/CLI.hpp>

namespace lamina::tools {

/// Adds the tool's sub-command to the program `app`: name, options in groups, and a callback that does the work.
/// The callback throws lamina::Error; what tools share lies in common/.
void add_surface(CLI::App& app);
void add_scatter(CLI::App& app);
void add_compare(CLI::App& app);
void add_check(CLI::App& app);
void add_render(CLI::App& app);
void add_view(CLI::App& app);
void add_volume(CLI::App& app);
void add_info(CLI::App& app);
void add_measure(CLI::App& app);
void add_convert(CLI::App& app);
void add_merge(CLI::App& app);
void add_clean(CLI::App& app);
void add_clip(CLI::App& app);
void add_simplify(CLI::App& app);
void add_tiles(CLI::App& app);
void add_transform(CLI::App& app);
void add_sort(CLI::App& app);
void add_normal(CLI::App& app);
void add_radius(CLI::App& app);
void add_attribtransfer(CLI::App& app);
/// Not in the help: made for packagers.
void add_completion(CLI::App& app);
void add_man(CLI::App& app);

}  // namespace lamina::tools
