#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace cairn::internal {

// NormalEquations (math/levenberg_marquardt.h) over the cameras of a graph.
struct SparseNormals {
  Eigen::SparseMatrix<double> hessian;  // all of it
  Eigen::VectorXd gradient;
  double cost = 0;

  // The damped step by conjugate gradients, with its elements cut at max_step.
  bool DampedStep(double damping, double max_step, Eigen::VectorXd* step) const;
  // The variance of one variable, with those nearest to it in the graph free and the others
  // constant.
  double LocalVariance(Eigen::Index v) const;
};

}  // namespace cairn::internal
