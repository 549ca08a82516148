// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What is the CUDA engine's own, beside what every engine must do: memory that runs out, losses without cuFFT, stacks
// of planes, batches of changing size. On a device where there is one, and on the emulated one everywhere.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <string>

#include "Core/Engine/Engine.h"
#include "Core/Evaluation/Evaluation.h"
#include "Core/Model/Error.h"
#include "Core/Trainer/Trainer.h"
#include "Emulator.h"
#include "Support/Engines.h"
#include "Support/Fields.h"
#include "Support/Sweeps.h"

namespace
{

using namespace bigus;
using bigus::test::Problem;
using bigus::test::Random;

Problem SmallProblem()
{
  return bigus::test::RandomProblem(3, 500, 6, 5, 0.25, 50, 37);
}

std::vector<float> RenderFirst(Engine& engine, const Problem& problem)
{
  const SlicePlane plane = problem.sweep->Plane(0);
  std::vector<float> image(plane.NumberOfPixels());
  engine.Render(plane, ViewOutput::Intensity, image.data());
  return image;
}

/// Whatever a test does to the emulator, the next one finds it as it was.
class EmulatedCuda : public ::testing::Test
{
protected:
  void TearDown() override
  {
    emulator::SetMemory(std::size_t(8) << 30);
    emulator::SetHasFourier(true);
  }
};

TEST_F(EmulatedCuda, MemoryThatRunsOutIsSaidAndTheEngineGoesOn)
{
  const Problem problem = SmallProblem();
  const auto engine = Engine::Create("cuda-emulated");
  engine->SetField(problem.field);
  const std::vector<float> before = RenderFirst(*engine, problem);
  emulator::SetMemory(emulator::MemoryUsed() + 4096);
  GaussianField large = problem.field;
  Random random(1);
  large = bigus::test::RandomField(random, 20000, 6.0, 0.2, 1.5, 0.4);
  try
  {
    engine->SetField(large);
    FAIL();
  }
  catch (const Error& error)
  {
    const std::string what = error.what();
    EXPECT_NE(what.find("MiB"), std::string::npos) << what;
    EXPECT_NE(what.find("fewer Gaussians"), std::string::npos) << what;
    EXPECT_NE(what.find("'cpu'"), std::string::npos) << what;
  }
  EXPECT_EQ(engine->FieldSize(), 0u);
  EXPECT_EQ(engine->GetField().Size(), 0u);
  emulator::SetMemory(std::size_t(8) << 30);
  EXPECT_EQ(RenderFirst(*engine, problem), std::vector<float>(before.size(), 0.0f));
  engine->SetField(problem.field);
  EXPECT_EQ(RenderFirst(*engine, problem), before);
}

TEST_F(EmulatedCuda, AllMemoryIsGivenBack)
{
  const std::size_t before = emulator::MemoryUsed();
  {
    const Problem problem = SmallProblem();
    const auto engine = Engine::Create("cuda-emulated");
    engine->SetFrames(problem.sweep);
    engine->SetField(problem.field);
    engine->TrainStep({0, 1}, Loss(), {0.1, 0.1, 0.1, 0.1}, {});
    // Frames are counted there and not here.
    EXPECT_GT(engine->MemoryUse(), std::size_t(100000));
    EXPECT_GE(emulator::MemoryUsed() - before, engine->MemoryUse());
  }
  EXPECT_EQ(emulator::MemoryUsed(), before);
}

TEST_F(EmulatedCuda, SpectraAreTheHostsWithoutCuFft)
{
  const Problem problem = SmallProblem();
  double losses[2];
  std::vector<double> gradients[2];
  for (const bool has : {false, true})
  {
    emulator::SetHasFourier(has);
    const auto engine = Engine::Create("cuda-emulated");
    engine->SetFrames(problem.sweep);
    engine->SetField(problem.field);
    losses[has] = engine->Backpropagate({0, 3}, Loss::Parse("ffl"));
    gradients[has] = engine->GetGradient().reflectivities;
  }
  EXPECT_NEAR(losses[0], losses[1], 1e-5 * losses[0]);
  EXPECT_LT(bigus::test::RelativeError(gradients[0], gradients[1]), 1e-5);
}

class CudaEngine : public bigus::test::EngineTest
{
};

/// A recorded step is repeated where it can be and recorded anew where it must: after other batches, rates, fields and
/// losses in between, the field is the one that Backpropagate and Step give.
TEST_P(CudaEngine, RepeatsRecordedStepsOfAnyBatch)
{
  const Problem problem = SmallProblem();
  const LearningRates fast{0.1, 0.05, 0.05, 0.02}, slow{0.01, 0.005, 0.005, 0.002};
  std::vector<double> results[2];
  for (const bool fused : {false, true})
  {
    const auto engine = Engine::Create(GetParam());
    engine->SetFrames(problem.sweep);
    engine->SetField(problem.field);
    const auto step = [&](const std::vector<int>& batch, const Loss& loss, const LearningRates& rates)
    {
      if (fused)
      {
        results[fused].push_back(engine->TrainStep(batch, loss, rates, {}));
      }
      else
      {
        results[fused].push_back(engine->Backpropagate(batch, loss));
        engine->Step(rates, {});
      }
    };
    step({0, 1}, Loss(), fast);
    step({2, 3}, Loss(), slow);
    step({4}, Loss(), slow);
    step({1, 0}, Loss::Parse("l2"), fast);
    RenderFirst(*engine, problem);
    step({1, 0}, Loss::Parse("l1+dssim"), fast);
    step({1, 4}, Loss::Parse("l2"), fast);
    engine->SetAccuracy({1e-3, true});
    step({0, 2}, Loss(), fast);
    engine->ResetScores();
    step({0, 2}, Loss(), fast);
    const std::vector<double> error = engine->GetScores().error;
    results[fused].insert(results[fused].end(), error.begin(), error.end());
    std::vector<int> parents(problem.field.Size());
    for (std::size_t i = 0; i < parents.size(); ++i)
    {
      parents[i] = static_cast<int>(i);
    }
    engine->SetField(engine->GetField(), &parents);
    step({0, 1, 2, 3, 4}, Loss(), slow);
    const GaussianField field = engine->GetField();
    results[fused].insert(results[fused].end(), field.reflectivities.begin(), field.reflectivities.end());
  }
  EXPECT_EQ(results[0], results[1]);
}

TEST_P(CudaEngine, RendersStacksAsSinglePlanes)
{
  const Problem problem = SmallProblem();
  engine_->SetField(problem.field);
  std::vector<SlicePlane> planes;
  for (int frame = 0; frame < 5; ++frame)
  {
    planes.push_back(problem.sweep->Plane(frame));
  }
  const std::size_t pixels = planes[0].NumberOfPixels();
  std::vector<float> stack(5 * pixels), coverage(5 * pixels), image(pixels), covered(pixels);
  engine_->RenderStack(planes, ViewOutput::Intensity, stack.data(), coverage.data());
  for (int frame = 0; frame < 5; ++frame)
  {
    engine_->Render(planes[frame], ViewOutput::Intensity, image.data(), covered.data());
    EXPECT_TRUE(std::equal(image.begin(), image.end(), stack.begin() + frame * pixels)) << frame;
    EXPECT_TRUE(std::equal(covered.begin(), covered.end(), coverage.begin() + frame * pixels)) << frame;
  }
  planes[3].width += 1;
  EXPECT_THROW(engine_->RenderStack(planes, ViewOutput::Intensity, stack.data(), nullptr), Error);
}

// Densification turns a rounding into another Gaussian, so two engines, or one engine on two processors, reach different
// fields from the same seed. Seeds spread as much as roundings do; therefore engines are compared by their means over
// seeds, and the bound is three standard errors of the difference of two means that have the CPU engine's spread.
TEST_P(CudaEngine, TrainsAsWellAsTheCpu)
{
  constexpr int kSeeds = 3;
  const auto sweep = bigus::test::RenderedSweep();
  const auto train = [&sweep](const std::string& engine, int seed)
  {
    TrainerOptions options;
    options.engine = engine;
    options.automatic = false;
    options.gaussians = 600;
    options.iterations = 80;
    options.holdOut = 4;
    options.seed = static_cast<std::uint64_t>(seed);
    options.densification.interval = 20;
    options.densification.cap = 700;
    const TrainingResult result = Train(sweep, options);
    return ScoreField(result.field, *sweep, result.heldOutFrames, "cpu").psnr;
  };
  double mean = 0, square = 0, difference = 0;
  for (int seed = 1; seed <= kSeeds; ++seed)
  {
    const double onCpu = train("cpu", seed);
    mean += onCpu / kSeeds;
    square += onCpu * onCpu / kSeeds;
    difference += (train(GetParam(), seed) - onCpu) / kSeeds;
  }
  const double variance = (square - mean * mean) * kSeeds / (kSeeds - 1);
  const double bound = 3 * std::sqrt(2 * variance / kSeeds);
  EXPECT_LT(std::abs(difference), bound);
  std::cout << "held-out PSNR " << difference << " dB above the CPU's " << mean << " dB; bound " << bound << "\n";
}

INSTANTIATE_TEST_SUITE_P(Engines, CudaEngine, ::testing::ValuesIn(bigus::test::FastEngines()),
                         bigus::test::EngineTestName);

}  // namespace
