// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Numerics/SmoothingSpline.h"

#include <cmath>
#include <cstddef>

namespace bigus
{
namespace
{

constexpr int kMostColumns = 4;  // of what is smoothed together; they need no memory of their own

using States = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::ColMajor, 2, kMostColumns>;

// The state x_k = (place, velocity) at time k follows x_(k+1) = F x_k + e, where F = (1 d; 0 1) and e has the covariance
// drive Q, Q = (d^3/3 d^2/2; d^2/2 d). With H = (1 0) the smoothed states minimise
//
//   sum over k of  w_k |y_k - H x_k|^2 + (x_(k+1) - F x_k)^T (drive Q)^-1 (x_(k+1) - F x_k),
//
// whose matrix is block tridiagonal. Elimination forward and substitution backward are the filter and the smoother of
// Rauch, Tung and Striebel (1965), with nothing assumed about the first state.
struct Equations
{
  std::vector<Eigen::Matrix2d> diagonal, below;  // the matrix
  std::vector<States> right;
  std::vector<Eigen::Matrix2d> transition, precision;  // F and (drive Q)^-1
  double logDeterminant = 0;                           // of all covariances
};

Equations EquationsOf(const std::vector<double>& times, const Eigen::MatrixXd& values,
                      const std::vector<double>& weights, double drive)
{
  const std::size_t n = times.size();
  const std::vector<Eigen::Matrix2d> zeros(n, Eigen::Matrix2d::Zero());
  Equations e{zeros, zeros, std::vector<States>(n, States::Zero(2, values.cols())), zeros, zeros};
  for (std::size_t k = 0; k < n; ++k)
  {
    e.diagonal[k](0, 0) += weights[k];
    e.right[k].row(0) = weights[k] * values.row(static_cast<Eigen::Index>(k));
    e.logDeterminant -= std::log(weights[k]);
    if (k + 1 < n)
    {
      const double d = times[k + 1] - times[k];
      e.transition[k] << 1, d, 0, 1;
      e.precision[k] << 12 / (d * d * d), -6 / (d * d), -6 / (d * d), 4 / d;
      e.precision[k] /= drive;
      e.logDeterminant += std::log(drive * drive * d * d * d * d / 12);
      e.diagonal[k] += e.transition[k].transpose() * e.precision[k] * e.transition[k];
      e.diagonal[k + 1] = e.precision[k];
      e.below[k] = -e.precision[k] * e.transition[k];
    }
  }
  return e;
}

}  // namespace

SmoothedCurve Smooth(const std::vector<double>& times, const Eigen::MatrixXd& values,
                     const std::vector<double>& weights, double drive)
{
  const std::size_t n = times.size();
  auto [diagonal, below, right, transition, precision, logDeterminant] = EquationsOf(times, values, weights, drive);
  SmoothedCurve curve;
  curve.logDeterminant = logDeterminant;
  std::vector<Eigen::Matrix2d> inverse(n);
  for (std::size_t k = 0; k < n; ++k)
  {
    if (k > 0)
    {
      const Eigen::Matrix2d gain = below[k - 1] * inverse[k - 1];
      diagonal[k] -= gain * below[k - 1].transpose();
      right[k] -= gain * right[k - 1];
    }
    curve.logDeterminant += std::log(diagonal[k].determinant());
    inverse[k] = diagonal[k].inverse();
  }
  curve.values.resize(static_cast<Eigen::Index>(n), values.cols());
  curve.leverage.resize(static_cast<Eigen::Index>(n));
  States state, after;
  Eigen::Matrix2d covariance;
  for (std::size_t k = n; k-- > 0;)
  {
    after = state;
    if (k + 1 < n)
    {
      const Eigen::Matrix2d gain = inverse[k] * below[k].transpose();
      state = inverse[k] * right[k] - gain * after;
      covariance = inverse[k] + gain * covariance * gain.transpose();
      const States driven = after - transition[k] * state;
      curve.squares += driven.cwiseProduct(precision[k] * driven).sum();
    }
    else
    {
      state = inverse[k] * right[k];
      covariance = inverse[k];
    }
    const auto row = static_cast<Eigen::Index>(k);
    curve.values.row(row) = state.row(0);
    curve.leverage[row] = weights[k] * covariance(0, 0);
    curve.squares += weights[k] * (values.row(row) - state.row(0)).squaredNorm();
  }
  return curve;
}

}  // namespace bigus
