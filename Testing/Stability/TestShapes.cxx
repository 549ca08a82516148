// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One splat at a time: every aspect, size, orientation, distance and beam, against the beam integral.
//
// The error of a splat is |w - w_exact| at the worst pixel of a whole image, over the splat's largest value
// on that plane. The image has 160 x 120 pixels of 0.2 mm, turned at random; the field spans it (two
// Gaussians without reflectivity in its corners), so that nothing is exact by lying at the engine's origin.
// Every splat lies where the image sees it: its centre up to 1.5 of its own standard deviations from a pixel.

#include <algorithm>
#include <limits>

#include "Stability/HardCases.h"

namespace
{

using namespace bigus;
using namespace bigus::test;

constexpr double kPixel = 0.2;  // mm
constexpr int kWidth = 160, kHeight = 120;

struct Worst
{
  double error = 0;
  double excess = 0;  ///< the largest error over its bound
  std::size_t nonFinite = 0;
};

/// One splat on a plane, with two more Gaussians in the image's corners that spread the field and add
/// nothing.
struct OneSplat
{
  SlicePlane plane;
  GaussianField field;

  OneSplat(const SlicePlane& onPlane, double elevationSigma) : plane(onPlane)
  {
    field.Resize(3);
    field.beam.elevationSigma = elevationSigma;
    field.reflectivities[0] = 1;
    field.means[1] = plane.Point(0, 0);
    field.means[2] = plane.Point(plane.width - 1, plane.height - 1);
  }

