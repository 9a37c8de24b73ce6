// What a cloud was recorded for, and with what: trades differ in what their clouds need.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "lamina/normals.h"
#include "lamina/points.h"

namespace lamina {

enum class Trade : std::uint8_t {
  object,          ///< a thing scanned from all sides, by a turntable, an arm or a structured light scanner
  terrestrial,     ///< rooms, facades, sites from scanners on tripods
  aerial,          ///< ground and roofs from planes and drones, by laser
  handheld,        ///< scanners carried along: many passes over the same places
  photogrammetry,  ///< dense points of photographs
};

/// In the order of Trade.
constexpr std::array<std::string_view, 5> kTradeNames{"object", "terrestrial", "aerial", "handheld", "photogrammetry"};

/// What a cloud looks like.
struct TradeGuess {
  Trade trade = Trade::object;
  std::string because;  ///< in words
};

/// By what the files tell of scanners, returns, classes, extent and colours. Handheld scans have no mark of their own:
/// they are taken for objects.
TradeGuess guess_trade(const PointSourceInfo& info);

/// What was guessed, what follows from it, and how to overrule it: a line for the user.
std::string describe(const TradeGuess& guess);

/// Clouds from the air face up where the settings name neither viewpoints nor directions. Others stay as they are.
void face_by_trade(Trade trade, NormalsSettings& settings);

}  // namespace lamina
