#include "synthetic/edge_errors.h"

#include <algorithm>
#include <cmath>

#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"

namespace cairn {

void EdgeNoise::VisitFields(OptionVisitor& v) {
  v.Double("rotation_noise_deg", rotation_noise_deg, {0.0, 180.0},
           "median rotation error of a verified pair");
  v.Double("direction_noise_deg", direction_noise_deg, {0.0, 180.0},
           "median error of a verified pair's translation direction");
  v.Double("heavy_tail", heavy_tail, {0.0, 1.0},
           "of these errors; 0: light; 1: as in real 1DSfM edges");
}

EdgeErrors::EdgeErrors(const EdgeNoise& noise, int num_images, Rng& rng) : noise_(noise) {
  for (int i = 0; i < num_images; ++i) badness_.push_back(rng.Gaussian());
}

void EdgeErrors::Perturb(size_t i, size_t j, Rng& rng, Rigid3d* cam2_from_cam1) const {
  const double tail = noise_.heavy_tail;
  const double z = std::sqrt(1.0 - 0.4 * tail) * rng.Gaussian() +
                   std::sqrt(0.2 * tail) * (badness_[i] + badness_[j]);
  const double rotation_error = Angle(noise_.rotation_noise_deg, z);
  const double direction_error = Angle(noise_.direction_noise_deg, 0.8 * z + 0.6 * rng.Gaussian());
  const Eigen::Vector3d axis = GaussianVector<3>(rng).cwiseProduct(
      Eigen::Vector3d(1.0 - 0.2 * tail, 1.0 + 0.2 * tail, 1.0 - 0.6 * tail));
  cam2_from_cam1->rotation =
      (ExpSO3(rotation_error * axis.normalized()) * cam2_from_cam1->rotation).normalized();
  const Eigen::Vector3d turn = cam2_from_cam1->translation.cross(RandomDirection(rng)).normalized();
  cam2_from_cam1->translation = ExpSO3(direction_error * turn) * cam2_from_cam1->translation;
}

double EdgeErrors::Angle(double median_deg, double z) const {
  const double spread = z < 0 ? 0.35 + 0.25 * noise_.heavy_tail : 0.19 + 0.61 * noise_.heavy_tail;
  return DegToRad(std::min(180.0, median_deg * std::pow(10.0, spread * z)));
}

int NumChanceInliers(Rng& rng) {
  return 15 + static_cast<int>(-20.0 * std::log(1.0 - rng.Uniform()));
}

}  // namespace cairn
