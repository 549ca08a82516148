// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Alignment of a frame to a field: known displacements are found, priors and bounds hold, nothing visible
// moves nothing.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/Error.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Poses/Alignment.h"
#include "Core/Trainer/Trainer.h"
#include "Support/Errors.h"
#include "Support/Fields.h"
#include "Support/Sweeps.h"

namespace bigus::test
{
namespace
{

constexpr double pixel = 0.3;  // mm
constexpr int width = 90, height = 70;

/// Blobs of 2 to 5 pixels, overlapping, of both signs on a bright ground.
GaussianField Scene()
{
  Random random(11);
  GaussianField field = RandomField(random, 2500, 20.0, 2 * pixel, 5 * pixel, 0.3);
  field.means.push_back({0, 0, 0});
  field.scales.push_back({30, 30, 30});
  field.rotations.push_back({1, 0, 0, 0});
  field.reflectivities.push_back(0.8);
  return field;
}

std::unique_ptr<Engine> EngineWith(const GaussianField& field, const char* name = "cpu")
{
  auto engine = Engine::Create(name);
  engine->SetField(field);
  return engine;
}

/// One frame of the scene taken at `truth` that claims to lie at `tracked`.
std::shared_ptr<Sweep> FrameAt(const SlicePlane& truth, const SlicePlane& tracked)
{
  auto sweep = BlackSweep(1, truth.width, truth.height, pixel, 1);
  sweep->imageToReference[0] = tracked.ImageToReference();
  EngineWith(Scene(), "reference")->Render(truth, ViewOutput::Intensity, Pixels(*sweep));
  return sweep;
}

SlicePlane Oblique()
{
  Random random(5);
  return RandomPlane(random, {1, -2, 0.5}, pixel, width, height);
}

/// Largest distance between where two planes put the same corner, mm.
double CornerDistance(const SlicePlane& a, const SlicePlane& b)
{
  double distance = 0;
  for (double i : {0, a.width - 1})
  {
    for (double j : {0, a.height - 1})
    {
      distance = std::max(distance, (a.Point(i, j) - b.Point(i, j)).norm());
    }
  }
  return distance;
}

/// Where the tracker claims the frame to be, for the truth to lie at (translation, rotation) from there: the
/// inverse motion, found by repetition because axes turn with the plane.
SlicePlane TrackedFor(const SlicePlane& truth, const Eigen::Vector3d& translation, const Eigen::Vector3d& rotation)
{
  const SlicePlane back = Moved(truth, Eigen::Vector3d::Zero(), -rotation);
  return Moved(back, -translation, Eigen::Vector3d::Zero());
}

/// Root mean square difference of the sweep's frame to what the field shows at `plane`, lit pixels alone.
double Residual(Engine& engine, const Sweep& sweep, const SlicePlane& plane)
{
  const std::vector<float> frame = FrameOf(sweep, 0);
  std::vector<float> shown(frame.size());
  engine.Render(plane, ViewOutput::Intensity, shown.data());
  double squares = 0, lit = 0;
  for (std::size_t p = 0; p < frame.size(); ++p)
  {
    squares += sweep.IsLit(p) ? std::pow(static_cast<double>(shown[p]) - frame[p], 2) : 0;
    lit += sweep.IsLit(p);
  }
  return std::sqrt(squares / lit);
}

}  // namespace

TEST(Moved, ShiftsAndTurnsAboutTheCentreInThePlanesAxes)
{
  SlicePlane plane;  // rows along +y, columns along -x: the normal is +z
  plane.columnStep = {0, 2, 0};
  plane.rowStep = {-1, 0, 0};
  plane.origin = {10, 20, 30};
  plane.width = 11;
  plane.height = 21;
  const SlicePlane shifted = Moved(plane, {1, 2, 3}, {0, 0, 0});
  EXPECT_TRUE(shifted.origin.isApprox(Eigen::Vector3d(8, 21, 33), 1e-14));
  EXPECT_EQ(shifted.columnStep, plane.columnStep);

  // A quarter turn about the normal takes the rows' direction to the columns'.
  const SlicePlane turned = Moved(plane, {0, 0, 0}, {0, 0, 90});
  EXPECT_TRUE(turned.columnStep.isApprox(Eigen::Vector3d(-2, 0, 0), 1e-14));
  EXPECT_TRUE(turned.rowStep.isApprox(Eigen::Vector3d(0, -1, 0), 1e-14));
  EXPECT_TRUE(turned.Point(5, 10).isApprox(plane.Point(5, 10), 1e-14)) << "the centre stays";

  // About the rows' axis, +y: x goes to -z.
  const SlicePlane tipped = Moved(plane, {0, 0, 0}, {90, 0, 0});
  EXPECT_TRUE(tipped.columnStep.isApprox(plane.columnStep, 1e-14));
  EXPECT_TRUE(tipped.rowStep.isApprox(Eigen::Vector3d(0, 0, 1), 1e-14));
}

TEST(Alignment, FindsWhereTheFrameWasTaken)
{
  const SlicePlane truth = Oblique();
  const auto engine = EngineWith(Scene());
  const struct
  {
    Eigen::Vector3d translation, rotation;
  } motions[] = {{{0.3, 0, 0}, {0, 0, 0}},
                 {{0, -0.3, 0}, {0, 0, 0}},
                 {{0, 0, 0.4}, {0, 0, 0}},
                 {{0, 0, 0}, {1, 0, 0}},
                 {{0, 0, 0}, {0, -1, 0}},
                 {{0, 0, 0}, {0, 0, 1}},
                 {{0.2, 0.1, -0.3}, {0.5, -0.6, 0.4}}};
  for (const auto& motion : motions)
  {
    const SlicePlane tracked = TrackedFor(truth, motion.translation, motion.rotation);
    const auto sweep = FrameAt(truth, tracked);
    const RigidAlignment found = AlignFrame(*engine, *sweep, 0);
    EXPECT_LT(CornerDistance(found.plane, truth), 0.02 * pixel) << "from " << CornerDistance(tracked, truth);
    EXPECT_NEAR(found.translation, motion.translation.norm(), 0.01 * pixel);
    EXPECT_NEAR(found.rotation, motion.rotation.norm(), 0.01);
    EXPECT_LT(Residual(*engine, *sweep, found.plane), 0.01 * Residual(*engine, *sweep, tracked));
    EXPECT_EQ(found.plane.width, width);
    EXPECT_EQ(found.plane.height, height);
  }
}

TEST(Alignment, OfAFrameInPlaceMovesNothing)
{
  const SlicePlane truth = Oblique();
  const auto sweep = FrameAt(truth, truth);
  const RigidAlignment found = AlignFrame(*EngineWith(Scene()), *sweep, 0);
  EXPECT_LT(CornerDistance(found.plane, truth), 0.01 * pixel);
}

TEST(Alignment, UnderNoiseIsAsGoodAsTheNoiseAllows)
{
  const SlicePlane truth = Oblique();
  const auto sweep = FrameAt(truth, TrackedFor(truth, {0.2, -0.2, 0.2}, {0.4, 0.3, -0.3}));
  const double n = static_cast<double>(sweep->PixelsPerFrame());
  Random random(7);
  double squares = 0;
  for (std::size_t p = 0; p < sweep->PixelsPerFrame(); ++p)
  {
    float& value = Pixels(*sweep)[p];
    const float clean = value;
    value = std::clamp(clean + static_cast<float>(random.Uniform(-0.1, 0.1)), 0.0f, 1.0f);
    squares += std::pow(static_cast<double>(value) - clean, 2);
  }
  const auto engine = EngineWith(Scene());
  const RigidAlignment found = AlignFrame(*engine, *sweep, 0);
  EXPECT_LT(CornerDistance(found.plane, truth), 0.3 * pixel);
  // The fit explains noise as six parameters do: the gain over the true pose, in units of the noise's
  // variance, follows chi-squared with 6 degrees of freedom (25 has a chance of 3e-4).
  const double gain = (squares - n * std::pow(Residual(*engine, *sweep, found.plane), 2)) / (squares / n);
  EXPECT_GT(gain, 0);
  EXPECT_LT(gain, 25);
}

TEST(Alignment, IgnoresMaskedPixels)
{
  const SlicePlane truth = Oblique();
  const auto sweep = FrameAt(truth, TrackedFor(truth, {0.3, 0.1, 0.2}, {0, 0.5, 0}));
  auto mask = std::make_shared<std::vector<std::uint8_t>>(sweep->PixelsPerFrame(), std::uint8_t(1));
  for (std::size_t p = 0; p < mask->size(); ++p)
  {
    if (p % width < 30)
    {
      (*mask)[p] = 0;
      Pixels(*sweep)[p] = 1;
    }
  }
  const auto engine = EngineWith(Scene());
  EXPECT_GT(CornerDistance(AlignFrame(*engine, *sweep, 0).plane, truth), 0.1 * pixel);
  sweep->mask = mask;
  const RigidAlignment found = AlignFrame(*engine, *sweep, 0);
  EXPECT_LT(CornerDistance(found.plane, truth), 0.02 * pixel);
  EXPECT_LT(Residual(*engine, *sweep, found.plane), 1e-3);
}

TEST(Alignment, LeavesAFrameThatShowsNothing)
{
  const SlicePlane truth = Oblique();
  const auto expectStay = [](Engine& engine, const Sweep& sweep)
  {
    const RigidAlignment found = AlignFrame(engine, sweep, 0);
    EXPECT_EQ(found.plane.ImageToReference(), sweep.Plane(0).ImageToReference());
    EXPECT_EQ(found.translation, 0);
    EXPECT_EQ(found.rotation, 0);
  };
  const auto black = BlackSweep(1, width, height, pixel, 1);
  expectStay(*EngineWith(Scene()), *black);
  const auto sweep = FrameAt(truth, truth);
  expectStay(*EngineWith(GaussianField{}), *sweep);
  GaussianField far = Scene();
  for (Eigen::Vector3d& mean : far.means)
  {
    mean += Eigen::Vector3d(5000, 0, 0);
  }
  expectStay(*EngineWith(far), *sweep);
  sweep->mask = std::make_shared<std::vector<std::uint8_t>>(sweep->PixelsPerFrame(), std::uint8_t(0));
  expectStay(*EngineWith(Scene()), *sweep);
}

TEST(Alignment, IsNeverWorseThanTheTrackedPose)
{
  Random random(17);
  const auto engine = EngineWith(Scene());
  for (int k = 0; k < 6; ++k)  // frames of elsewhere: no motion within reach explains them
  {
    const auto sweep = FrameAt(RandomPlane(random, random.Vector(4), pixel, 40, 30),
                               RandomPlane(random, random.Vector(4), pixel, 40, 30));
    const RigidAlignment found = AlignFrame(*engine, *sweep, 0);
    EXPECT_LE(Residual(*engine, *sweep, found.plane), Residual(*engine, *sweep, sweep->Plane(0)));
    EXPECT_LE(found.translation, 2 + 1e-12);
    EXPECT_LE(found.rotation, 3 + 1e-12);
  }
}

// The honest case: the field was trained on other frames and explains this one only roughly.
TEST(Alignment, FindsHeldOutFramesOfAPhantom)
{
  PhantomOptions world;
  world.frames = 15;
  world.width = world.height = 64;
  world.pixelSize = 0.4;
  world.frameSpacing = 0.4;
  world.elevationSigma = 1;
  const auto sweep = std::make_shared<Sweep>(Phantom(world).MakeSweep());
  TrainerOptions training;
  training.automatic = false;
  training.gaussians = 6000;
  training.iterations = 150;
  training.holdOut = 5;
  const TrainingResult trained = Train(sweep, training);
  const auto engine = EngineWith(trained.field);
  ASSERT_EQ(trained.heldOutFrames.size(), 3u);
  for (int frame : trained.heldOutFrames)
  {
    const SlicePlane truth = sweep->Plane(frame);
    Sweep displaced = sweep->Subset({frame});
    const SlicePlane tracked = Moved(truth, {0.2, -0.15, 0.25}, {-0.4, 0.3, 0.5});
    displaced.imageToReference[0] = tracked.ImageToReference();
    const RigidAlignment found = AlignFrame(*engine, displaced, 0);
    EXPECT_GT(CornerDistance(tracked, truth), 0.4);
    EXPECT_LT(CornerDistance(found.plane, truth), 0.1);
    const double residual = Residual(*engine, displaced, found.plane);
    EXPECT_GT(residual, 0.01) << "the field is no copy of the frame";
    EXPECT_LT(residual, 0.9 * Residual(*engine, displaced, tracked));
  }
}

TEST(Alignment, DoesNotDependOnTheNumberOfThreads)
{
  const SlicePlane truth = Oblique();
  const auto sweep = FrameAt(truth, TrackedFor(truth, {0.2, 0.1, -0.3}, {0.5, -0.6, 0.4}));
  const auto measure = [&]
  {
    const RigidAlignment found = AlignFrame(*EngineWith(Scene()), *sweep, 0);
    return std::pair(found.plane.ImageToReference(), found.translation);
  };
  const auto one = [&]
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    return measure();
  }();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 5);
  EXPECT_EQ(measure(), one);
}

TEST(Alignment, OfNoFrameIsRefused)
{
  const auto sweep = BlackSweep(1, 4, 4, 1, 1);
  EXPECT_THROW(AlignFrame(*EngineWith(Scene()), *sweep, 1), Error);
}

}  // namespace bigus::test
