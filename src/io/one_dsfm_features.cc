#include <algorithm>
#include <cmath>
#include <cstdint>
#include <unordered_set>

#include "cairn/io/one_dsfm.h"
#include "io/text_reader.h"

namespace cairn {
namespace {

// The number after the last "<name> = " of a header line of coords.txt; nullopt if it is not there.
std::optional<double> HeaderNumber(std::string_view line, const std::string& name) {
  const std::string key = name + " = ";
  const size_t begin = line.rfind(key);
  if (begin == std::string_view::npos) return std::nullopt;
  const std::string_view rest = line.substr(begin + key.size());
  return TextReader::ToDouble(rest.substr(0, rest.find_first_of(", ")));
}

// What stands between "name = " and the last " keys = ": names may contain commas and blanks.
std::string HeaderName(std::string_view line) {
  constexpr std::string_view kBegin = "name = ";
  const size_t begin = line.find(kBegin);
  const size_t end = line.rfind("keys = ");
  if (begin == std::string_view::npos || end == std::string_view::npos || end < begin) return "";
  const std::string_view name = line.substr(begin + kBegin.size(), end - begin - kBegin.size());
  return std::string(name.substr(0, name.find_last_not_of(", \t") + 1));
}

// "#index = %d, name = %s keys = %d, px = %f, py = %f, focal = %f"
OneDsfmImageKeys ReadHeader(TextReader& reader, int num_images, int64_t& num_keys) {
  const std::string_view line = reader.line();
  const auto index = HeaderNumber(line, "index");
  const auto keys = HeaderNumber(line, "keys");
  const auto px = HeaderNumber(line, "px");
  const auto py = HeaderNumber(line, "py");
  OneDsfmImageKeys image;
  image.name = HeaderName(line);
  if (!line.starts_with("#index") || !index || !keys || !px || !py || image.name.empty()) {
    reader.Fail("a line '#index = , name = , keys = , px = , py = , focal = ' is expected");
  }
  if (!(*keys >= 0 && *keys <= INT32_MAX)) reader.Fail("an impossible number of keys");
  if (!(std::abs(*index) <= INT32_MAX)) reader.Fail("an impossible image index");
  if (*index < 0 || *index >= num_images) {
    reader.Fail("image index " + std::to_string(static_cast<int64_t>(*index)) +
                " is not in list.txt, which has " + std::to_string(num_images) + " images");
  }
  image.index = static_cast<int>(*index);
  image.principal_point << *px, *py;
  image.focal_px = std::max(0.0, HeaderNumber(line, "focal").value_or(0.0));
  num_keys = static_cast<int64_t>(*keys);
  return image;
}

// "<key> <x> <y> 0 0 <R> <G> <B>"; the center of the upper left pixel is (1, 1).
OneDsfmKey ReadKey(TextReader& reader) {
  OneDsfmKey key;
  key.key = reader.Integer<int>("key", 0);
  const double x = reader.Double("x");
  const double y = reader.Double("y");
  key.pixel << x - 0.5, y - 0.5;
  reader.Double("scale");
  reader.Double("orientation");
  for (uint8_t& channel : key.color) channel = reader.Integer<uint8_t>("color");
  return key;
}

}  // namespace

std::vector<OneDsfmImageKeys> ReadOneDsfmCoords(const std::string& path, int num_images) {
  TextReader reader(path);
  std::vector<OneDsfmImageKeys> images;
  std::vector<bool> is_present(num_images, false);
  while (reader.NextLine()) {
    if (reader.AtLineEnd()) continue;
    int64_t num_keys = 0;
    OneDsfmImageKeys image = ReadHeader(reader, num_images, num_keys);
    if (is_present[image.index]) {
      reader.Fail("image index " + std::to_string(image.index) + " appears twice");
    }
    is_present[image.index] = true;
    std::unordered_set<int> keys;
    for (int64_t i = 0; i < num_keys; ++i) {
      if (!reader.NextLine()) {
        reader.Fail("the file ends after " + std::to_string(i) + " of " + std::to_string(num_keys) +
                    " keys");
      }
      image.keys.push_back(ReadKey(reader));
      const int key = image.keys.back().key;
      if (!keys.insert(key).second) reader.Fail("key " + std::to_string(key) + " appears twice");
    }
    images.push_back(std::move(image));
  }
  return images;
}

std::vector<std::vector<OneDsfmObservation>> ReadOneDsfmTracks(const std::string& path,
                                                               int num_images) {
  TextReader reader(path);
  reader.ExpectDataLine("the number of tracks");
  const int64_t num_tracks = reader.Integer("number of tracks", 0);
  std::vector<std::vector<OneDsfmObservation>> tracks;
  for (int64_t i = 0; i < num_tracks; ++i) {
    reader.ExpectDataLine("track " + std::to_string(i + 1) + " of " + std::to_string(num_tracks));
    const int64_t length = reader.Integer("track length", 0);
    std::vector<OneDsfmObservation>& track = tracks.emplace_back();
    for (int64_t k = 0; k < length; ++k) {
      OneDsfmObservation& observation = track.emplace_back();
      observation.image = reader.Integer<int>("image index", 0, num_images - 1);
      observation.key = reader.Integer<int>("key", 0);
    }
    reader.ExpectLineEnd();
  }
  if (reader.NextDataLine()) reader.Fail("more tracks than the first line says");
  return tracks;
}

}  // namespace cairn
