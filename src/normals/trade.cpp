#include "lamina/normals.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace lamina {
namespace {

bool has_attribute(const PointSourceInfo& info, std::string_view name) {
  return std::any_of(info.attributes.begin(), info.attributes.end(),
                     [&](const AttributeSpec& a) { return a.name == name; });
}

}  // namespace

TradeGuess guess_trade(const PointSourceInfo& info) {
  const bool stations = std::any_of(info.scans.begin(), info.scans.end(),
                                    [](const ScanPart& scan) { return scan.scanner == ScanPart::Scanner::position; });
  if (stations) return {Trade::terrestrial, "the file tells where its scanner stood"};
  if (info.from_above) return {Trade::aerial, "wide and flat, with returns or classes of surveys from the air"};
  if (has_attribute(info, "red") && !has_attribute(info, "intensity"))
    return {Trade::photogrammetry, "colours and no intensity"};
  return {Trade::object, "nothing tells of anything else"};
}

std::string describe(const TradeGuess& guess) {
  return fmt::format("taken for --preset {} ({}){}; give --preset to have all it sets, or another of {}",
                     kTradeNames.at(static_cast<std::size_t>(guess.trade)), guess.because,
                     guess.trade == Trade::aerial ? ": normals that are found face up" : "",
                     fmt::join(kTradeNames, ", "));
}

void face_by_trade(Trade trade, NormalsSettings& settings) {
  if (trade == Trade::aerial && settings.viewpoints.empty() && !settings.pose_origins)
    settings.viewpoints.push_back({{0, 0, 1}, true});
}

}  // namespace lamina
