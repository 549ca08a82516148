// Adam (Kingma and Ba, 2015), one Gaussian at a time, with a step size for each group of parameters.
#pragma once

#include <cmath>
#include <cstdint>

#include "Engine.h"
#include "Splat.h"

namespace bigus
{

constexpr int kParametersPerGaussian = 10;  // mean 3, ln scale 3, turn 3, reflectivity 1

template <class Real>
struct AdamState
{
  Real first[kParametersPerGaussian] = {};   ///< running mean of the gradient
  Real second[kParametersPerGaussian] = {};  ///< running mean of its square
};

/// Step sizes and limits as kernels use them; `iteration` counts from 1 and corrects the bias of young
/// averages.
template <class Real>
struct AdamStep
{
  Real mean, logScale, rotation, reflectivity;
  Real minimumLogScale, maximumLogScale;
  bool positiveReflectivity;

  AdamStep(const LearningRates& rates, const ParameterLimits& limits, std::int64_t iteration)
  {
    const double t = static_cast<double>(iteration);
    const double correction = std::sqrt(1.0 - std::pow(0.999, t)) / (1.0 - std::pow(0.9, t));
    mean = static_cast<Real>(rates.mean * correction);
    logScale = static_cast<Real>(rates.logScale * correction);
    rotation = static_cast<Real>(rates.rotation * correction);
    reflectivity = static_cast<Real>(rates.reflectivity * correction);
    minimumLogScale = static_cast<Real>(std::log(limits.minimumScale));
    maximumLogScale = static_cast<Real>(std::log(limits.maximumScale));
    positiveReflectivity = limits.positiveReflectivity;
  }
};

/// Moves one Gaussian. A gradient that is not finite is dropped: one bad pixel must not poison the field.
template <class Real>
BIGUS_HOST_DEVICE inline void UpdateGaussian(Gaussian<Real>& gaussian, AdamState<Real>& state,
                                             const GaussianGradient<Real>& gradient,
                                             const AdamStep<Real>& step)
{
  const Real g[kParametersPerGaussian] = {gradient.mean.x,      gradient.mean.y,     gradient.mean.z,
                                          gradient.logScale.x,  gradient.logScale.y, gradient.logScale.z,
                                          gradient.rotation.x,  gradient.rotation.y, gradient.rotation.z,
                                          gradient.reflectivity};
  Real move[kParametersPerGaussian];
  for (int k = 0; k < kParametersPerGaussian; ++k)
  {
    const Real value = std::isfinite(g[k]) ? g[k] : Real(0);
    state.first[k] += Real(0.1) * (value - state.first[k]);
    state.second[k] += Real(0.001) * (value * value - state.second[k]);
    // The tiny floor only keeps 0 / 0 away: Adam is meant to be blind to the gradient's unit.
    move[k] = -state.first[k] / (std::sqrt(state.second[k]) + Real(1e-18));
  }
  gaussian.mean = MultiplyAdd(step.mean, {move[0], move[1], move[2]}, gaussian.mean);
  const auto clamp = [&step](Real v)
  {
    return v < step.minimumLogScale ? step.minimumLogScale
                                    : (v > step.maximumLogScale ? step.maximumLogScale : v);
  };
  gaussian.logScale.x = clamp(gaussian.logScale.x + step.logScale * move[3]);
  gaussian.logScale.y = clamp(gaussian.logScale.y + step.logScale * move[4]);
  gaussian.logScale.z = clamp(gaussian.logScale.z + step.logScale * move[5]);

  // q <- q (1, omega / 2), normalised: a turn about the Gaussian's own axes, exact to second order.
  const Real x = step.rotation * move[6] / 2, y = step.rotation * move[7] / 2,
             z = step.rotation * move[8] / 2;
  const Real* q = gaussian.rotation;
  const Real turned[4] = {q[0] - q[1] * x - q[2] * y - q[3] * z, q[1] + q[0] * x + q[2] * z - q[3] * y,
                          q[2] + q[0] * y + q[3] * x - q[1] * z, q[3] + q[0] * z + q[1] * y - q[2] * x};
  const Real length = std::sqrt(turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2] +
                                turned[3] * turned[3]);
  for (int k = 0; k < 4; ++k)
  {
    gaussian.rotation[k] = turned[k] / length;
  }
  gaussian.reflectivity += step.reflectivity * move[9];
  if (step.positiveReflectivity && gaussian.reflectivity < 0)
  {
    gaussian.reflectivity = 0;
  }
}

}  // namespace bigus
