#include <filesystem>
#include <optional>
#include <set>
#include <stdexcept>

#include "base/text.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/georegistration/georegister.h"
#include "cairn/image/exif.h"

namespace cairn {

std::map<std::string, GpsRow> ReadPositions(std::span<const std::string> names,
                                            const std::string& gps_path,
                                            const std::string& image_path, const RunContext& run) {
  std::map<std::string, GpsRow> rows;
  if (!gps_path.empty()) {
    const std::map<std::string, GpsRow> all = ReadGpsFile(gps_path);
    if (const std::string unknown = UnknownNames(all, names); !unknown.empty()) {
      run.monitor.Warning(gps_path + ": " + unknown);
    }
    for (const std::string& name : names) {
      if (const auto row = all.find(name); row != all.end()) rows.insert(*row);
    }
    return rows;
  }
  std::vector<std::optional<GpsPosition>> positions(names.size());
  std::vector<char> is_unreadable(names.size(), 0);
  ParallelFor(run.num_threads, std::ssize(names), [&](int64_t i) {
    try {
      const std::string path = PathInFolder(image_path, names[i]);
      if (std::filesystem::exists(path)) positions[i] = ReadExif(path, 1, 1).gps;
    } catch (const std::runtime_error&) {
      is_unreadable[i] = 1;
    }
  });
  std::vector<std::string> unreadable;
  for (size_t i = 0; i < names.size(); ++i) {
    if (positions[i]) rows[names[i]].position = *positions[i];
    if (is_unreadable[i]) unreadable.push_back(names[i]);
  }
  if (!unreadable.empty()) {
    run.monitor.Warning(image_path + ": no positions of photographs that cannot be read (" +
                        std::to_string(unreadable.size()) + "): " + FirstNames(unreadable));
  }
  return rows;
}

std::vector<ControlPoint> ReadControlPoints(std::span<const std::string> names,
                                            const std::string& gcp_path, const RunContext& run) {
  std::vector<ControlPoint> points = ReadGcpFile(gcp_path);
  std::set<std::string> mentioned;
  for (const ControlPoint& point : points) {
    for (const auto& [name, pixel] : point.pixels) mentioned.insert(name);
  }
  if (const std::string unknown = UnknownNames(mentioned, names); !unknown.empty()) {
    run.monitor.Warning(gcp_path + ": " + unknown);
  }
  return points;
}

}  // namespace cairn
