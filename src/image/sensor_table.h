#pragma once

#include <optional>
#include <string>

namespace cairn {

// Diagonal of 35 mm film, 36 mm x 24 mm, over that of the sensor of a camera (make and model as in
// EXIF, in any case), from lensfun's database; absent for cameras that it does not have, or that
// have sensors of several sizes. The first call reads the database (70 ms). Thread-safe.
std::optional<double> CropFactor(const std::string& make, const std::string& model);

}  // namespace cairn