  void Place(Random& random, double rho)
  {
    const double radius = random.Uniform(0, 1.5), angle = random.Uniform(0, 2 * kPi);
    PlaceInView(field, 0, plane, std::floor(random.Uniform(0, plane.width)),
                std::floor(random.Uniform(0, plane.height)), {radius * std::cos(angle), radius * std::sin(angle)}, rho);
  }
};

/// Adds the errors of one splat's image, over `unit`; |dw| may be `allowed` at most. The engine holds the
/// field.
void MeasureImage(Engine& engine, const OneSplat& one, const ExactSplat& exact, Long unit, double allowed, Worst& worst)
{
  const RenderedPlane image = RenderWhole(engine, one.plane, ViewOutput::Scattering);
  worst.nonFinite += CountNonFinite(image.values) + CountNonFinite(image.coverage);
  double largest = 0;
  for (int row = 0; row < one.plane.height; ++row)
  {
    for (int column = 0; column < one.plane.width; ++column)
    {
      const float value = image.values[static_cast<std::size_t>(row) * one.plane.width + column];
      largest = std::max(largest, static_cast<double>(std::abs(value - exact.Weight(column, row))));
    }
  }
  worst.error = std::max(worst.error, static_cast<double>(largest / unit));
  worst.excess = std::max(worst.excess, largest / allowed);
}

void Measure(Engine& engine, const OneSplat& one, const ExactSplat& exact, Long unit, double allowed, Worst& worst)
{
  engine.SetAccuracy({0.0});
  engine.SetField(one.field);
  MeasureImage(engine, one, exact, unit, allowed, worst);
}

/// What |dw| may be for any splat: see SplatErrorBound.
double AllowedByRounding(const OneSplat& one, const ExactSplat& exact, double u)
{
  return SplatErrorBound(one.field, 0, one.plane, u) + kFloatRounding * static_cast<double>(exact.Peak());
}

void MeasureAgainstRounding(const std::string& name, Engine& engine, const OneSplat& one, Worst& worst)
{
  const ExactSplat exact(one.field, 0, one.plane);
  Measure(engine, one, exact, exact.Peak(), AllowedByRounding(one, exact, UnitRoundoff(name)), worst);
}

TEST(Exact, IsTheBeamIntegral)
{
  // Against the plainest quadrature there is: a sum over the elevation, with steps a sixteenth of whatever
  // varies fastest (for a Gaussian the trapezoid rule then errs by exp(-2 pi^2 16^2)).
  Random random(1);
  for (int k = 0; k < 200; ++k)
  {
    const SlicePlane plane = RandomPlane(random, random.Vector(5), kPixel, 40, 30);
    OneSplat one(plane, random.LogUniform(0.01, 3));
    one.field.scales[0] = {random.LogUniform(0.05, 5), random.LogUniform(0.05, 5), random.LogUniform(0.05, 5)};
    one.field.rotations[0] = random.UnitQuaternion();
    one.Place(random, random.Uniform(-2, 2));
    const ExactSplat exact(one.field, 0, plane);
    const double column = random.Uniform(0, 39), row = random.Uniform(0, 29);
    const double sigma = one.field.beam.elevationSigma;
    const double step = std::min(sigma, one.field.scales[0].minCoeff()) / 16;
    const Eigen::Matrix3d toLocal = RotationMatrix(one.field.rotations[0]).transpose();
    Long sum = 0;
    for (double z = -12 * sigma; z < 12 * sigma; z += step)
    {
      const Eigen::Vector3d y =
          (toLocal * (plane.Point(column, row, z) - one.field.means[0])).cwiseQuotient(one.field.scales[0]);
      sum += std::exp(Long(-0.5) * (y.squaredNorm() + z * z / (sigma * sigma)));
    }
    sum *= step / (std::sqrt(2 * kPi) * sigma);
    ASSERT_NEAR(exact.Weight(column, row), sum, 1e-12 * exact.PeakOfAllPlanes()) << "case " << k;
  }
}

/// How a splat's axes lie with respect to the plane.
enum class Attitude
{
  Any,
  InPlane,  ///< first axis in the plane, third along the normal
  Upright,  ///< first axis along the normal
  Grazing   ///< as InPlane, tilted by a thousandth
};

Eigen::Vector4d Turn(Random& random, const SlicePlane& plane, Attitude attitude)
{
  if (attitude == Attitude::Any)
  {
    return random.UnitQuaternion();
  }
  Eigen::Matrix3d frame;
  frame.col(0) = plane.columnStep.normalized();
  frame.col(2) = plane.Normal();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  const double angle = random.Uniform(0, 2 * kPi);
  const Eigen::Matrix3d spin = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const double tilt = attitude == Attitude::Upright ? kPi / 2 : (attitude == Attitude::Grazing ? 1e-3 : 0.0);
  return Quaternion(frame * spin * Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitY()).toRotationMatrix());
}

class Shapes : public EngineTest
{
};

constexpr double kNoTarget = std::numeric_limits<double>::quiet_NaN();

/// What is asked of an engine in float: 1e-4 up to 1e3, 1e-2 up to 1e5; at 1e6 the number is only stated. An
/// engine in double is held to its own rounding.
double AspectTarget(double aspect)
{
  return aspect < 2e3 ? 1e-4 : (aspect < 2e5 ? 1e-2 : kNoTarget);
}

/// Needles and pancakes of one aspect in every attitude: body(splat).
template <class Body>
void ForShapes(double aspect, bool needle, int count, Body&& body)
{
  Random random(11);
  // Two families: as long as a quarter of the image (and thinner than a pixel), and one pixel thin (and far
  // longer than the image).
  for (const double longest : {40 * kPixel, aspect * kPixel})
  {
    for (const Attitude attitude : {Attitude::Any, Attitude::InPlane, Attitude::Upright, Attitude::Grazing})
    {
      for (const double sigma : {0.0, 1e-6, 0.3})
      {
        for (int k = 0; k < count; ++k)
        {
          OneSplat one(RandomPlane(random, {0, 0, 0}, kPixel, kWidth, kHeight), sigma);
          const double thin = longest / aspect;
          one.field.scales[0] = {longest, needle ? thin : longest * std::max(0.6, 1 / aspect), thin};
          one.field.rotations[0] = Turn(random, one.plane, attitude);
          one.Place(random, k % 3 - 1);  // on the plane, and one deviation to either side
          body(one);
        }
      }
    }
  }
}

