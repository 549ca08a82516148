// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Echoes that depend on the direction: the model, the engines' part in it, the rule and the training.

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>
#include <tuple>

#include "Core/Engine/ViewEngine.h"
#include "Core/Model/Error.h"
#include "Core/Model/FieldRounding.h"
#include "Core/Model/FieldTransform.h"
#include "Core/Model/ViewDependence.h"
#include "Core/Phantom/Phantom.h"
#include "Core/StandardError/StandardError.h"
#include "Core/Training/GeometryDefaults.h"
#include "Core/Training/Judging.h"
#include "Core/Training/TrainingPlan.h"
#include "Core/Training/ViewTraining.h"
#include "Support/Engines.h"
#include "Support/Errors.h"
#include "Support/Fields.h"
#include "Support/Sweeps.h"

namespace
{

using bigus::Engine;
using bigus::GaussianField;
using bigus::RecordedViews;
using bigus::SlicePlane;
using bigus::Sweep;
using bigus::ViewDependence;
using bigus::ViewedReflectivities;
using bigus::ViewEngine;
using bigus::test::EngineTest;
using bigus::test::Random;
using bigus::test::RelativeError;

constexpr double kDegree = 0.017453292519943295;

/// Turns a frame about its image's centre.
void TurnFrame(Sweep& sweep, int frame, const Eigen::Vector3d& axisAngle)
{
  const SlicePlane plane = sweep.Plane(frame);
  const Eigen::Vector3d centre = plane.Point(0.5 * (plane.width - 1), 0.5 * (plane.height - 1));
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(axisAngle.norm(), axisAngle.normalized()).toRotationMatrix();
  Eigen::Matrix4d& pose = sweep.imageToReference[frame];
  pose.topLeftCorner<3, 3>() = turn * pose.topLeftCorner<3, 3>();
  pose.topRightCorner<3, 1>() = centre + turn * (pose.topRightCorner<3, 1>() - centre);
}

/// Frames 0.4 mm apart that are turned about their rows by `degrees`, to one side on the way there and to the other on
/// the way back.
std::shared_ptr<Sweep> TiltedThereAndBack(int frames, double degrees, int width = 32, int height = 28)
{
  auto sweep = bigus::test::BlackSweep(frames, width, height, 0.4, 0.4);
  for (int f = 0; f < frames; ++f)
  {
    const bool isBack = f >= frames / 2;
    const int place = isBack ? frames - 1 - f : f;
    sweep->imageToReference[f](2, 3) = 0.8 * (place - 0.25 * (frames - 1)) + (isBack ? 0.4 : 0);
    TurnFrame(*sweep, f, {(isBack ? -1 : 1) * degrees * kDegree * (1 + 0.2 * std::sin(f)), 0, 0});
  }
  return sweep;
}

ViewDependence RandomView(Random& random, const Sweep& sweep, std::size_t gaussians, double size)
{
  ViewDependence view{RecordedViews::Of(sweep, AllFrames(sweep)), {}};
  for (std::size_t i = 0; i < gaussians; ++i)
  {
    view.terms.push_back(random.Vector(size));
  }
  return view;
}

std::vector<float> Viewed(const GaussianField& field, const ViewDependence& view, const Sweep& sweep,
                          const std::vector<int>& frames)
{
  const ViewedReflectivities viewed(field, view);
  std::vector<float> all;
  for (const int frame : frames)
  {
    const std::vector<double> r = viewed.At(sweep.Plane(frame), 1);
    all.insert(all.end(), r.begin(), r.end());
  }
  return all;
}

TEST(ViewDependence, DirectionsAreAnglesFromTheMeanInUnitsOfTheirSize)
{
  auto sweep = bigus::test::BlackSweep(2, 8, 8, 0.5, 1.0);
  TurnFrame(*sweep, 0, {0.2, 0, 0});
  TurnFrame(*sweep, 1, {-0.2, 0, 0});
  const RecordedViews views = RecordedViews::Of(*sweep, {0, 1});
  EXPECT_TRUE(views.mean.isApprox(Eigen::Matrix3d::Identity(), 1e-12));
  EXPECT_NEAR(views.unit, 0.2 / std::sqrt(3.0), 1e-12);  // 2 of 6 components are 0.2, the others 0
  EXPECT_TRUE(views.Direction(sweep->Plane(0)).isApprox(Eigen::Vector3d(std::sqrt(3.0), 0, 0), 1e-9));
  EXPECT_NEAR(views.angleStep, 0.4 / kDegree, 1e-9);
  // In the middle both count alike, and beyond the second it counts more.
  const RecordedViews::Usual usual = views.UsualAt({{0, 0, 0}, {0, 0, 100}});
  EXPECT_NEAR(usual.directions[0].norm(), 0, 1e-9);
  EXPECT_LT(usual.directions[1][0], -1.7);
}

TEST(ViewDependence, ReachesFourStepsFromRecordedFrames)
{
  auto sweep = bigus::test::BlackSweep(9, 8, 8, 0.1, 1.0);
  for (int f = 0; f < 9; ++f)
  {
    TurnFrame(*sweep, f, {0.5 * kDegree * f, 0, 0});
  }
  const RecordedViews views = RecordedViews::Of(*sweep, AllFrames(*sweep));
  EXPECT_NEAR(views.angleStep, 0.5, 1e-9);
  EXPECT_NEAR(views.elevationStep, 1.0, 0.01);
  const auto at = [&](double degrees, double mm)
  {
    Sweep one = *sweep;
    TurnFrame(one, 8, {degrees * kDegree, 0, 0});
    SlicePlane plane = one.Plane(8);
    plane.origin += mm * plane.Normal();
    EXPECT_NEAR(views.Turn(plane), degrees, 1e-6);
    return views.Nearness(plane);
  };
  EXPECT_EQ(at(0, 0), 1);
  EXPECT_NEAR(at(1.5, 0), 0.5, 1e-6);
  EXPECT_EQ(at(2.01, 0), 0);
  EXPECT_NEAR(at(0, 3 * views.elevationStep), 0.5, 0.02);
  EXPECT_EQ(at(90, 0), 0);
}

TEST(ViewDependence, TurnsWithTheField)
{
  Random random(5);
  const auto sweep = TiltedThereAndBack(12, 6);
  const GaussianField field = bigus::test::RandomField(random, 20, 4.0, 0.4, 2.0, 0.3);
  const ViewDependence view = RandomView(random, *sweep, field.Size(), 0.3);
  for (const double mirror : {1.0, -1.0})
  {
    Eigen::Matrix4d transform = Eigen::Matrix4d::Identity();
    transform.topLeftCorner<3, 3>() = 2.5 * bigus::RotationMatrix(random.UnitQuaternion()) *
                                      Eigen::Matrix3d(Eigen::Vector3d(1, mirror, 1).asDiagonal());
    transform.topRightCorner<3, 1>() = random.Vector(30);
    const ViewedReflectivities before(field, view), after(Transformed(field, transform), Transformed(view, transform));
    SlicePlane plane = sweep->Plane(3);
    plane.origin += 1.2 * plane.Normal();
    SlicePlane moved = plane;
    moved.origin = transform.topLeftCorner<3, 3>() * plane.origin + transform.topRightCorner<3, 1>();
    moved.columnStep = transform.topLeftCorner<3, 3>() * plane.columnStep;
    moved.rowStep = transform.topLeftCorner<3, 3>() * plane.rowStep;
    EXPECT_NEAR(before.Nearness(plane), after.Nearness(moved), 1e-9);
    EXPECT_LT(RelativeError(before.At(plane, 1), after.At(moved, 1)), 1e-9);
  }
}

TEST(ViewDependence, RefusesWhatIsNone)
{
  Random random(6);
  const auto sweep = TiltedThereAndBack(12, 6);
  const ViewDependence sound = RandomView(random, *sweep, 3, 0.3);
  EXPECT_NO_THROW(sound.Validate(3));
  const auto refuses = [](ViewDependence view, const char* what)
  { bigus::test::ExpectRefused([&] { view.Validate(3); }, {what}); };
  ViewDependence wrong = sound;
  wrong.terms.pop_back();
  refuses(wrong, "2 terms for 3");
  wrong = sound;
  wrong.terms[1][2] = NAN;
  refuses(wrong, "Gaussian 1");
  wrong = sound;
  wrong.views.unit = 0;
  refuses(wrong, "unit");
  wrong = sound;
  wrong.views.poses[4](0, 0) *= 1.1;
  refuses(wrong, "recorded pose 4");
  wrong = sound;
  wrong.views.poses.clear();
  refuses(wrong, "0 recorded poses");
}

TEST(ViewDependence, RoundsToWhatItStays)
{
  Random random(7);
  ViewDependence view = RandomView(random, *TiltedThereAndBack(12, 6), 50, 0.3);
  const ViewDependence exact = view;
  RoundView(view);
  for (std::size_t i = 0; i < view.terms.size(); ++i)
  {
    EXPECT_LE((view.terms[i] - exact.terms[i]).cwiseAbs().maxCoeff(), exact.terms[i].cwiseAbs().maxCoeff() / 256);
  }
  const ViewDependence once = view;
  RoundView(view);
  EXPECT_EQ(view.terms, once.terms);
}

class ViewEngines : public EngineTest
{
};

/// The gradient by q from the engine's derivatives, sum over planes of m0 (delta - c), against differences of the loss.
TEST_P(ViewEngines, GradientByTermsIsThatOfTheLoss)
{
  ViewEngine* const walker = ViewEngine::Of(*engine_);
  if (!walker)
  {
    GTEST_SKIP() << "renders directions, but is not trained with them";
  }
  Random random(8);
  auto sweep = TiltedThereAndBack(6, 8, 14, 12);
  std::generate_n(bigus::test::Pixels(*sweep), 6 * sweep->PixelsPerFrame(),
                  [&random] { return static_cast<float>(random.Uniform(0.2, 0.8)); });
  GaussianField field = bigus::test::RandomField(random, 8, 2.0, 0.5, 1.5, 0.3);
  field.means[7] = {0, 0, 0};
  field.scales[7] = {9, 9, 9};  // bright, so that the loss is smooth
  field.reflectivities[7] = 3;
  const std::vector<int> frames = {0, 2, 5};
  ViewDependence view = RandomView(random, *sweep, field.Size(), 0.2);
  const bigus::Loss loss = bigus::Loss::Parse("l2");
  const auto lossOf = [&](const ViewDependence& at, std::vector<float>& derivatives)
  {
    const auto reference = Engine::Create("reference");
    reference->SetFrames(sweep);
    reference->SetField(field);
    return ViewEngine::Of(*reference)->Backpropagate(frames, loss, Viewed(field, at, *sweep, frames), derivatives);
  };
  engine_->SetAccuracy({0});
  engine_->SetFrames(sweep);
  engine_->SetField(field);
  std::vector<float> derivatives, ignored;
  walker->Backpropagate(frames, loss, Viewed(field, view, *sweep, frames), derivatives);
  const std::vector<Eigen::Vector3d> usual = view.views.UsualAt(field.means).directions;
  std::vector<double> analytic, numeric;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    for (int axis = 0; axis < 3; ++axis)
    {
      double sum = 0;
      for (std::size_t f = 0; f < frames.size(); ++f)
      {
        sum += derivatives[f * field.Size() + i] * (view.views.Direction(sweep->Plane(frames[f])) - usual[i])[axis];
      }
      analytic.push_back(sum);
      const double h = 0.02;  // values of r are handed over in float: differences are off by 1e-7 / h
      const auto at = [&](double step)
      {
        ViewDependence changed = view;
        changed.terms[i][axis] += step;
        return lossOf(changed, ignored);
      };
      numeric.push_back((8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h));
    }
  }
  EXPECT_LT(RelativeError(numeric, analytic), 2e-4);
}

