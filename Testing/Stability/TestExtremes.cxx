// Engines where numbers are extreme: far from the origin, scales nine orders apart, steps far too long, no
// light.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "Core/Engine.h"
#include "Gradient/RandomField.h"

namespace
{

using bigus::test::Random;

std::vector<float> Render(const std::string& engine, const bigus::GaussianField& field,
                          const bigus::SlicePlane& plane, double tolerance)
{
  std::vector<float> image(plane.NumberOfPixels());
  const auto renderer = bigus::Engine::Create(engine);
  renderer->SetAccuracy({tolerance});
  renderer->SetField(field);
  renderer->Render(plane, bigus::ViewOutput::Scattering, image.data());
  return image;
}

double LargestDifference(const std::vector<float>& a, const std::vector<float>& b)
{
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
  {
    // A NaN must not get lost in a maximum.
    EXPECT_TRUE(std::isfinite(a[i]) && std::isfinite(b[i])) << "pixel " << i;
    largest = std::max(largest, std::abs(static_cast<double>(a[i]) - b[i]));
  }
  return largest;
}

TEST(Extremes, APatientFarFromTheTrackersOriginLooksTheSame)
{
  Random random(1);
  bigus::GaussianField field = bigus::test::RandomField(random, 400, 8, 0.2, 2, 0.5);
  bigus::SlicePlane plane = bigus::test::RandomPlane(random, {0, 0, 0}, 0.25, 60, 50);
  const std::vector<float> here = Render("cpu", field, plane, 1e-4);
  const Eigen::Vector3d far(1e5, -1e5, 5e4);  // mm: a hundred metres
  for (Eigen::Vector3d& mean : field.means)
  {
    mean += far;
  }
  plane.origin += far;
  EXPECT_LT(LargestDifference(Render("cpu", field, plane, 1e-4), here), 2e-4);
}

TEST(Extremes, ScalesNineOrdersApartStayWithinTheTolerance)
{
  Random random(2);
  for (const double elevationSigma : {0.0, 0.5, 10.0})
  {
    bigus::GaussianField field = bigus::test::RandomField(random, 300, 5, 1e-5, 1e4, elevationSigma);
    for (double& reflectivity : field.reflectivities)
    {
      reflectivity /= 300;  // so that 1e-3 is a fair measure of the sum
    }
    const bigus::SlicePlane plane = bigus::test::RandomPlane(random, {0, 0, 0}, 0.3, 40, 30);
    EXPECT_LT(LargestDifference(Render("cpu", field, plane, 1e-6), Render("reference", field, plane, 0)),
              1e-3)
        << "elevation sigma " << elevationSigma;
  }
}

TEST(Extremes, PlanesThatMissTheFieldAreBlack)
{
  Random random(3);
  const bigus::GaussianField field = bigus::test::RandomField(random, 200, 5, 0.1, 1, 0.3);
  for (const double distance : {50.0, 1e4, 1e6})
  {
    const bigus::SlicePlane plane =
        bigus::test::RandomPlane(random, {distance, distance, -distance}, 0.2, 20, 20);
    EXPECT_EQ(Render("cpu", field, plane, 1e-4), std::vector<float>(400, 0.0f)) << distance << " mm";
  }
}

struct Wild
{
  const char* name;
  double low, high;  // frames' intensities
};

class WildTraining : public ::testing::TestWithParam<Wild>
{
};

TEST_P(WildTraining, LeavesAValidFieldWithinItsLimits)
{
  Random random(4);
  std::vector<bigus::SlicePlane> planes;
  for (int i = 0; i < 4; ++i)
  {
    planes.push_back(bigus::test::RandomPlane(random, {0, 0, 0}, 0.3, 32, 24));
  }
  const auto sweep = bigus::test::RandomSweep(random, planes, GetParam().low, GetParam().high);
  const auto engine = bigus::Engine::Create("cpu");
  engine->SetField(bigus::test::RandomField(random, 200, 5, 0.1, 1, 0.3));
  engine->SetFrames(sweep, false);
  const bigus::ParameterLimits limits{0.05, 20, false};
  for (int step = 0; step < 60; ++step)
  {
    const double loss =
        engine->Backpropagate({0, 1, 2, 3}, step % 2 ? bigus::LossKind::L1 : bigus::LossKind::L2);
    ASSERT_TRUE(std::isfinite(loss)) << "step " << step;
    engine->Step({3, 2, 2, 5}, limits);  // hundreds of times what training uses
  }
  const bigus::GaussianField field = engine->GetField();
  ASSERT_NO_THROW(field.Validate());
  for (const Eigen::Vector3d& scale : field.scales)
  {
    EXPECT_GE(scale.minCoeff(), 0.05 * (1 - 1e-5));
    EXPECT_LE(scale.maxCoeff(), 20 * (1 + 1e-5));
  }
}

INSTANTIATE_TEST_SUITE_P(Frames, WildTraining,
                         ::testing::Values(Wild{"Noise", 0, 1}, Wild{"Black", 0, 0}, Wild{"White", 1, 1}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(Extremes, AGaussianThatNoFrameSeesStaysWhereItIs)
{
  Random random(5);
  bigus::GaussianField field = bigus::test::RandomField(random, 50, 3, 0.2, 1, 0.3);
  field.means[7] = {4000, 0, 0};
  const bigus::SlicePlane plane = bigus::test::RandomPlane(random, {0, 0, 0}, 0.3, 32, 24);
  const auto sweep = bigus::test::RandomSweep(random, {plane}, 0.2, 0.8);
  const auto engine = bigus::Engine::Create("cpu");
  engine->SetField(field);
  const bigus::GaussianField before = engine->GetField();
  engine->SetFrames(sweep, false);
  for (int step = 0; step < 5; ++step)
  {
    engine->Backpropagate({0}, bigus::LossKind::L1);
    engine->Step({0.1, 0.05, 0.05, 0.1}, {});
  }
  const bigus::GaussianField after = engine->GetField();
  EXPECT_EQ(after.means[7], before.means[7]);
  EXPECT_EQ(after.scales[7], before.scales[7]);
  EXPECT_EQ(after.reflectivities[7], before.reflectivities[7]);
  EXPECT_NE(after.means[8], before.means[8]);
}

}  // namespace
