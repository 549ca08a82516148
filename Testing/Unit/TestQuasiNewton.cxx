// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Steps that know curvature: the loss falls with each, faster than by Adam, at planes of any angle and within limits.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <memory>
#include <numeric>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Training/QuasiNewton.h"
#include "Support/Fields.h"
#include "Support/Random.h"
#include "Support/Sweeps.h"

namespace bigus::test
{
namespace
{

constexpr double kPixel = 0.5;  // mm
constexpr int kSide = 24, kPlanes = 24;

enum class Planes
{
  Parallel,
  Oblique
};

/// A field, what it shows, and a field near it to begin with.
struct Fit
{
  std::shared_ptr<Sweep> sweep;
  GaussianField start;
  std::vector<int> frames = std::vector<int>(kPlanes);
  ParameterLimits limits{0.2, 5, false};

  Fit(Planes planes, double elevationSigma)
  {
    std::iota(frames.begin(), frames.end(), 0);
    Random random(31);
    const GaussianField truth = RandomField(random, 200, 5.5, 0.5, 1.2, elevationSigma);
    sweep = BlackSweep(kPlanes, kSide, kSide, kPixel, kPixel);
    const auto engine = Engine::Create("cpu-double");
    engine->SetField(truth);
    for (const int k : frames)
    {
      if (planes == Planes::Oblique)
      {
        sweep->imageToReference[k] = RandomPlane(random, random.Vector(2), kPixel, kSide, kSide).ImageToReference();
      }
      engine->Render(sweep->Plane(k), ViewOutput::Intensity, Pixels(*sweep) + k * sweep->PixelsPerFrame());
    }
    start = truth;
    for (std::size_t i = 0; i < start.Size(); ++i)
    {
      start.means[i] += random.Vector(0.3);
      start.scales[i] *= random.Uniform(0.8, 1.25);
      start.reflectivities[i] *= random.Uniform(0.7, 1.3);
    }
  }

  std::unique_ptr<Engine> NewEngine(const GaussianField& field) const
  {
    auto engine = Engine::Create("cpu");
    engine->SetAccuracy({1e-5, true});
    engine->SetField(field);
    engine->SetFrames(sweep);
    return engine;
  }

  /// The loss after every step, the first before all.
  std::vector<double> Losses(Engine& engine, const Loss& loss, int steps) const
  {
    std::vector<double> losses{engine.Backpropagate(frames, loss)};
    QuasiNewton training(engine, *sweep, frames, limits);
    for (int k = 0; k < steps; ++k)
    {
      losses.push_back(training.Step(loss));
    }
    return losses;
  }
};

const Loss kSquares = Loss::Parse("l2");

TEST(QuasiNewton, EveryStepLowersTheLossFurtherThanAdam)
{
  constexpr int kSteps = 40;
  const Fit fit(Planes::Parallel, 0);
  const auto engine = fit.NewEngine(fit.start);
  const std::vector<double> losses = fit.Losses(*engine, kSquares, kSteps);
  for (std::size_t k = 1; k < losses.size(); ++k)
  {
    EXPECT_LT(losses[k], losses[k - 1]) << "step " << k;
  }
  // What it returns is the loss of the field that the engine has.
  EXPECT_NEAR(engine->Backpropagate(fit.frames, kSquares), losses.back(), 1e-6 * losses.back());

  // As many passes of Adam in steps of eight frames at the trainer's first rates, falling to a tenth.
  const auto other = fit.NewEngine(fit.start);
  for (int pass = 0; pass < kSteps; ++pass)
  {
    const double rate = std::pow(0.1, static_cast<double>(pass) / kSteps);
    for (int first = 0; first < kPlanes; first += 8)
    {
      std::vector<int> batch(8);
      std::iota(batch.begin(), batch.end(), first);
      other->TrainStep(batch, kSquares, {0.3 * kPixel * rate, 0.08 * rate, 0.08 * rate, 0.07 * rate, 0, 0}, fit.limits);
    }
  }
  EXPECT_LT(losses.back(), 0.5 * other->Backpropagate(fit.frames, kSquares));
}

TEST(QuasiNewton, PlanesOfAnyAngleAThickBeamAndAMaskAreFitted)
{
  Fit fit(Planes::Oblique, 0.6);
  std::vector<std::uint8_t> mask(kSide * kSide, 1);
  std::fill_n(mask.begin(), 5 * kSide, std::uint8_t(0));
  fit.sweep->mask = std::make_shared<const std::vector<std::uint8_t>>(mask);
  for (const char* const loss : {"l2", "l1"})
  {
    const auto engine = fit.NewEngine(fit.start);
    const std::vector<double> losses = fit.Losses(*engine, Loss::Parse(loss), 40);
    EXPECT_TRUE(std::is_sorted(losses.rbegin(), losses.rend())) << loss;
    EXPECT_LT(losses.back(), (*loss == 'l' && loss[1] == '2' ? 0.02 : 0.15) * losses.front()) << loss;
  }
}

TEST(QuasiNewton, ScalesAndSignsStayWithinTheirLimits)
{
  Fit fit(Planes::Parallel, 0);
  fit.limits = {0.6, 0.9, true};
  for (std::size_t i = 0; i < fit.start.Size(); ++i)
  {
    fit.start.scales[i] = fit.start.scales[i].cwiseMax(0.6).cwiseMin(0.9);
    fit.start.reflectivities[i] = std::abs(fit.start.reflectivities[i]);
  }
  const auto engine = fit.NewEngine(fit.start);
  const std::vector<double> losses = fit.Losses(*engine, kSquares, 30);
  EXPECT_LT(losses.back(), 0.5 * losses.front());
  const GaussianField field = engine->GetField();
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    EXPECT_GE(field.scales[i].minCoeff(), 0.6 * (1 - 1e-6));
    EXPECT_LE(field.scales[i].maxCoeff(), 0.9 * (1 + 1e-6));
    EXPECT_GE(field.reflectivities[i], 0);
  }
}

// So who counts passes to know the end counts every step as one at least.
TEST(QuasiNewton, WhereNothingIsLeftToGainNoPassIsMadeAndTheFieldStays)
{
  Fit fit(Planes::Parallel, 0);
  fit.sweep = BlackSweep(kPlanes, kSide, kSide, kPixel, kPixel);
  std::fill(fit.start.reflectivities.begin(), fit.start.reflectivities.end(), 0.0);
  const auto engine = fit.NewEngine(fit.start);
  const GaussianField before = engine->GetField();
  QuasiNewton training(*engine, *fit.sweep, fit.frames, fit.limits);
  for (int step = 0; step < 3; ++step)
  {
    EXPECT_EQ(training.Step(kSquares), 0);
  }
  EXPECT_EQ(training.Passes(), 1);
  EXPECT_EQ(engine->GetField().means, before.means);
  EXPECT_EQ(engine->GetField().reflectivities, before.reflectivities);
}

TEST(QuasiNewton, TheBitsDoNotDependOnThreads)
{
  const Fit fit(Planes::Oblique, 0.3);
  std::vector<GaussianField> fields;
  for (const int threads : {1, 2, 3})
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const auto engine = fit.NewEngine(fit.start);
    fit.Losses(*engine, kSquares, 12);
    fields.push_back(engine->GetField());
  }
  EXPECT_TRUE(SameField(fields[0], fields[1]));
  EXPECT_TRUE(SameField(fields[0], fields[2]));
}

}  // namespace
}  // namespace bigus::test
