#pragma once

#include <Eigen/Core>

#include "translation_averaging/position_models.h"

namespace cairn {

// Huber's function of a residual of norm r (equal to r^2 / 2 up to `scale`) and its weight.
double HuberCost(double residual, double scale);
double HuberWeight(double residual, double scale);

// One direction v of length 1 against the difference of positions D.

// |v - D / |D||: twice the sine of half of the angle between them.
double ChordalCost(const Eigen::Vector3d& v, const Eigen::Vector3d& D, double huber);
DirectionModel ChordalModel(const Eigen::Vector3d& v, const Eigen::Vector3d& D, double huber);

}  // namespace cairn
