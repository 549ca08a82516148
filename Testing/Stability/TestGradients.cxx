// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gradients where shapes, sizes, frames and numbers are extreme: finite everywhere, and along the
// reference's.

#include <algorithm>
#include <limits>

#include "Stability/HardCases.h"

namespace
{

using namespace bigus;
using namespace bigus::test;

constexpr double kPixel = 0.3;  // mm
constexpr int kWidth = 40, kHeight = 32;

/// Three planes, and Gaussians that lie where one of them sees them: needles and pancakes of the given
/// aspect, the longest axis up to the image's width, within 1.5 deviations on or off the plane.
Problem Shaped(std::uint64_t seed, std::size_t count, double aspect, double elevationSigma, double low, double high)
{
  Random random(seed);
  Problem problem;
  std::vector<SlicePlane> planes;
  for (int f = 0; f < 3; ++f)
  {
    planes.push_back(RandomPlane(random, random.Vector(1), kPixel, kWidth, kHeight));
  }
  problem.sweep = RandomSweep(random, planes, low, high);
  problem.field = RandomField(random, count, 5, 1, 2, elevationSigma);
  for (std::size_t i = 0; i < count; ++i)
  {
    const double longest = random.Uniform(0.4, 1) * kWidth * kPixel;
    problem.field.scales[i] = {longest, i % 2 ? longest * random.Uniform(0.7, 1) : longest / aspect, longest / aspect};
    problem.field.reflectivities[i] = random.Uniform(0.1, 0.6) * (i % 4 ? 1 : -1);
    PlaceInView(problem.field, i, planes[i % 3], std::floor(random.Uniform(0, kWidth)),
                std::floor(random.Uniform(0, kHeight)), {random.Uniform(-1, 1), random.Uniform(-1, 1)},
                random.Uniform(-1.5, 1.5));
  }
  return problem;
}

FieldGradient GradientOf(Engine& engine, const Problem& problem, const Loss& loss, double* value = nullptr)
{
  engine.SetAccuracy({0.0});
  engine.SetField(problem.field);
  engine.SetFrames(problem.sweep);
  engine.ResetScores();
  const double result = engine.Backpropagate(AllFrames(*problem.sweep), loss);
  if (value)
  {
    *value = result;
  }
  return engine.GetGradient();
}

/// One Gaussian's gradient with every parameter in the unit in which it changes the splat alike: means in
/// standard deviations along the Gaussian's own axes, turns by s_j s_k / (s_j^2 + s_k^2) radians, r relative.
/// All ten numbers are then sums of g w times polynomials in whitened coordinates, of the size of |r| E_i.
Eigen::Matrix<double, 10, 1> Natural(const GaussianField& field, const FieldGradient& gradient, std::size_t i)
{
  const Eigen::Vector3d& s = field.scales[i];
  Eigen::Matrix<double, 10, 1> out;
  out.segment<3>(0) = (RotationMatrix(field.rotations[i]).transpose() * gradient.means[i]).cwiseProduct(s);
  out.segment<3>(3) = gradient.logScales[i];
  for (int k = 0; k < 3; ++k)
  {
    const double a = s[(k + 1) % 3], b = s[(k + 2) % 3];
    out[6 + k] = gradient.rotations[i][k] / (a / b + b / a);
  }
  out[9] = gradient.reflectivities[i] * field.reflectivities[i];
  return out;
}

struct Cosines
{
  double group = 1;      ///< worst over the four groups, each over all Gaussians as Adam sees it
  double gaussian = 1;   ///< worst over single Gaussians in natural units, where the gradient is conditioned
  std::size_t used = 0;  ///< how many those were
};

double Cosine(double dot, double a, double b)
{
  return a > 0 && b > 0 ? dot / std::sqrt(a * b) : (a == b ? 1.0 : 0.0);
}

/// A Gaussian's own gradient is a sum over pixels of terms of either sign. Where it all but cancels, below 2
/// % of sum |g| w, its direction is no property of the field but of the last digits of w (known to 1e-4), and
/// is left out; in the groups everything counts.
Cosines Compare(const Problem& problem, const FieldGradient& expected, const FieldGradient& actual,
                const Engine::Scores& scores)
{
  double dot[4] = {}, a[4] = {}, b[4] = {};
  Cosines cosines;
  for (std::size_t i = 0; i < problem.field.Size(); ++i)
  {
    const Eigen::Vector3d* pairs[3][2] = {{&expected.means[i], &actual.means[i]},
                                          {&expected.logScales[i], &actual.logScales[i]},
                                          {&expected.rotations[i], &actual.rotations[i]}};
    for (int g = 0; g < 3; ++g)
    {
      dot[g] += pairs[g][0]->dot(*pairs[g][1]);
      a[g] += pairs[g][0]->squaredNorm();
      b[g] += pairs[g][1]->squaredNorm();
    }
    dot[3] += expected.reflectivities[i] * actual.reflectivities[i];
    a[3] += expected.reflectivities[i] * expected.reflectivities[i];
    b[3] += actual.reflectivities[i] * actual.reflectivities[i];
    const auto x = Natural(problem.field, expected, i), y = Natural(problem.field, actual, i);
    if (x.norm() > 0.02 * std::abs(problem.field.reflectivities[i]) * scores.error[i])
    {
      ++cosines.used;
      cosines.gaussian = std::min(cosines.gaussian, Cosine(x.dot(y), x.squaredNorm(), y.squaredNorm()));
    }
  }
  for (int g = 0; g < 4; ++g)
  {
    cosines.group = std::min(cosines.group, Cosine(dot[g], a[g], b[g]));
  }
  return cosines;
}

class Gradients : public EngineTest
{
protected:
  std::unique_ptr<Engine> reference_ = Engine::Create("reference");

