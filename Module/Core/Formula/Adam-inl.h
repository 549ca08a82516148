// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Adam's step for one Gaussian. Written for scalars and SIMD vectors, like Splat-inl.h: no include guard.

template <class Real>
struct AdamState
{
  Real first[kParametersPerGaussian];   ///< running mean of the gradient
  Real second[kParametersPerGaussian];  ///< running mean of its square
  Real updates;                         ///< how many gradients went into them: corrects the bias of young averages
};

/// A gradient's numbers in the order of Parameter.
template <class Real>
BIGUS_FORMULA void ToArray(const GaussianGradient<Real>& g, Real (&values)[kParametersPerGaussian])
{
  values[kMeanAt] = g.mean.x;
  values[kMeanAt + 1] = g.mean.y;
  values[kMeanAt + 2] = g.mean.z;
  values[kLogScaleAt] = g.logScale.x;
  values[kLogScaleAt + 1] = g.logScale.y;
  values[kLogScaleAt + 2] = g.logScale.z;
  values[kTurnAt] = g.rotation.x;
  values[kTurnAt + 1] = g.rotation.y;
  values[kTurnAt + 2] = g.rotation.z;
  values[kReflectivityAt] = g.reflectivity;
}

template <class Real>
BIGUS_FORMULA GaussianGradient<Real> FromArray(const Real (&values)[kParametersPerGaussian])
{
  return {{values[kMeanAt], values[kMeanAt + 1], values[kMeanAt + 2]},
          {values[kLogScaleAt], values[kLogScaleAt + 1], values[kLogScaleAt + 2]},
          {values[kTurnAt], values[kTurnAt + 1], values[kTurnAt + 2]},
          values[kReflectivityAt]};
}

template <class Real>
BIGUS_FORMULA Real Clamp(Real value, Real low, Real high)
{
  return Select(value < low, low, Select(value > high, high, value));
}

/// Moves one Gaussian along its gradient and reports how many of its components had to be guarded. A component that is
/// not finite counts as 0, and one beyond kLargestGradient as that: one bad pixel must not poison the field, and the
/// square must stay finite. Training as it should be never gets near either.
template <class Real>
BIGUS_FORMULA Real UpdateGaussian(Gaussian<Real>& gaussian, AdamState<Real>& state,
                                  const GaussianGradient<Real>& gradient, const AdamStep& step)
{
  using std::abs;
  using std::exp;
  using std::sqrt;
  const Real zero = Real(0), one = Real(1);
  Real g[kParametersPerGaussian];
  ToArray(gradient, g);
  state.updates = state.updates + one;
  Real correction =
      sqrt(one - exp(Real(kLogSecondDecay) * state.updates)) / (one - exp(Real(kLogYoungDecay) * state.updates));
  if (step.settling > 0)
  {
    const Real share = exp(Real(-step.settling) * state.updates), least = Real(step.settled);
    correction = correction * Select(share < least, least, share);
  }
  // Later, when the share is less, nothing is left of the bias of the first mean.
  const Real firstShare = Clamp(Real(kYoungUpdates) / state.updates, Real(kFirstShare), Real(kYoungShare));
  Real move[kParametersPerGaussian];
  Real guarded = zero;
  for (int k = 0; k < kParametersPerGaussian; ++k)
  {
    const Real largest = Real(kLargestGradient);
    const Real value = Select(g[k] == g[k], Clamp(g[k], zero - largest, largest), zero);  // NaN becomes 0
    guarded = guarded + Select(abs(g[k]) <= largest, zero, one);
    state.first[k] = state.first[k] + firstShare * (value - state.first[k]);
    state.second[k] = state.second[k] + Real(kSecondShare) * (value * value - state.second[k]);
    // The tiny floor only keeps 0 / 0 away: Adam is meant to be blind to the gradient's unit.
    move[k] = zero - correction * state.first[k] * InverseRoot(state.second[k] + Real(1e-36));
  }
  gaussian.mean = MultiplyAdd(Real(step.mean), {move[kMeanAt], move[kMeanAt + 1], move[kMeanAt + 2]}, gaussian.mean);
  const Real farthest = Real(0.5 * GaussianField::kLargestCoordinate);  // from the engine's or block's own origin
  gaussian.mean = {Clamp(gaussian.mean.x, zero - farthest, farthest), Clamp(gaussian.mean.y, zero - farthest, farthest),
                   Clamp(gaussian.mean.z, zero - farthest, farthest)};
  const Real low = Real(step.minimumLogScale), high = Real(step.maximumLogScale), stretch = Real(step.logScale);
  gaussian.logScale.x = Clamp(gaussian.logScale.x + stretch * move[kLogScaleAt], low, high);
  gaussian.logScale.y = Clamp(gaussian.logScale.y + stretch * move[kLogScaleAt + 1], low, high);
  gaussian.logScale.z = Clamp(gaussian.logScale.z + stretch * move[kLogScaleAt + 2], low, high);

  // q <- q (1, omega / 2), normalised: a turn about the Gaussian's own axes, exact to second order.
  const Real half = Real(0.5 * step.rotation);
  const Real x = half * move[kTurnAt], y = half * move[kTurnAt + 1], z = half * move[kTurnAt + 2];
  const Real* q = gaussian.rotation;
  const Real turned[4] = {q[0] - q[1] * x - q[2] * y - q[3] * z, q[1] + q[0] * x + q[2] * z - q[3] * y,
                          q[2] + q[0] * y + q[3] * x - q[1] * z, q[3] + q[0] * z + q[1] * y - q[2] * x};
  const Real inverseLength =
      InverseRoot(turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2] + turned[3] * turned[3]);
  for (int k = 0; k < 4; ++k)
  {
    gaussian.rotation[k] = turned[k] * inverseLength;
  }
  gaussian.reflectivity = Clamp(gaussian.reflectivity + Real(step.reflectivity) * move[kReflectivityAt],
                                Real(step.minimumReflectivity), Real(step.maximumReflectivity));
  return guarded;
}
