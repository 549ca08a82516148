// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The closed-form footprint against adaptive quadrature of the beam integral (paper eq 4), in long double.

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "Core/Engine/Packing.h"
#include "Support/Fields.h"

namespace
{

using bigus::test::Random;
using Long = long double;

struct Case
{
  Eigen::Vector3d mean, scale;
  Eigen::Vector4d rotation;
  bigus::SlicePlane plane;
  double elevationSigma;
};

/// ln of the integrand of paper eq 4 at elevation z, straight from the definition.
Long Exponent(const Case& c, const Eigen::Vector2d& pixel, Long z)
{
  const Eigen::Matrix<Long, 3, 3> r = bigus::RotationMatrix(c.rotation).cast<Long>();
  const Eigen::Matrix<Long, 3, 1> x = c.plane.origin.cast<Long>() + Long(pixel[0]) * c.plane.columnStep.cast<Long>() +
                                      Long(pixel[1]) * c.plane.rowStep.cast<Long>() +
                                      z * c.plane.Normal().cast<Long>() - c.mean.cast<Long>();
  const Eigen::Matrix<Long, 3, 1> y = (r.transpose() * x).cwiseQuotient(c.scale.cast<Long>());
  Long exponent = -y.squaredNorm() / 2;
  if (c.elevationSigma > 0)
  {
    exponent -= z * z / (2 * Long(c.elevationSigma) * c.elevationSigma);
  }
  return exponent;
}

/// Adaptive Simpson quadrature to a relative tolerance of the whole.
Long Integrate(const std::function<Long(Long)>& f, Long a, Long b, Long fa, Long fm, Long fb, Long whole,
               Long tolerance, int depth)
{
  const Long m = (a + b) / 2, left = (a + m) / 2, right = (m + b) / 2;
  const Long fl = f(left), fr = f(right);
  const Long first = (m - a) / 6 * (fa + 4 * fl + fm), second = (b - m) / 6 * (fm + 4 * fr + fb);
  const Long difference = first + second - whole;
  if (depth == 0 || std::abs(difference) <= 15 * tolerance)
  {
    return first + second + difference / 15;
  }
  return Integrate(f, a, m, fa, fl, fm, first, tolerance / 2, depth - 1) +
         Integrate(f, m, b, fm, fr, fb, second, tolerance / 2, depth - 1);
}

/// The beam integral with a profile of unit area.
Long Quadrature(const Case& c, const Eigen::Vector2d& pixel)
{
  if (c.elevationSigma == 0)
  {
    return std::exp(Exponent(c, pixel, 0));
  }
  // The exponent is a parabola in z; three samples give the place and width of its peak, where to look.
  const Long step = c.elevationSigma;
  const Long low = Exponent(c, pixel, -step), middle = Exponent(c, pixel, 0), high = Exponent(c, pixel, step);
  const Long curvature = (2 * middle - low - high) / (step * step);
  const Long peak = (high - low) / (2 * step * curvature);
  const Long width = 1 / std::sqrt(curvature);
  const Long top = Exponent(c, pixel, peak);
  const auto f = [&](Long z) { return std::exp(Exponent(c, pixel, z) - top); };
  Long sum = 0;
  for (int piece = -12; piece < 12; ++piece)  // exp(-12^2 / 2) = 5e-32
  {
    const Long a = peak + piece * width, b = a + width;
    const Long fa = f(a), fm = f((a + b) / 2), fb = f(b);
    sum += Integrate(f, a, b, fa, fm, fb, (b - a) / 6 * (fa + 4 * fm + fb), width * 1e-14L, 12);
  }
  return sum * std::exp(top) / (std::sqrt(2 * std::acos(Long(-1))) * c.elevationSigma);
}

Case RandomCase(Random& random)
{
  Case c;
  const double size = random.LogUniform(0.2, 5.0);
  const double kind = random.Uniform();
  const double aspect = random.LogUniform(1.0, 1e4);
  c.scale = size * Eigen::Vector3d(random.Uniform(0.5, 2), random.Uniform(0.5, 2), random.Uniform(0.5, 2));
  if (kind < 0.3)
  {
    c.scale[0] /= aspect;  // pancake
  }
  else if (kind < 0.6)
  {
    c.scale[0] /= aspect;  // needle
    c.scale[1] /= aspect;
  }
  c.rotation = random.UnitQuaternion();
  c.plane = bigus::test::RandomPlane(random, random.Vector(10), random.LogUniform(0.05, 1.0), 64, 64);
  c.elevationSigma = random.Uniform() < 0.1 ? 0.0 : random.LogUniform(1e-3, 10.0);
  // Off the plane by up to four standard deviations of what the beam sees.
  const Eigen::Matrix3d r = bigus::RotationMatrix(c.rotation);
  const double t =
      (r.transpose() * c.plane.Normal()).cwiseProduct(c.scale).squaredNorm() + c.elevationSigma * c.elevationSigma;
  c.mean = c.plane.Point(random.Uniform(0, 63), random.Uniform(0, 63), random.Uniform(-4, 4) * std::sqrt(t));
  return c;
}

template <class Real>
bigus::Projection<Real> ProjectCase(const Case& c)
{
  bigus::GaussianField field;
  field.Resize(1);
  field.means[0] = c.mean;
  field.scales[0] = c.scale;
  field.rotations[0] = c.rotation;
  const Eigen::Vector3d origin = c.plane.Point(31.5, 31.5);
  return bigus::Project(bigus::PackField<Real>(field, origin)[0],
                        bigus::MakeView<Real>(c.plane, bigus::Beam{c.elevationSigma}, origin));
}

TEST(Splat, EqualsTheBeamIntegral)
{
  Random random(1);
  Long worst = 0;
  for (int i = 0; i < 10000; ++i)
  {
    const Case c = RandomCase(random);
    const bigus::Projection<double> p = ProjectCase<double>(c);
    // A pixel position (not rounded: the formula holds anywhere) up to four standard deviations from the
    // centre.
    const double e1 = random.Uniform(-3, 3), e2 = random.Uniform(-3, 3);
    const double v = p.splat.mv + e2 / p.splat.u22;
    const double u = p.splat.mu + (e1 - p.splat.u12 * (v - p.splat.mv)) / p.splat.u11;
    const double eta2 = p.splat.u22 * (v - p.splat.mv);
    const double eta1 = p.splat.u11 * (u - p.splat.mu) + p.splat.u12 * (v - p.splat.mv);
    const double w = p.splat.amplitude * std::exp(-0.5 * (eta1 * eta1 + eta2 * eta2));
    const Long expected = Quadrature(c, {u, v});
    const Long error = std::abs(w - expected) / p.splat.amplitude;
    worst = std::max(worst, error);
    // What is left is the rounding of positions: half an ulp of 32 mm, 4e-15 mm, beside a needle 1e-5 mm
    // thick.
    ASSERT_LT(error, 1e-10L) << "case " << i << ", scales " << c.scale.transpose() << ", sigma_E " << c.elevationSigma;
  }
  RecordProperty("worst_error", std::to_string(static_cast<double>(worst)));
  std::cout << "worst error / peak: " << static_cast<double>(worst) << '\n';
}

TEST(Splat, FloatStaysFiniteAndCloseForNeedlesAndPancakes)
{
  Random random(2);
  for (int i = 0; i < 20000; ++i)
  {
    const Case c = RandomCase(random);
    const bigus::Splat<float> f = ProjectCase<float>(c).splat;
    const bigus::Splat<double> d = ProjectCase<double>(c).splat;
    for (float value : {f.u11, f.u12, f.u22, f.mu, f.mv, f.amplitude})
    {
      ASSERT_TRUE(std::isfinite(value)) << "case " << i;
    }
    // Float rounding: of the norms, a few 1e-7; of rho^2 / 2, off by rho drho with rho <= 4, where the mean's
    // distance from the plane sums coordinates up to 64 mm: twelve roundings (six inputs, three products,
    // three sums) of 4e-6 mm.
    const Eigen::Vector3d normal = bigus::RotationMatrix(c.rotation).transpose() * c.plane.Normal();
    const double t = normal.cwiseProduct(c.scale).squaredNorm() + c.elevationSigma * c.elevationSigma;
    const double rounding = 1e-5 + 4 * 12 * 4e-6 / std::sqrt(t);
    EXPECT_NEAR(f.amplitude, d.amplitude, rounding * d.amplitude) << "case " << i;
  }
}

}  // namespace
