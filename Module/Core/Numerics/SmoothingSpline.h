// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The smoothing spline: a smooth curve through noisy values at any times, and how likely a smoothness is.
#pragma once

#include <Eigen/Dense>
#include <vector>

namespace bigus
{

/// A curve through n values of `Columns` numbers each, and what its likelihood is made of.
struct SmoothedCurve
{
  Eigen::MatrixXd values;     ///< [n][columns]
  Eigen::VectorXd leverage;   ///< [n] share that a value has in its own estimate, 0 to 1
  double squares = 0;         ///< weighted squares of noise and of what drives the curve, in units of the noise, summed
  double logDeterminant = 0;  ///< of the covariance of one column in units of the noise's variance
};

/// The cubic smoothing spline through `values` [n][columns], at most 4, at increasing `times` [n]: the mean of a path whose
/// velocity is a Wiener process, given values with independent noise. `weights` [n] are positive; noise of value k has
/// the variance sigma^2 / weights[k]. `drive` is q / sigma^2, q being the variance that velocity gains in a unit of time:
/// the weights of a value's neighbours fall off over drive^(-1/4) units of time. Needs n >= 2. O(n columns).
///
/// The restricted likelihood, in which the first place and velocity have no say, is
///   -2 ln L = (n - 2) columns ln sigma^2 + squares / sigma^2 + columns logDeterminant + a constant.
SmoothedCurve Smooth(const std::vector<double>& times, const Eigen::MatrixXd& values,
                     const std::vector<double>& weights, double drive);

}  // namespace bigus