  /// Compares, reports and expects; `minimum` NaN: finite is all that is asked.
  void Check(const char* name, const std::vector<Problem>& problems, double minimum)
  {
    Cosines worst;
    std::size_t nonFinite = 0, size = 0;
    for (const Problem& problem : problems)
    {
      for (const Loss& loss : {Loss::Parse("l2"), Loss::Parse("l1")})
      {
        double expectedLoss = 0, loss2 = 0;
        const FieldGradient expected = GradientOf(*reference_, problem, loss, &expectedLoss);
        ASSERT_EQ(CountNonFinite(expected), 0u) << name;
        const FieldGradient actual = GradientOf(*engine_, problem, loss, &loss2);
        nonFinite += CountNonFinite(actual) + !std::isfinite(loss2);
        // Compare against the very same: at aspect 1e3 a float splat is off by 1e-4, and so are losses.
        const Cosines here = Compare(problem, expected, actual, reference_->GetScores());
        worst.group = std::min(worst.group, here.group);
        worst.gaussian = std::min(worst.gaussian, here.gaussian);
        worst.used += here.used;
        size += problem.field.Size();
      }
    }
    const std::string groups = std::string(name) + ", groups: 1 - cosine";
    const std::string gaussians = std::string(name) + ", each Gaussian: 1 - cosine";
    if (std::isnan(minimum))
    {
      ConcludeFinite("gradient", groups, GetParam(), 1 - worst.group, nonFinite);
      ConcludeFinite("gradient", gaussians, GetParam(), 1 - worst.gaussian, 0);
    }
    else
    {
      Conclude("gradient", groups, GetParam(), 1 - worst.group, (1 - worst.group) / (1 - minimum), nonFinite);
      Conclude("gradient", gaussians, GetParam(), 1 - worst.gaussian, (1 - worst.gaussian) / (1 - minimum), 0);
      EXPECT_GT(2 * worst.used, size) << name << ": too few Gaussians have a gradient to compare";
    }
  }
};

constexpr double kDirection = 0.99;
constexpr double kFiniteOnly = std::numeric_limits<double>::quiet_NaN();

TEST_P(Gradients, NeedlesAndPancakes)
{
  for (double aspect = 1; aspect < 2e6; aspect *= 10)
  {
    char name[32];
    std::snprintf(name, sizeof(name), "aspect %.0e", aspect);
    Check(name,
          {Shaped(41, 60, aspect, 0.0, 0.1, 0.9), Shaped(42, 60, aspect, 1e-6, 0.1, 0.9),
           Shaped(43, 60, aspect, 0.3, 0.1, 0.9), Shaped(44, 60, aspect, 5, 0.1, 0.9)},
          aspect < 2e3 ? kDirection : kFiniteOnly);
  }
}

TEST_P(Gradients, BlackAndSaturatedFrames)
{
  for (const double aspect : {1.0, 1e3})
  {
    char name[48];
    std::snprintf(name, sizeof(name), "black frames, aspect %g", aspect);
    Check(name, {Shaped(45, 60, aspect, 0.3, 0, 0)}, kDirection);
    std::snprintf(name, sizeof(name), "saturated frames, aspect %g", aspect);
    Check(name, {Shaped(46, 60, aspect, 0.3, 1, 1)}, kDirection);
  }
}

TEST_P(Gradients, SaturatedFields)
{
  // S in the thousands: 1 - I is below any number, and so is every gradient.
  Problem problem = Shaped(47, 60, 10, 0.3, 0, 1);
  for (double& r : problem.field.reflectivities)
  {
    r = std::abs(r) * 1e6;
  }
  Check("saturated field", {problem}, kFiniteOnly);
}

TEST_P(Gradients, SizesFromTenThousandthsToTenThousandsOfAPixel)
{
  std::vector<Problem> problems;
  for (double size = 1e-4; size < 2e4; size *= 10)
  {
    Problem problem = Shaped(48, 60, 3, 0.3, 0.1, 0.9);
    Random random(49);
    for (std::size_t i = 0; i < problem.field.Size(); ++i)
    {
      problem.field.scales[i] *= size / kWidth;
      PlaceInView(problem.field, i, problem.sweep->Plane(static_cast<int>(i % 3)),
                  std::floor(random.Uniform(0, kWidth)), std::floor(random.Uniform(0, kHeight)),
                  {random.Uniform(-1, 1), random.Uniform(-1, 1)}, random.Uniform(-1, 1));
    }
    problems.push_back(problem);
  }
  Check("sizes 1e-4 to 1e4 px", problems, kFiniteOnly);
}

TEST_P(Gradients, BeamsReflectivitiesAndPlacesAtTheirExtremes)
{
  std::vector<Problem> beams, reflectivities, places;
  for (const double sigma : {1e-4, 1e-2, 30.0, 1e3})
  {
    beams.push_back(Shaped(50, 40, 100, sigma, 0.1, 0.9));
  }
  for (const double magnitude : {1e-12, 1e-6, 1e6, 1e12})
  {
    Problem problem = Shaped(51, 40, 100, 0.3, 0.1, 0.9);
    for (double& r : problem.field.reflectivities)
    {
      r *= magnitude;
    }
    reflectivities.push_back(problem);
  }
  for (const double rho : {5.0, 30.0, 1e3})
  {
    Problem problem = Shaped(52, 40, 100, 0.3, 0.1, 0.9);
    for (std::size_t i = 0; i < problem.field.Size(); ++i)
    {
      PlaceInView(problem.field, i, problem.sweep->Plane(static_cast<int>(i % 3)), 20, 15, {0, 0}, rho);
    }
    places.push_back(problem);
  }
  Check("sigma_E 1e-4 to 1e3 mm", beams, kFiniteOnly);
  Check("r 1e-12 to 1e12", reflectivities, kFiniteOnly);
  Check("5 to 1e3 deviations off every plane", places, kFiniteOnly);
}

TEST_P(Gradients, AHundredMetresFromTheTrackersOrigin)
{
  Problem problem = Shaped(53, 60, 10, 0.3, 0.1, 0.9);
  const Eigen::Vector3d far(1e5, -1e5, 5e4);
  for (Eigen::Vector3d& mean : problem.field.means)
  {
    mean += far;
  }
  auto moved = std::make_shared<Sweep>(*problem.sweep);
  for (Eigen::Matrix4d& pose : moved->imageToReference)
  {
    pose.block<3, 1>(0, 3) += far;
  }
  problem.sweep = moved;
  Check("1e5 mm from the origin", {problem}, kDirection);
}

INSTANTIATE_TEST_SUITE_P(Engines, Gradients, ::testing::ValuesIn(FastEngines()), EngineTestName);

}  // namespace
