// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the hard cases share: engines by name, the exact footprint, splats placed where an image sees them,
// and the table of results.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Support/Engines.h"
#include "Support/Fields.h"
#include "Support/Sweeps.h"

namespace bigus::test
{

/// What any image of floats rounds off a value: half a unit in its last place, relative to the value.
constexpr double kFloatRounding = 0x1p-24;

using Long = long double;
using LongVector = Eigen::Matrix<Long, 3, 1>;

/// The beam integral of one Gaussian at one pixel, in long double and without any of Splat.h's algebra. In
/// whitened coordinates y(z) = S^-1 R^T (x + z n - mu) the integrand is exp(-(|y(z)|^2 + z^2 / sigma_E^2) /
/// 2), a Gaussian in z. Its peak is at
///
///     z* = -sigma_E^2 y.g / N,   g = S^-1 R^T n,   N = 1 + sigma_E^2 |g|^2,
///
/// and the integral over a profile of unit area is its peak times 1 / sqrt(N). The exponent is a sum of two
/// squares, so nothing cancels; sigma_E = 0 is z* = 0.
class ExactSplat
{
public:
  ExactSplat(const GaussianField& field, std::size_t i, const SlicePlane& plane);

  /// w at a pixel position; reflectivity left out.
  Long Weight(Long column, Long row) const;

  /// The largest w on the plane (at the footprint's centre, whether or not a pixel lies there), and the
  /// largest on any plane.
  Long Peak() const { return peak_; }
  Long PeakOfAllPlanes() const { return 1 / std::sqrt(n_); }

private:
  LongVector atOrigin_, perColumn_, perRow_, perMillimetre_;  // y, and what one step adds to it
  Long variance_, n_, peak_;
};

/// Every Gaussian of a field.
std::vector<ExactSplat> ExactSplats(const GaussianField& field, const SlicePlane& plane);

/// Moves Gaussian i so that its footprint's centre lies `eta` of its own standard deviations from pixel
/// (column, row) (two independent directions), and the Gaussian `rho` of the standard deviations that the
/// beam sees, sqrt(n^T Sigma n + sigma_E^2), off the plane. So every splat, however thin, meets a pixel where
/// it is bright.
void PlaceInView(GaussianField& field, std::size_t i, const SlicePlane& plane, double column, double row,
                 const Eigen::Vector2d& eta, double rho);

/// What the recurrence along rows may cost, relative to a splat's peak: the precision asked of an engine in
/// float, and of one in double.
inline double FlatError(double u)
{
  return u > 1e-10 ? 1e-4 : 1e-9;
}

/// How far, in standard deviations, any sound evaluation in arithmetic of unit roundoff u may misplace a
/// splat:
///
///     d = 32 u k (aspect + (L + sigma_E) / s_min) + 32 2^-53 D / s_min
///
/// Positions (mean, pixel, plane) enter as floats of size up to L, the largest distance between any two of
/// them and from the engine's origin, and turned by a rounded rotation: they move by a few u L, hence y =
/// S^-1 R^T (x - mu) by a few u L / s_min; the beam explores sigma_E more. The shape itself depends on
/// directions rounded to u, which matter `aspect` times. 32 covers the roundings in series: inputs 3,
/// products and sums of a rotation and a change of basis 2 x 5, logarithm and exponential of a scale (|ln s|
/// <= 23) 12, norms 4, the exponential's own 2. k = |a| |b| / |a x b| is 1 for rectangular pixels and what a
/// change of basis loses to sheared ones. D is the coordinates' own size before the engine subtracts its
/// origin in double. A subtraction of covariances would lose aspect^2 instead, and does not keep this.
double Displacement(const GaussianField& field, std::size_t i, const SlicePlane& plane, double u);

/// What follows for |dw|, where w = exp(-q^2 / 2) / sqrt(N) and q may be wrong by d:
///
///     |dw| <= (exp(-max(q - d, 0)^2 / 2) - exp(-q^2 / 2)) / sqrt(N) + (flat + d) w
///
/// and anywhere on the plane at most (flat + d) / sqrt(N), the steepest slope of exp(-q^2 / 2) being 0.61;
/// never more than 1 / sqrt(N), which is all there is to lose.
double SplatErrorAt(const ExactSplat& splat, Long w, double displacement, double u);
double SplatErrorBound(const GaussianField& field, std::size_t i, const SlicePlane& plane, double u);

/// Ends a case: nothing may be other than finite, and no error beyond its bound. `error` is the largest by the case's own
/// definition, `ofBound` the largest error over what was allowed there. Adds a row to the table that is printed when the
/// tests end.
void Conclude(const std::string& group, const std::string& name, const std::string& engine, double error,
              double ofBound, std::size_t nonFinite);

/// Ends a case of which nothing is asked but that all is finite. The table states `number` without a bound.
void ConcludeFinite(const std::string& group, const std::string& name, const std::string& engine, double number,
                    std::size_t nonFinite);

/// Counts what is not finite.
std::size_t CountNonFinite(const std::vector<float>& values);
std::size_t CountNonFinite(const FieldGradient& gradient);
std::size_t CountNonFinite(const GaussianField& field);

/// A whole plane rendered by an engine that already holds a field.
struct RenderedPlane
{
  std::vector<float> values, coverage;
};
RenderedPlane RenderWhole(Engine& engine, const SlicePlane& plane, ViewOutput output);

/// A plane through the origin, z = 0: pixel (0, 0) at its lower left, centre at (0, 0, 0).
SlicePlane FlatPlane(int width, int height, double columnSpacing, double rowSpacing);

}  // namespace bigus::test
