#include "synthetic/city.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

namespace cairn {
namespace {

constexpr int kImagesPerPlace = 100;
constexpr double kSpacing = 5.0;  // of places, in radii of a tower

}  // namespace

// Twice as many rows as columns, so that half of all places further on is another part of the city.
City::City(int64_t num_images)
    : num_places_(static_cast<int>(std::max<int64_t>(1, num_images / kImagesPerPlace))),
      width_(std::max(1, static_cast<int>(std::lround(std::sqrt(0.5 * num_places_))))) {}

Rigid3d City::WorldFromPlace(int place) const {
  // Multiples of the golden angle by squares: no two places are turned alike, and no two pairs of
  // twins against each other, as one turn of half of the city would explain.
  const double turn =
      std::fmod(0.5 * (3.0 - std::sqrt(5.0)) * place * place, 1.0) * 2 * std::numbers::pi;
  return {Eigen::Quaterniond(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ())),
          kSpacing * Eigen::Vector3d(place % width_, place / width_, 0)};
}

bool City::AreNeighbors(int place1, int place2) const {
  return std::abs(place1 % width_ - place2 % width_) <= 1 &&
         std::abs(place1 / width_ - place2 / width_) <= 1;
}

int City::TwinOf(int place) const {
  const int half = num_places_ / 2;
  if (place >= 2 * half) return place;
  const int twin = place < half ? place + half : place - half;
  return AreNeighbors(place, twin) ? place : twin;
}

bool City::HasTwins() const {
  for (int place = 0; place < num_places_; ++place) {
    if (TwinOf(place) != place) return true;
  }
  return false;
}

Rigid3d City::Motion(int from, int to) const {
  return WorldFromPlace(to) * Inverse(WorldFromPlace(from));
}

}  // namespace cairn
