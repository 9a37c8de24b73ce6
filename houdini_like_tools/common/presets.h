// --preset: the options that a trade wants, as if they had been typed.
#pragma once
#include <CLI/CLI.hpp>
#include <array>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lamina/normals.h"
#include "lamina/run.h"

namespace lamina::tools {

/// What an option acts on. Some jobs cannot change some of it.
enum class PresetPart {
  points,    ///< which points are read, and how their normals are found: settled in a store
  cleaning,  ///< what is left out of them
  mesh,
  parts_of_mesh,  ///< what wants the whole mesh at once
};

/// An option and what every trade has it say; empty: nothing.
struct PresetRow {
  std::string_view option;
  std::string_view rival;  ///< another option that settles the same: given by hand, it wins as well
  PresetPart part;
  std::array<std::string_view, kTradeNames.size()> values;  ///< in the order of Trade
};

/// All that presets are.
const std::vector<PresetRow>& preset_table();

/// Adds --preset.
void add_preset(CLI::App& tool, std::optional<Trade>& preset, const std::string& group);

/// Gives the tool's options the values of the preset, as far as the tool has them, the user has not given them, and
/// `takes` allows; says which these are.
void apply_preset(CLI::App& tool, Trade preset, const std::function<bool(PresetPart)>& takes, const RunContext& run);

}  // namespace lamina::tools