/// An engine's gradient at reflectivities of each plane's own is the reference's.
TEST_P(ViewEngines, GradientIsTheReferences)
{
  ViewEngine* const walker = ViewEngine::Of(*engine_);
  if (!walker)
  {
    GTEST_SKIP() << "renders directions, but is not trained with them";
  }
  bigus::test::Problem problem = bigus::test::RandomProblem(9, 150, 6.0, 4, 0.4, 40, 34);
  Random random(10);
  const std::vector<int> frames = {0, 1, 3};
  std::vector<float> values(frames.size() * problem.field.Size());
  std::generate(values.begin(), values.end(), [&random] { return static_cast<float>(random.Uniform(-1, 1)); });
  const auto gradientOf = [&](Engine& engine, std::vector<float>& derivatives)
  {
    engine.SetAccuracy({0});
    engine.SetFrames(problem.sweep);
    engine.SetField(problem.field);
    ViewEngine::Of(engine)->Backpropagate(frames, bigus::Loss::Parse("l2"), values, derivatives);
    std::vector<double> flat = bigus::test::Flat(engine.GetGradient());
    return flat;
  };
  std::vector<float> expected, derivatives;
  const auto reference = Engine::Create("reference");
  const std::vector<double> gradient = gradientOf(*reference, expected);
  const double tolerance = bigus::test::IsDouble(GetParam()) ? 1e-6 : 1e-4;  // the values themselves are floats
  EXPECT_LT(RelativeError(gradient, gradientOf(*engine_, derivatives)), tolerance);
  EXPECT_LT(RelativeError({expected.begin(), expected.end()}, {derivatives.begin(), derivatives.end()}), tolerance);
  // Afterwards the field is what it was.
  EXPECT_LT(RelativeError(problem.field.reflectivities, walker->Reflectivities()), 1e-6);
}

