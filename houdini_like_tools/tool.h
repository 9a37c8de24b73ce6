// A sub-command of `lamina`: options in, settings out. Each tool is one file and registers itself in main.cpp's list.
#pragma once
#include <CLI/CLI.hpp>
#include <functional>

namespace lamina::tools {

/// Adds the sub-command's options to `app` and sets its callback; the callback throws lamina::Error.
void add_surface(CLI::App& app);
void add_scatter(CLI::App& app);
void add_compare(CLI::App& app);
void add_check(CLI::App& app);
void add_render(CLI::App& app);

}  // namespace lamina::tools
