#include "image/sensor_table.h"

#include <lensfun/lensfun.h>

#include <algorithm>
#include <map>
#include <utility>

#include "base/text.h"

namespace cairn {
namespace {

using CameraName = std::pair<std::string, std::string>;  // make and model in lower case

// Crop factors of one camera that differ by less are one: they were measured to two digits.
constexpr double kSameCrop = 1.02;

CameraName MakeName(const std::string& make, const std::string& model) {
  return {Lowercase(make), Lowercase(model)};
}

// The package's own files only: what a user keeps at home must not change a result.
std::map<CameraName, double> ReadTable() {
  lfDatabase database;
  database.LoadDirectory(CAIRN_LENSFUN_DIR);
  std::map<CameraName, double> table;
  const lfCamera* const* cameras = database.GetCameras();
  for (; cameras && *cameras; ++cameras) {
    const lfCamera& camera = **cameras;
    if (!camera.Maker || !camera.Model || !(camera.CropFactor > 0)) continue;
    const double crop = camera.CropFactor;  // a float there
    const auto [entry, is_new] = table.try_emplace(MakeName(camera.Maker, camera.Model), crop);
    const auto [smaller, larger] = std::minmax(entry->second, crop);
    if (larger > kSameCrop * smaller) entry->second = 0;
  }
  return table;
}

}  // namespace

std::optional<double> CropFactor(const std::string& make, const std::string& model) {
  static const std::map<CameraName, double> table = ReadTable();
  const auto entry = table.find(MakeName(make, model));
  if (entry == table.end() || entry->second == 0) return std::nullopt;
  return entry->second;
}

}  // namespace cairn