/// <y, J x> = <J^T y, x>, also where the field's own reflectivities are nothing beside x.
TEST_P(ViewEngines, WalkIsALinearMapAndItsTranspose)
{
  ViewEngine* const walker = ViewEngine::Of(*engine_);
  if (!walker)
  {
    GTEST_SKIP() << "renders directions, but is not trained with them";
  }
  bigus::test::Problem problem = bigus::test::RandomProblem(11, 100, 6.0, 2, 0.4, 40, 34);
  for (double& r : problem.field.reflectivities)
  {
    r *= 1e-6;
  }
  engine_->SetFrames(problem.sweep);
  engine_->SetField(problem.field);
  Random random(12);
  std::vector<float> x(2 * problem.field.Size()), sums;
  std::generate(x.begin(), x.end(), [&random] { return static_cast<float>(random.Uniform(-1, 1)); });
  const std::size_t pixels = problem.sweep->PixelsPerFrame();
  std::vector<float> y(2 * pixels);
  std::generate(y.begin(), y.end(), [&random] { return static_cast<float>(random.Uniform(-1, 1)); });
  std::vector<double> products(2 * pixels);
  walker->Walk(
      {0, 1}, x,
      [&](std::size_t f, int row, float* line)
      {
        for (int column = 0; column < problem.sweep->width; ++column)
        {
          const std::size_t at = f * pixels + static_cast<std::size_t>(row) * problem.sweep->width + column;
          products[at] = static_cast<double>(line[column]) * y[at];
          line[column] = y[at];
        }
      },
      &sums);
  const double forward = std::accumulate(products.begin(), products.end(), 0.0);
  double backward = 0, scale = 0;
  for (std::size_t i = 0; i < x.size(); ++i)
  {
    backward += static_cast<double>(sums[i]) * x[i];
    scale += std::abs(static_cast<double>(sums[i]) * x[i]);
  }
  EXPECT_GT(scale, 1);
  EXPECT_NEAR(forward, backward, 1e-5 * scale);
}

