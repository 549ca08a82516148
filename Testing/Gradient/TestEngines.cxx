// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gradients against central differences, and the CPU engine against the reference engine.

#include <gtest/gtest.h>
#include <hwy/targets.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <iostream>
#include <set>

#include "Core/Engine/Engine.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/StateBytes.h"
#include "Support/Engines.h"
#include "Support/Fields.h"
#include "Support/Sweeps.h"

namespace
{

using bigus::test::EngineTest;
using bigus::test::EngineTestName;
using bigus::test::FastEngines;
using bigus::test::Flat;
using bigus::test::Problem;
using bigus::test::Random;
using bigus::test::RelativeError;

/// Eight Gaussians and a broad bright one, so that S > 0 everywhere and the loss is smooth.
struct SmallProblem
{
  bigus::GaussianField field;
  std::shared_ptr<bigus::Sweep> sweep;

  explicit SmallProblem(std::uint64_t seed, double elevationSigma)
  {
    Random random(seed);
    field = bigus::test::RandomField(random, 9, 3.0, 0.4, 2.0, elevationSigma);
    field.means[8] = {0.3, -0.2, 0.1};
    field.scales[8] = {9, 7, 8};
    field.reflectivities[8] = 3.0;
    std::vector<bigus::SlicePlane> planes;
    for (int i = 0; i < 3; ++i)
    {
      planes.push_back(bigus::test::RandomPlane(random, random.Vector(0.5), 0.5, 14, 12));
    }
    sweep = bigus::test::RandomSweep(random, planes, 0.1, 0.9);
  }
};

double LossOf(const bigus::GaussianField& field, const std::shared_ptr<bigus::Sweep>& sweep)
{
  const auto engine = bigus::Engine::Create("reference");
  engine->SetFrames(sweep);
  engine->SetField(field);
  return engine->Backpropagate({0, 1, 2}, bigus::Loss::Parse("l2"));
}

/// Fourth-order central difference of the loss along a change of the field.
template <class Change>
double Difference(const SmallProblem& problem, double h, Change&& change)
{
  const auto at = [&](double step)
  {
    bigus::GaussianField field = problem.field;
    change(field, step);
    return LossOf(field, problem.sweep);
  };
  return (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
}

void Compare(const std::vector<double>& analytic, const std::vector<double>& numeric, const char* group)
{
  double largest = 0;
  for (double value : numeric)
  {
    largest = std::max(largest, std::abs(value));
  }
  for (std::size_t i = 0; i < numeric.size(); ++i)
  {
    // Relative to the value itself, or to a thousandth of the group's largest where the value is smaller
    // still.
    EXPECT_NEAR(analytic[i], numeric[i], 1e-6 * std::max(std::abs(numeric[i]), 1e-3 * largest))
        << group << " component " << i;
  }
}

class GradientTest : public testing::TestWithParam<double>
{
};

TEST_P(GradientTest, EqualsCentralDifferences)
{
  const SmallProblem problem(7, GetParam());
  const auto engine = bigus::Engine::Create("reference");
  engine->SetFrames(problem.sweep);
  engine->SetField(problem.field);
  engine->Backpropagate({0, 1, 2}, bigus::Loss::Parse("l2"));
  const bigus::FieldGradient gradient = engine->GetGradient();
  const double h = 2e-3;
  std::vector<double> analytic[4], numeric[4];
  for (std::size_t i = 0; i < problem.field.Size(); ++i)
  {
    for (int k = 0; k < 3; ++k)
    {
      analytic[0].push_back(gradient.means[i][k]);
      numeric[0].push_back(
          Difference(problem, h, [=](bigus::GaussianField& f, double step) { f.means[i][k] += step; }));
      analytic[1].push_back(gradient.logScales[i][k]);
      numeric[1].push_back(
          Difference(problem, h, [=](bigus::GaussianField& f, double step) { f.scales[i][k] *= std::exp(step); }));
      analytic[2].push_back(gradient.rotations[i][k]);
      numeric[2].push_back(Difference(problem, h,
                                      [=](bigus::GaussianField& f, double step)
                                      {
                                        const Eigen::Matrix3d turn =
                                            Eigen::AngleAxisd(step, Eigen::Vector3d::Unit(k)).toRotationMatrix();
                                        f.rotations[i] =
                                            bigus::Quaternion(bigus::RotationMatrix(f.rotations[i]) * turn);
                                      }));
    }
    analytic[3].push_back(gradient.reflectivities[i]);
    numeric[3].push_back(
        Difference(problem, h, [=](bigus::GaussianField& f, double step) { f.reflectivities[i] += step; }));
  }
  const char* names[4] = {"mean", "log-scale", "rotation", "reflectivity"};
  for (int group = 0; group < 4; ++group)
  {
    Compare(analytic[group], numeric[group], names[group]);
  }
}

INSTANTIATE_TEST_SUITE_P(Beams, GradientTest, testing::Values(0.0, 0.3, 1.0, 5.0));

/// A problem large enough to use several chunks, bands and batches.
Problem LargeProblem()
{
  return bigus::test::RandomProblem(11, 3000, 12, 4, 0.3, 90, 71);
}

class FastEngine : public EngineTest
{
};

/// With tolerance 0 most exponentials are computed; with 1e-9 most footprints use the recurrence.
TEST_P(FastEngine, GradientEqualsTheReference)
{
  const Problem problem = LargeProblem();
  const auto reference = bigus::Engine::Create("reference");
  for (const double tolerance : {0.0, 1e-9})
  {
    bigus::FieldGradient gradients[2];
    double losses[2];
    bigus::Engine* const engines[2] = {reference.get(), engine_.get()};
    for (int e = 0; e < 2; ++e)
    {
      engines[e]->SetAccuracy({tolerance, true});
      engines[e]->SetFrames(problem.sweep);
      engines[e]->SetField(problem.field);
      losses[e] = engines[e]->Backpropagate({0, 1, 2, 3}, bigus::Loss::Parse("l2"));
      gradients[e] = engines[e]->GetGradient();
    }
    EXPECT_NEAR(losses[1], losses[0], 1e-5 * losses[0]);
    const auto check = [](const std::vector<double>& reference, const std::vector<double>& value, const char* group)
    {
      const double error = RelativeError(reference, value);
      EXPECT_LT(error, 1e-5) << group;
      std::cout << group << ": relative error " << error << '\n';
    };
    check(Flat(gradients[0].means), Flat(gradients[1].means), "mean");
    check(Flat(gradients[0].logScales), Flat(gradients[1].logScales), "log-scale");
    check(Flat(gradients[0].rotations), Flat(gradients[1].rotations), "rotation");
    check(gradients[0].reflectivities, gradients[1].reflectivities, "reflectivity");
  }
}

TEST_P(FastEngine, DropsNoMoreThanTheTolerance)
{
  const Problem problem = LargeProblem();
  const bigus::SlicePlane plane = problem.sweep->Plane(0);
  std::vector<float> expected(plane.NumberOfPixels()), image(plane.NumberOfPixels());
  const auto reference = bigus::Engine::Create("reference");
  reference->SetField(problem.field);
  reference->Render(plane, bigus::ViewOutput::Intensity, expected.data());
  engine_->SetField(problem.field);
  for (double tolerance : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5})
  {
    engine_->SetAccuracy({tolerance});
    engine_->Render(plane, bigus::ViewOutput::Intensity, image.data());
    double worst = 0;
    for (std::size_t i = 0; i < image.size(); ++i)
    {
      worst = std::max(worst, std::abs(static_cast<double>(image[i]) - expected[i]));
    }
    // Float sums of some hundred terms of order one round to about 1e-6.
    EXPECT_LT(worst, tolerance + 2e-6);
    std::cout << "tolerance " << tolerance << ": max |dI| " << worst << '\n';
  }
}

/// Restricts the engines made while it lives to some instruction sets (bits of hwy/targets.h).
class OnlyTargets
{
public:
  explicit OnlyTargets(std::int64_t targets)
  {
    hwy::SetSupportedTargetsForTest(targets);
    hwy::GetChosenTarget().DeInit();
  }
  ~OnlyTargets()
  {
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().DeInit();
  }
};

TEST(CpuEngine, EveryInstructionSetOfThisMachineEqualsTheReference)
{
  const Problem problem = LargeProblem();
  const auto reference = bigus::Engine::Create("reference");
  reference->SetFrames(problem.sweep);
  reference->SetField(problem.field);
  reference->Backpropagate({0, 2}, bigus::Loss::Parse("l2"));
  const bigus::FieldGradient expected = reference->GetGradient();
  std::set<std::string> devices;
  std::int64_t rest = hwy::SupportedTargets();
  while (rest != 0)
  {
    const OnlyTargets only(rest & -rest);
    rest &= rest - 1;
    for (const std::string name : {"cpu", "cpu-double"})
    {
      const auto engine = bigus::Engine::Create(name);
      if (!devices.insert(engine->Device()).second)
      {
        continue;  // the library was built without this one and took another
      }
      engine->SetAccuracy({1e-11, true});
      engine->SetFrames(problem.sweep);
      engine->SetField(problem.field);
      engine->Backpropagate({0, 2}, bigus::Loss::Parse("l2"));
      const bigus::FieldGradient gradient = engine->GetGradient();
      const double bound = name == "cpu" ? 1e-5 : 1e-6;  // rounding; what the tolerance drops
      EXPECT_LT(RelativeError(Flat(expected.means), Flat(gradient.means)), bound) << engine->Device();
      EXPECT_LT(RelativeError(Flat(expected.logScales), Flat(gradient.logScales)), bound) << engine->Device();
      EXPECT_LT(RelativeError(Flat(expected.rotations), Flat(gradient.rotations)), bound) << engine->Device();
      EXPECT_LT(RelativeError(expected.reflectivities, gradient.reflectivities), bound) << engine->Device();
      std::cout << engine->Device() << ": mean " << RelativeError(Flat(expected.means), Flat(gradient.means))
                << ", reflectivity " << RelativeError(expected.reflectivities, gradient.reflectivities) << '\n';
    }
  }
}

/// Three training steps, then all parameters as bytes.
std::vector<double> TrainBriefly(const std::string& name, int threads)
{
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  const Problem problem = LargeProblem();
  const auto engine = bigus::Engine::Create(name);
  engine->SetFrames(problem.sweep);
  engine->SetField(problem.field);
  for (int i = 0; i < 3; ++i)
  {
    engine->TrainStep({i, i + 1}, bigus::Loss(), {0.1, 0.05, 0.05, 0.02}, {});
  }
  const bigus::GaussianField field = engine->GetField();
  std::vector<double> all = Flat(field.means);
  const std::vector<double> scales = Flat(field.scales);
  all.insert(all.end(), scales.begin(), scales.end());
  all.insert(all.end(), field.reflectivities.begin(), field.reflectivities.end());
  std::vector<float> image(90 * 71), coverage(90 * 71);
  engine->Render(problem.sweep->Plane(0), bigus::ViewOutput::Intensity, image.data(), coverage.data());
  all.insert(all.end(), image.begin(), image.end());
  all.insert(all.end(), coverage.begin(), coverage.end());
  return all;
}

TEST_P(FastEngine, BitsDoNotDependOnTheNumberOfThreads)
{
  const std::vector<double> one = TrainBriefly(GetParam(), 1);
  for (int threads : {2, 5})
  {
    const std::vector<double> many = TrainBriefly(GetParam(), threads);
    ASSERT_EQ(one.size(), many.size());
    EXPECT_EQ(0, std::memcmp(one.data(), many.data(), one.size() * sizeof(double))) << threads << " threads";
  }
}

TEST_P(FastEngine, ATrainStepIsBackpropagateAndStep)
{
  const Problem problem = LargeProblem();
  const bigus::LearningRates rates{0.1, 0.05, 0.05, 0.02};
  std::vector<double> results[2];
  for (int fused = 0; fused < 2; ++fused)
  {
    const auto engine = bigus::Engine::Create(GetParam());
    engine->SetFrames(problem.sweep);
    engine->SetField(problem.field);
    engine->ResetScores();
    for (const std::vector<int>& batch : {std::vector<int>{0, 1}, {2, 3}, {1, 2}})
    {
      if (fused)
      {
        results[fused].push_back(engine->TrainStep(batch, bigus::Loss(), rates, {}));
      }
      else
      {
        results[fused].push_back(engine->Backpropagate(batch, bigus::Loss()));
        engine->Step(rates, {});
      }
    }
    const std::vector<double> means = Flat(engine->GetField().means), error = engine->GetScores().error;
    results[fused].insert(results[fused].end(), means.begin(), means.end());
    results[fused].insert(results[fused].end(), error.begin(), error.end());
    if (fused)
    {
      EXPECT_TRUE(engine->GetGradient().means.empty());
      EXPECT_THROW(engine->Step(rates, {}), bigus::Error);
    }
  }
  ASSERT_EQ(results[0].size(), results[1].size());
  for (std::size_t i = 0; i < results[0].size(); ++i)
  {
    ASSERT_EQ(results[0][i], results[1][i]) << "number " << i;
  }
}

TEST_P(FastEngine, AGaussiansStepsBecomeShorterByItsOwnCount)
{
  const Problem problem = LargeProblem();
  const auto change = [&](double settling, double settled)
  {
    const auto engine = bigus::Engine::Create(GetParam());
    engine->SetFrames(problem.sweep);
    engine->SetField(problem.field);
    const std::vector<double> before = engine->GetField().reflectivities;
    engine->TrainStep({0, 1}, bigus::Loss(), {0, 0, 0, 0.02, settling, settled}, {});
    std::vector<double> after = engine->GetField().reflectivities;
    for (std::size_t i = 0; i < after.size(); ++i)
    {
      after[i] -= before[i];
    }
    return after;
  };
  const std::vector<double> whole = change(0, 0), shorter = change(0.5, 0.1), least = change(5, 0.1);
  constexpr double kRounding = 1e-6;  // a few units in the last place of reflectivities near 1, in float
  std::size_t moved = 0;
  for (std::size_t i = 0; i < whole.size(); ++i)
  {
    moved += std::abs(whole[i]) > 0.01;
    EXPECT_NEAR(shorter[i], std::exp(-0.5) * whole[i], kRounding) << i;
    EXPECT_NEAR(least[i], 0.1 * whole[i], kRounding) << i;
  }
  EXPECT_GT(moved, whole.size() / 10);
}

TEST_P(FastEngine, AStateGoesOnWithTheSameBits)
{
  Problem problem = LargeProblem();
  for (std::size_t i = 0; i < problem.field.Size(); i += 5)
  {
    problem.field.scales[i][0] = 300 * problem.field.scales[i][2];  // needles, which are held in double as well
  }
  const bigus::LearningRates rates{0.1, 0.05, 0.05, 0.02};
  const auto stateOf = [](const bigus::Engine& engine)
  {
    bigus::StateWriter to;
    engine.SaveState(to);
    return to.Take();
  };
  const auto engine = bigus::Engine::Create(GetParam());
  engine->SetFrames(problem.sweep);
  engine->SetField(problem.field);
  engine->ResetScores();
  for (const int frame : {0, 1, 2, 3})
  {
    const std::string state = stateOf(*engine);
    const auto other = bigus::Engine::Create(GetParam());
    other->SetFrames(problem.sweep);
    other->SetField(problem.field);
    bigus::StateReader from(state);
    other->LoadState(from);
    from.End();
    EXPECT_EQ(stateOf(*other), state);
    const double loss = other->TrainStep({frame}, bigus::Loss(), rates, {});
    EXPECT_EQ(engine->TrainStep({frame}, bigus::Loss(), rates, {}), loss);
    EXPECT_EQ(Flat(other->GetField().means), Flat(engine->GetField().means));
    EXPECT_EQ(other->GetScores().error, engine->GetScores().error);
    EXPECT_TRUE(stateOf(*other) == stateOf(*engine)) << frame;
  }
}

TEST_P(FastEngine, AWindowHoldsTheBitsOfTheWhole)
{
  const Problem problem = LargeProblem();
  const bigus::SlicePlane plane = problem.sweep->Plane(1);
  engine_->SetField(problem.field);
  std::vector<float> whole(plane.NumberOfPixels());
  engine_->Render(plane, bigus::ViewOutput::Scattering, whole.data());
  const bigus::Engine::Window window{13, 29, 51, 37};
  std::vector<float> part(51 * 37);
  engine_->Render(plane, window, bigus::ViewOutput::Scattering, part.data(), nullptr);
  for (int row = 0; row < window.rows; ++row)
  {
    for (int column = 0; column < window.columns; ++column)
    {
      ASSERT_EQ(part[row * 51 + column], whole[(row + 29) * 90 + column + 13]) << column << ", " << row;
    }
  }
  EXPECT_THROW(engine_->Render(plane, {80, 0, 20, 10}, bigus::ViewOutput::Scattering, part.data(), nullptr),
               bigus::Error);
}

INSTANTIATE_TEST_SUITE_P(Engines, FastEngine, testing::ValuesIn(FastEngines()), EngineTestName);

TEST(Engine, RefusesWhatItCannotDo)
{
  EXPECT_THROW(bigus::Engine::Create("no such engine"), bigus::Error);
  for (const std::string& name : bigus::Engine::Names())
  {
    const auto engine = bigus::Engine::Create(name);
    EXPECT_THROW(engine->Backpropagate({0}, bigus::Loss()), bigus::Error);  // no frames
    const Problem problem = LargeProblem();
    engine->SetFrames(problem.sweep);
    EXPECT_THROW(engine->Backpropagate({}, bigus::Loss()), bigus::Error);
    EXPECT_THROW(engine->Backpropagate({4}, bigus::Loss()), bigus::Error);
    bigus::GaussianField bad = problem.field;
    bad.scales[7][1] = -1;
    EXPECT_THROW(engine->SetField(bad), bigus::Error);
  }
}

TEST(Engine, AnEmptyFieldIsBlack)
{
  for (const std::string& name : bigus::Engine::Names())
  {
    const auto engine = bigus::Engine::Create(name);
    engine->SetField({});
    bigus::SlicePlane plane;
    plane.width = 5;
    plane.height = 3;
    std::vector<float> image(15, 7.0f), coverage(15, 7.0f);
    engine->Render(plane, bigus::ViewOutput::Intensity, image.data(), coverage.data());
    EXPECT_EQ(image, std::vector<float>(15, 0.0f));
    EXPECT_EQ(coverage, std::vector<float>(15, 0.0f));
  }
}

}  // namespace
