#pragma once

#include <numbers>

namespace cairn {

constexpr double DegToRad(double deg) { return deg * (std::numbers::pi / 180.0); }
constexpr double RadToDeg(double rad) { return rad * (180.0 / std::numbers::pi); }

}  // namespace cairn