/// A plane across sees the field as it is, to the last bit; one near a recorded frame sees r(P), whichever the engine.
TEST_P(ViewEngines, PlanesSeeWhatTheirDirectionsShow)
{
  Random random(13);
  const auto sweep = TiltedThereAndBack(12, 6);
  const GaussianField field = bigus::test::RandomField(random, 60, 5.0, 0.5, 2.0, 0.3);
  const ViewDependence view = RandomView(random, *sweep, field.Size(), 0.4);
  SlicePlane across = sweep->Plane(5);
  std::swap(across.columnStep, across.rowStep);
  bigus::SeenField seen(*engine_, field, &view);
  const auto render = [](Engine& engine, const SlicePlane& plane)
  {
    std::vector<float> image(plane.NumberOfPixels());
    engine.Render(plane, bigus::ViewOutput::Intensity, image.data());
    return image;
  };
  EXPECT_EQ(seen.LookFrom(sweep->Plane(2)), 1);
  const std::vector<float> near = render(*engine_, sweep->Plane(2));
  EXPECT_EQ(seen.LookFrom(across), 0);
  const std::vector<float> far = render(*engine_, across);
  const auto plain = Engine::Create(GetParam());
  plain->SetField(field);
  EXPECT_EQ(far, render(*plain, across));
  GaussianField there = field;
  there.reflectivities = ViewedReflectivities(field, view).At(sweep->Plane(2), 1);
  plain->SetField(there);
  EXPECT_EQ(near, render(*plain, sweep->Plane(2)));
}

