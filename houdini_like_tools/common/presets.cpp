#include "common/presets.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <map>

#include "common/options.h"

namespace lamina::tools {
namespace {

bool is_given(const CLI::App& tool, std::string_view name) {
  if (name.empty()) return false;
  const CLI::Option* option = tool.get_option_no_throw(std::string(name));
  return option != nullptr && option->count() > 0;
}

/// "--up 0,0,1", or "--strays" alone.
std::string words_of(const PresetRow& row, std::string_view value) {
  return value == "true" ? std::string(row.option) : fmt::format("{} {}", row.option, value);
}

}  // namespace

const std::vector<PresetRow>& preset_table() {
  using Part = PresetPart;
  // docs/presets.md says why each value is what it is.
  // clang-format off
  static const std::vector<PresetRow> table{
      //                                                 object  terrestrial  aerial          handheld  photogrammetry
      {"--viewpoint",   "--up",         Part::points,   {"",     "pose",      "",             "",       ""}},
      {"--up",          "--viewpoint",  Part::points,   {"",     "",          "0,0,1",        "",       ""}},
      {"--drop-class",  "--keep-class", Part::points,   {"",     "7,18",      "7,13,14,18",   "",       ""}},
      {"--merge",       "",             Part::cleaning, {"",     "0",         "0",            "",       ""}},
      {"--strays",      "",             Part::cleaning, {"true", "true",      "true",         "true",   "true"}},
      {"--max-radius",  "",             Part::mesh,     {"",     "30r",       "",             "",       ""}},
      {"--density",     "",             Part::mesh,     {"",     "",          "",             "32",     ""}},
      {"--close-holes", "",             Part::mesh,     {"300",  "60",        "300",          "300",    "300"}},
      {"--watertight",  "",             Part::mesh,     {"auto", "no",        "no",           "auto",   "no"}},
      {"--prune",       "--prune-size", Part::parts_of_mesh, {"auto", "auto", "auto",         "auto",   "1000"}},
  };
  // clang-format on
  return table;
}

void add_preset(CLI::App& tool, std::optional<Trade>& preset, const std::string& group) {
  std::map<std::string, Trade> trades;
  for (std::size_t k = 0; k < kTradeNames.size(); ++k) trades.emplace(kTradeNames[k], static_cast<Trade>(k));
  tool.add_option_function<std::string>(
          "--preset", [&preset, trades](const std::string& name) { preset = trades.at(name); },
          "Set what a trade wants, and print it; options given by hand win. Without, the program guesses the trade by "
          "the files, says so, and turns normals that it finds accordingly")
      ->check(CLI::IsMember(std::vector<std::string>(kTradeNames.begin(), kTradeNames.end())).description(""))
      ->type_name(fmt::format("{}", fmt::join(kTradeNames, "|")))
      ->group(group);
}

void apply_preset(CLI::App& tool, Trade preset, const std::function<bool(PresetPart)>& takes, const RunContext& run) {
  std::vector<std::string> chosen, given;
  for (const PresetRow& row : preset_table()) {
    const std::string_view value = row.values.at(static_cast<std::size_t>(preset));
    CLI::Option* option = tool.get_option_no_throw(std::string(row.option));
    if (value.empty() || option == nullptr || !takes(row.part)) continue;
    if (is_given(tool, row.option) || is_given(tool, row.rival)) {
      given.emplace_back(is_given(tool, row.option) ? row.option : row.rival);
      continue;
    }
    option->add_result(std::string(value));
    option->run_callback();
    chosen.push_back(words_of(row, value));
  }
  run.info(fmt::format("preset {}: {}{}", kTradeNames.at(static_cast<std::size_t>(preset)), fmt::join(chosen, " "),
                       given.empty() ? std::string() : fmt::format("; by hand: {}", fmt::join(given, " "))));
}

}  // namespace lamina::tools