TEST_P(Shapes, NeedlesAndPancakes)
{
  const bool isFloat = UnitRoundoff(GetParam()) > 1e-10;
  for (const bool needle : {true, false})
  {
    for (double aspect = 1; aspect < 2e6; aspect *= 10)
    {
      const double target = AspectTarget(aspect);
      const bool stated = std::isnan(target);  // only stated; but no splat may be wrong by more than itself
      Worst worst;
      ForShapes(aspect, needle, 12,
                [&](const OneSplat& one)
                {
                  const ExactSplat exact(one.field, 0, one.plane);
                  const double allowed = isFloat ? (stated ? 1.0 : target) * static_cast<double>(exact.Peak())
                                                 : AllowedByRounding(one, exact, 0x1p-53);
                  Measure(*engine_, one, exact, exact.Peak(), allowed, worst);
                });
      char name[64];
      std::snprintf(name, sizeof(name), "%s 1 : %.0e", needle ? "needle" : "pancake", aspect);
      EXPECT_LE(worst.excess, 1.0) << name;
      if (stated && isFloat)
      {
        ConcludeFinite("aspect", name, GetParam(), worst.error, worst.nonFinite);
      }
      else
      {
        Conclude("aspect", name, GetParam(), worst.error, worst.excess, worst.nonFinite);
      }
    }
  }
}

TEST_P(Shapes, NeedlesAndPancakesInTraining)
{
  // A step of length 0 changes no parameter, but what an engine knew of the field beyond its own numbers is
  // gone. It is held against the beam integral of the field as it then gives it.
  const bool isFloat = UnitRoundoff(GetParam()) > 1e-10;
  for (const bool needle : {true, false})
  {
    for (double aspect = 1; aspect < 2e5; aspect *= 10)
    {
      Worst worst;
      ForShapes(aspect, needle, 6,
                [&](const OneSplat& one)
                {
                  Random random(19);
                  engine_->SetAccuracy({0.0});
                  engine_->SetField(one.field);
                  engine_->SetFrames(RandomSweep(random, {one.plane}, 0.5, 0.5));
                  engine_->TrainStep({0}, Loss::Parse("l2"), {0, 0, 0, 0}, {1e-9, 1e7, false});
                  OneSplat trained = one;
                  trained.field = engine_->GetField();
                  const ExactSplat exact(trained.field, 0, one.plane);
                  const double allowed = isFloat ? AspectTarget(aspect) * static_cast<double>(exact.Peak())
                                                 : AllowedByRounding(trained, exact, 0x1p-53);
                  MeasureImage(*engine_, trained, exact, exact.Peak(), allowed, worst);
                });
      char name[64];
      std::snprintf(name, sizeof(name), "%s 1 : %.0e, in training", needle ? "needle" : "pancake", aspect);
      Conclude("aspect", name, GetParam(), worst.error, worst.excess, worst.nonFinite);
    }
  }
}

TEST_P(Shapes, SizesFromTenThousandthsToTenThousandsOfAPixel)
{
  for (double size = 1e-4; size < 2e4; size *= 10)
  {
    Random random(12);
    Worst worst;
    for (int k = 0; k < 60; ++k)
    {
      OneSplat one(RandomPlane(random, {0, 0, 0}, kPixel, kWidth, kHeight), k % 2 ? 0.3 : 0.0);
      one.field.scales[0] = size * kPixel * Eigen::Vector3d(1, random.Uniform(0.5, 1), random.Uniform(0.5, 1));
      one.field.rotations[0] = random.UnitQuaternion();
      one.Place(random, random.Uniform(-2, 2));
      MeasureAgainstRounding(GetParam(), *engine_, one, worst);
    }
    char name[32];
    std::snprintf(name, sizeof(name), "%.0e px", size);
    Conclude("size", name, GetParam(), worst.error, worst.excess, worst.nonFinite);
  }
}