INSTANTIATE_TEST_SUITE_P(Engines, ViewEngines, ::testing::ValuesIn(bigus::test::FastEngines()),
                         bigus::test::EngineTestName);

/// Frames of a field whose echoes depend on the direction by `size`, and a plan to train it with.
struct Directed
{
  std::shared_ptr<Sweep> sweep = TiltedThereAndBack(36, 4);
  GaussianField field;
  ViewDependence view;
  std::vector<int> training, heldOut;
  bigus::TrainingPlan plan;

  explicit Directed(double size)
  {
    Random random(14);
    field = bigus::test::RandomField(random, 250, 6.0, 0.6, 1.5, 0.3);
    for (double& r : field.reflectivities)
    {
      r = std::abs(r) + 0.3;
    }
    view = RandomView(random, *sweep, field.Size(), size);
    const auto engine = Engine::Create("cpu");
    bigus::SeenField seen(*engine, field, &view);
    for (int f = 0; f < sweep->NumberOfFrames(); ++f)
    {
      seen.LookFrom(sweep->Plane(f));
      engine->Render(sweep->Plane(f), bigus::ViewOutput::Intensity,
                     bigus::test::Pixels(*sweep) + f * sweep->PixelsPerFrame());
    }
    std::tie(training, heldOut) = bigus::SplitHoldOut(sweep->NumberOfFrames(), 6);
    plan.gaussians = 1000;
    plan.iterations = 120;
    plan.pixelSize = 0.4;
    plan.loss = bigus::Loss::Parse("l2");
  }

  RecordedViews Views() const { return RecordedViews::Of(*sweep, training); }
  std::optional<bigus::ViewEvidence> Ask() const
  {
    return bigus::AskForViews(sweep, training, plan, [] { return true; });
  }
  bigus::ViewedField Train() const
  {
    const auto engine = Engine::Create("cpu");
    const bigus::ViewTargets targets = {sweep, training, {}};
    return *bigus::TrainViews(*engine, targets, plan, field, {Views(), {}}, [] { return true; });
  }
};

TEST(ViewTraining, FramesSayWhetherDirectionsMatter)
{
  const std::optional<bigus::ViewEvidence> matter = Directed(0.15).Ask(), not_ = Directed(0).Ask();
  ASSERT_TRUE(matter && not_);
  EXPECT_TRUE(matter->IsWorth()) << matter->gain << " (" << matter->error << ")";
  EXPECT_FALSE(not_->IsWorth()) << not_->gain << " (" << not_->error << ")";
}

/// Speckle differs with the angle that it is seen from. Where each place is seen once, nothing can be learned of that.
TEST(ViewTraining, FramesThatCrossSaySoAndFramesSideBySideDoNot)
{
  const auto ask = [](double degrees)
  {
    bigus::PhantomOptions made;
    made.width = made.height = 40;
    made.pixelSize = 0.4;
    made.frames = 32;
    const auto one = std::make_shared<const Sweep>(bigus::Phantom(made).MakeSweep());
    made.sweepAngle = degrees;
    const auto sweep =
        degrees > 0 ? bigus::Join({one, std::make_shared<const Sweep>(bigus::Phantom(made).MakeSweep())}) : one;
    const std::vector<int> frames = AllFrames(*sweep);
    bigus::TrainingPlan plan = PlanByGeometry({}, *sweep, frames);
    plan.gaussians *= 4;  // as many are chosen on such sweeps
    return bigus::AskForViews(sweep, frames, plan, [] { return true; });
  };
  for (const double degrees : {15.0, 45.0, 90.0})
  {
    const std::optional<bigus::ViewEvidence> crossing = ask(degrees);
    ASSERT_TRUE(crossing);
    EXPECT_TRUE(crossing->IsWorth()) << degrees << ": " << crossing->gain << " (" << crossing->error << ")";
  }
  const std::optional<bigus::ViewEvidence> alone = ask(0);
  ASSERT_TRUE(alone);
  EXPECT_FALSE(alone->IsWorth()) << alone->gain << " (" << alone->error << ")";
}

TEST(ViewTraining, OneOrientationIsNotAsked)
{
  Directed directed(0);
  for (Eigen::Matrix4d& pose : directed.sweep->imageToReference)
  {
    pose.topLeftCorner<3, 3>() = Eigen::Vector3d(0.4, 0.4, 1).asDiagonal();
  }
  EXPECT_FALSE(directed.Ask());
}

