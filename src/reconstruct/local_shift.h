// Coordinates near zero for files that hold floats.
#pragma once
#include <array>
#include <string>

#include "lamina/frame.h"
#include "store/survey.h"

namespace lamina {

/// The middle of the cloud, rounded to a power of ten near its size: few digits for people to copy.
std::array<double, 3> local_shift(const Census& census);

/// The frame of coordinates less the shift.
Frame shifted(const Frame& frame, const std::array<double, 3>& shift);

/// "4468300 847200 0", every digit of the numbers.
std::string shift_text(const std::array<double, 3>& shift);

}  // namespace lamina
