// The options of cleaning, shared by the tools that can.
#pragma once
#include <CLI/CLI.hpp>
#include <string>

#include "lamina/clean.h"

namespace lamina::tools {

/// --clip, --every, --merge, --outliers, --neighbours, --spacing.
void add_clean_options(CLI::App& app, CleanSettings& settings, const std::string& group);

}  // namespace lamina::tools