TEST(ViewTraining, FramesHeldOutAreShownBetterAndTheFieldAloneNoWorse)
{
  const Directed directed(0.15);
  const bigus::ViewedField trained = directed.Train();
  const auto engine = Engine::Create("cpu");
  const auto psnr = [&](const GaussianField& field, const ViewDependence* view)
  {
    bigus::SeenField seen(*engine, field, view);
    double sum = 0;
    for (const int frame : directed.heldOut)
    {
      seen.LookFrom(directed.sweep->Plane(frame));
      sum += bigus::MeanPsnr(*engine, *directed.sweep, {frame});
    }
    return sum / static_cast<double>(directed.heldOut.size());
  };
  const double before = psnr(directed.field, nullptr);
  EXPECT_GT(psnr(trained.field, &trained.view), before + 3);
  // That field is the truth's, which steps of Adam only jitter about.
  EXPECT_GT(psnr(trained.field, nullptr), before - 1);
}

TEST(ViewTraining, GivesTheSameBitsForAnyNumberOfThreads)
{
  const Directed directed(0.15);
  const bigus::ViewedField several = directed.Train();
  const std::optional<bigus::ViewEvidence> evidence = directed.Ask();
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const bigus::ViewedField alone = directed.Train();
  EXPECT_TRUE(bigus::test::SameField(several.field, alone.field));
  EXPECT_EQ(several.view.terms, alone.view.terms);
  EXPECT_EQ(evidence->gain, directed.Ask()->gain);
}

TEST(ViewTraining, WhoSaysStopGetsNothing)
{
  const Directed directed(0.15);
  const auto engine = Engine::Create("cpu");
  int asked = 0;
  const auto stop = [&asked] { return ++asked < 3; };
  EXPECT_FALSE(bigus::TrainViews(*engine, {directed.sweep, directed.training, {}}, directed.plan, directed.field,
                                 {directed.Views(), {}}, stop));
  EXPECT_EQ(asked, 3);
}

/// Frames are what the field shows from their directions, so there is no error on them, and more where each Gaussian is as
/// it usually looks: on planes across, and in volumes.
TEST(ViewStandardError, IsOfWhatPlanesSee)
{
  const Directed directed(0.15);
  const Sweep& sweep = *directed.sweep;
  const bigus::StandardError alike(directed.field, sweep, directed.training, 0, "cpu");
  const bigus::StandardError made(directed.field, sweep, directed.training, 0, "cpu", &directed.view);
  const bigus::StandardError seen(made.ToBytes());
  EXPECT_EQ(seen.ToBytes(), made.ToBytes());
  const auto sigma = [](const bigus::StandardError& error, const SlicePlane& plane)
  {
    std::vector<float> image(plane.NumberOfPixels(), 0.5f), values(image.size());
    error.Evaluate(plane, image.data(), values.data());
    return values;
  };
  const SlicePlane frame = sweep.Plane(directed.training[5]);
  const float halfGrey = 0.5f / 255;
  for (const float value : sigma(seen, frame))
  {
    ASSERT_NEAR(value, halfGrey, 1e-6);
  }
  const auto mean = [](const std::vector<float>& values)
  { return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size()); };
  EXPECT_GT(mean(sigma(alike, frame)), 3 * halfGrey);

  const auto expectSame = [](const std::vector<float>& a, const std::vector<float>& b)
  {
    EXPECT_TRUE(
        std::equal(a.begin(), a.end(), b.begin(), [](float x, float y) { return x == y || (x != x && y != y); }));
  };
  SlicePlane across = frame;
  across.rowStep = frame.Normal() * frame.rowStep.norm();
  expectSame(sigma(seen, across), sigma(alike, across));
  Eigen::Matrix4d grid = sweep.imageToReference[directed.training[5]];
  const bigus::Extent extent = {0, sweep.width - 1, 0, sweep.height - 1, 0, 0};
  std::vector<float> volume(sweep.PixelsPerFrame());
  const auto grey = [&](const bigus::Extent&, float* image)
  {
    std::fill_n(image, volume.size(), 0.5f);
    return true;
  };
  ASSERT_TRUE(seen.Evaluate({grid, extent, extent}, grey, volume.data(), true));
  expectSame(volume, sigma(alike, frame));
}

}  // namespace