TEST_P(Shapes, UpToAThousandDeviationsOffThePlane)
{
  for (const double rho : {3.0, 5.0, 8.0, 12.0, 40.0, 100.0, 1e3})
  {
    Random random(13);
    Worst worst;
    for (int k = 0; k < 60; ++k)
    {
      OneSplat one(RandomPlane(random, {0, 0, 0}, kPixel, 48, 40), k % 3 ? 0.3 : 0.0);
      const double aspect = random.LogUniform(1, 1e3);
      const double size = random.LogUniform(1, 40) * kPixel;
      one.field.scales[0] = {size, k % 2 ? size : size / aspect, size / aspect};
      one.field.rotations[0] = random.UnitQuaternion();
      one.Place(random, k % 4 < 2 ? rho : -rho);
      // Over the peak on its own plane, where it is seen best: here it may be below any number there is.
      const ExactSplat exact(one.field, 0, one.plane);
      Measure(*engine_, one, exact, exact.PeakOfAllPlanes(), AllowedByRounding(one, exact, UnitRoundoff(GetParam())),
              worst);
    }
    char name[48];
    std::snprintf(name, sizeof(name), "%g deviations, over the peak on plane", rho);
    Conclude("off the plane", name, GetParam(), worst.error, worst.excess, worst.nonFinite);
  }
}

TEST_P(Shapes, BeamsFromNothingToAMetre)
{
  for (const double sigma : {0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1e3})
  {
    Random random(14);
    Worst worst;
    for (int k = 0; k < 60; ++k)
    {
      OneSplat one(RandomPlane(random, {0, 0, 0}, kPixel, kWidth, kHeight), sigma);
      const double aspect = random.LogUniform(1, 1e3);
      const double size = random.LogUniform(1, 40) * kPixel;
      one.field.scales[0] = {size, k % 2 ? size : size / aspect, size / aspect};
      one.field.rotations[0] = random.UnitQuaternion();
      one.Place(random, random.Uniform(-1, 1));
      MeasureAgainstRounding(GetParam(), *engine_, one, worst);
    }
    char name[48];
    std::snprintf(name, sizeof(name), "sigma_E %.0e mm, aspect to 1e3", sigma);
    Conclude("beam", name, GetParam(), worst.error, worst.excess, worst.nonFinite);
  }
}

TEST_P(Shapes, QuaternionsOfAnyLength)
{
  Worst worst;
  for (const double length : {1e-310, 1e-300, 1e-160, 1e-20, 0.3, 7.0, 1e20, 1e160, 1e300})
  {
    Random random(15);
    for (int k = 0; k < 10; ++k)
    {
      OneSplat one(RandomPlane(random, {0, 0, 0}, kPixel, 64, 48), 0.3);
      one.field.scales[0] = {2, 0.5, 0.2};
      one.field.rotations[0] = length * random.UnitQuaternion();
      one.Place(random, random.Uniform(-1, 1));
      MeasureAgainstRounding(GetParam(), *engine_, one, worst);
    }
  }
  Conclude("quaternions", "lengths 1e-310 to 1e300", GetParam(), worst.error, worst.excess, worst.nonFinite);
}

TEST_P(Shapes, PixelsLongSmallAndSheared)
{
  const struct
  {
    const char* name;
    double column, row, angle;  // mm, mm, radians between rows and columns
  } spacings[] = {{"1 x 1e-3 mm", 1, 1e-3, kPi / 2},       {"1e-3 x 1 mm", 1e-3, 1, kPi / 2},
                  {"100 x 1e-2 mm", 100, 1e-2, kPi / 2},   {"1e-3 x 1e-3 mm", 1e-3, 1e-3, kPi / 2},
                  {"2e-6 x 2e-6 mm", 2e-6, 2e-6, kPi / 2}, {"2e-6 x 1 mm", 2e-6, 1, kPi / 2},
                  {"1e3 x 1e3 mm", 1e3, 1e3, kPi / 2},     {"0.2 x 0.2 mm at 5 degrees", 0.2, 0.2, 0.0873}};
  for (const auto& spacing : spacings)
  {
    Random random(16);
    Worst worst;
    for (int k = 0; k < 40; ++k)
    {
      const Eigen::Matrix3d turn = RotationMatrix(random.UnitQuaternion());
      SlicePlane plane = FlatPlane(48, 40, spacing.column, spacing.row);
      plane.rowStep = spacing.row * Eigen::Vector3d(std::cos(spacing.angle), std::sin(spacing.angle), 0);
      plane.columnStep = turn * plane.columnStep;
      plane.rowStep = turn * plane.rowStep;
      plane.origin = -23.5 * plane.columnStep - 19.5 * plane.rowStep;
      // A few of the longer pixels, of the shorter, or their mean.
      const double pixel = k % 3 == 0   ? std::max(spacing.column, spacing.row)
                           : k % 3 == 1 ? std::min(spacing.column, spacing.row)
                                        : plane.PixelSize();
      OneSplat one(plane, k % 2 ? pixel : 0.0);
      one.field.scales[0] = pixel * Eigen::Vector3d(random.Uniform(1, 4), random.Uniform(1, 4), random.Uniform(1, 4));
      one.field.rotations[0] = random.UnitQuaternion();
      one.Place(random, random.Uniform(-1, 1));
      MeasureAgainstRounding(GetParam(), *engine_, one, worst);
    }
    Conclude("pixels", spacing.name, GetParam(), worst.error, worst.excess, worst.nonFinite);
  }
}

TEST_P(Shapes, AHundredMetresFromTheTrackersOrigin)
{
  Random random(17);
  Worst worst;
  for (int k = 0; k < 60; ++k)
  {
    const Eigen::Vector3d far(1e5 * (k % 2 ? 1 : -1), k % 3 ? 1e5 : 0, -1e5);
    OneSplat one(RandomPlane(random, far, kPixel, kWidth, kHeight), k % 2 ? 0.3 : 0.0);
    one.field.scales[0] = {random.LogUniform(0.1, 5), random.LogUniform(0.1, 5), random.LogUniform(0.1, 5)};
    one.field.rotations[0] = random.UnitQuaternion();
    one.Place(random, random.Uniform(-1, 1));
    MeasureAgainstRounding(GetParam(), *engine_, one, worst);
  }
  Conclude("coordinates", "one splat 1e5 mm away", GetParam(), worst.error, worst.excess, worst.nonFinite);
}

INSTANTIATE_TEST_SUITE_P(Engines, Shapes, ::testing::ValuesIn(FastEngines()), EngineTestName);

/// The reference engine is what fields of many Gaussians are held against, so it is held against the
/// integral.
TEST(Reference, EqualsTheBeamIntegralAtAnyAspect)
{
  const auto engine = Engine::Create("reference");
  Random random(18);
  Worst worst;
  for (int k = 0; k < 60; ++k)
  {
    OneSplat one(RandomPlane(random, {0, 0, 0}, kPixel, 48, 40), k % 2 ? random.LogUniform(1e-6, 1e3) : 0.0);
    const double aspect = random.LogUniform(1, 1e6), size = random.LogUniform(1, 40) * kPixel;
    one.field.scales[0] = {size, k % 4 < 2 ? size : size / aspect, size / aspect};
    one.field.rotations[0] = random.UnitQuaternion();
    one.Place(random, random.Uniform(-1, 1));
    const ExactSplat exact(one.field, 0, one.plane);
    Measure(*engine, one, exact, exact.Peak(), AllowedByRounding(one, exact, 0x1p-53), worst);
  }
  Conclude("aspect", "up to 1e6", "reference", worst.error, worst.excess, worst.nonFinite);
}

}  // namespace
