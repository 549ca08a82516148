// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Training from bad starts never leaves a parameter that is not finite, and what guards it stays out of good
// training.

#include <algorithm>

#include "Stability/HardCases.h"
#include "Support/Sweeps.h"

namespace
{

using namespace bigus;
using namespace bigus::test;

class Training : public EngineTest
{
};

/// Everything one should not start from: needles and pancakes up to 1e6, exact duplicates, pairs that cancel,
/// specks of 1e-4 pixels and clouds of 1e4, reflectivities over 24 orders.
GaussianField BadField(Random& random, std::size_t count)
{
  GaussianField field = RandomField(random, count, 5, 0.2, 1, 0.3);
  for (std::size_t i = 0; i < count; ++i)
  {
    const double size = i % 5 == 0 ? random.LogUniform(3e-5, 3e3) : random.LogUniform(0.3, 10);
    const double aspect = i % 5 == 1 ? random.LogUniform(1, 1e6) : random.LogUniform(1, 10);
    field.scales[i] = {size, i % 2 ? size : size / aspect, size / aspect};
    if (i % 7 == 0)
    {
      field.reflectivities[i] = (i % 2 ? 1 : -1) * random.LogUniform(1e-12, 1e12);
    }
    if (i % 4 == 3)
    {
      field.means[i] = field.means[i - 1];
      field.scales[i] = field.scales[i - 1];
      field.rotations[i] = field.rotations[i - 1];
      field.reflectivities[i] = field.reflectivities[i - 1] * (i % 8 == 3 ? 1 : -1);
    }
  }
  return field;
}

/// Four frames of one size through the field, their pixels in [low, high].
std::shared_ptr<Sweep> BadFrames(Random& random, double low, double high)
{
  std::vector<SlicePlane> planes;
  for (int f = 0; f < 4; ++f)
  {
    planes.push_back(RandomPlane(random, random.Vector(1), 0.3, 32, 24));
  }
  return RandomSweep(random, planes, low, high);
}

struct BadStart
{
  const char* name;
  double low, high;  ///< frames' intensities
  LearningRates rates;
  ParameterLimits limits;
};

TEST_P(Training, AThousandStepsFromABadStart)
{
  const BadStart starts[] = {
      {"noise", 0, 1, {0.1, 0.05, 0.05, 0.05}, {}},
      {"black frames", 0, 0, {0.1, 0.05, 0.05, 0.05}, {}},
      {"saturated frames", 1, 1, {0.1, 0.05, 0.05, 0.05}, {}},
      // Means that move little stay in view, so that every one of the thousand steps meets a gradient.
      {"noise, wild steps in place", 0, 1, {0.05, 10, 10, 50}, {}},
      {"noise, wild steps in place, limits of sound training", 0, 1, {0.05, 10, 10, 50}, {0.05, 20, false}},
      {"saturated frames, wild steps in place", 1, 1, {0.05, 10, 10, 50}, {0.05, 20, true}},
      {"noise, steps of 1e6 in place", 0, 1, {0.05, 1e6, 1e6, 1e6}, {}},
      {"noise, steps hundreds of times too long", 0, 1, {30, 10, 10, 50}, {}},
      {"noise, steps of 1e6", 0, 1, {1e6, 1e6, 1e6, 1e6}, {}},
      {"saturated frames, steps of 1e12", 1, 1, {1e12, 1e12, 1e12, 1e12}, {}},
  };
  for (const BadStart& start : starts)
  {
    Random random(61);
    engine_->SetField(BadField(random, 200));
    const GaussianField before = engine_->GetField();
    engine_->SetFrames(BadFrames(random, start.low, start.high));
    std::size_t nonFinite = 0;
    for (int step = 0; step < 1000; ++step)
    {
      const int first = step % 4;
      const double loss = engine_->TrainStep({first, (first + 1) % 4}, Loss::Parse(step / 4 % 2 ? "l1" : "l2"),
                                             start.rates, start.limits);
      nonFinite += !std::isfinite(loss) + CountNonFinite(engine_->GetField());
      ASSERT_EQ(nonFinite, 0u) << start.name << ", step " << step;
    }
    const GaussianField field = engine_->GetField();
    EXPECT_NO_THROW(field.Validate()) << start.name;
    const double slack = 1 + 1e-5;  // limits are on logarithms, in float
    for (std::size_t i = 0; i < field.Size(); ++i)
    {
      if (field.scales[i] == before.scales[i])
      {
        continue;  // no frame ever saw it: it rests, wherever it began
      }
      ASSERT_GE(field.scales[i].minCoeff() * slack, start.limits.minimumScale) << start.name;
      ASSERT_LE(field.scales[i].maxCoeff(), start.limits.maximumScale * slack) << start.name;
      ASSERT_NEAR(field.rotations[i].norm(), 1, 1e-5) << start.name;
    }
    // And what it has become still renders.
    const RenderedPlane image = RenderWhole(*engine_, BadFrames(random, 0, 0)->Plane(0), ViewOutput::Intensity);
    nonFinite += CountNonFinite(image.values) + CountNonFinite(image.coverage);
    ConcludeFinite("training", std::string("1000 steps: ") + start.name + ": guarded updates", GetParam(),
                   static_cast<double>(engine_->GuardedUpdates()), nonFinite);
  }
}

TEST_P(Training, AGradientBeyondAnyUseIsGuardedAndCounted)
{
  // Two Gaussians of a ten-thousandth of a pixel that cancel, r = +-1e12, half a deviation from a lit pixel
  // of 1e-5 mm: S = 0, where the loss pulls with its full slope, and dL/dmu is about
  // r / (s pixels) = 1e12 / 1e-9 / 4 = 2e20 a mm. Its square is beyond the largest float, 3e38, and would leave Adam with
  // inf - inf a step later.
  Random random(62);
  const SlicePlane plane = RandomPlane(random, {0, 0, 0}, 1e-5, 2, 2);
  const auto sweep = RandomSweep(random, {plane}, 1, 1);
  GaussianField field = RandomField(random, 2, 1, 0.5, 1, 0.0);
  field.transfer.gamma = 1;
  for (int i = 0; i < 2; ++i)
  {
    field.scales[i].setConstant(1e-9);
    field.rotations[i] = {1, 0, 0, 0};
    field.reflectivities[i] = i ? -1e12 : 1e12;
    PlaceInView(field, i, plane, 1, 1, {0.5, 0.5}, 0);
  }
  engine_->SetField(field);
  engine_->SetFrames(sweep);
  for (int step = 0; step < 5; ++step)
  {
    ASSERT_TRUE(std::isfinite(engine_->TrainStep({0}, Loss::Parse("l2"), {1e-11, 0.01, 0.01, 1}, {1e-12, 1e6, false})));
    ASSERT_EQ(CountNonFinite(engine_->GetField()), 0u) << "step " << step;
  }
  ConcludeFinite("training", "gradients of 1e20: guarded updates", GetParam(),
                 static_cast<double>(engine_->GuardedUpdates()), 0);
  EXPECT_GT(engine_->GuardedUpdates(), 0u);
}

TEST_P(Training, SoundTrainingIsNeverGuarded)
{
  // A field moved off the one that made the frames finds back to them; no update on the way meets the guard,
  // so the guard is no part of what such training finds.
  const auto sweep = RenderedSweep();
  Random random(63);
  GaussianField field = RandomField(random, 400, 8, 0.6, 1.5, 0.3);
  field.means.push_back({0, 0, 0});
  field.scales.push_back({10, 10, 10});
  field.rotations.push_back({1, 0, 0, 0});
  field.reflectivities.push_back(0.5);
  engine_->SetField(field);
  engine_->SetFrames(sweep);
  double first = 0, last = 0;
  for (int step = 0; step < 300; ++step)
  {
    std::vector<int> batch;
    for (int k = 0; k < 8; ++k)
    {
      batch.push_back((step * 5 + k * 3) % 24);
    }
    const double loss = engine_->TrainStep(batch, Loss(), {0.05, 0.02, 0.02, 0.02}, {0.1, 20, false});
    (step < 10 ? first : last) += step < 10 || step >= 290 ? loss : 0;
  }
  Conclude("training", "sound: loss after 300 steps over before", GetParam(), last / first, last / first / 0.5,
           CountNonFinite(engine_->GetField()));
  ConcludeFinite("training", "sound: guarded updates", GetParam(), static_cast<double>(engine_->GuardedUpdates()), 0);
  EXPECT_EQ(engine_->GuardedUpdates(), 0u);
}

TEST_P(Training, AGaussianThatNoFrameSeesStaysWhereItIs)
{
  Random random(64);
  GaussianField field = RandomField(random, 50, 3, 0.2, 1, 0.3);
  field.means[7] = {4000, 0, 0};
  const SlicePlane plane = RandomPlane(random, {0, 0, 0}, 0.3, 32, 24);
  engine_->SetField(field);
  const GaussianField before = engine_->GetField();
  engine_->SetFrames(RandomSweep(random, {plane}, 0.2, 0.8));
  for (int step = 0; step < 5; ++step)
  {
    engine_->TrainStep({0}, Loss(), {0.1, 0.05, 0.05, 0.1}, {});
  }
  const GaussianField after = engine_->GetField();
  EXPECT_EQ(after.means[7], before.means[7]);
  EXPECT_EQ(after.scales[7], before.scales[7]);
  EXPECT_EQ(after.rotations[7], before.rotations[7]);
  EXPECT_EQ(after.reflectivities[7], before.reflectivities[7]);
  std::size_t moved = 0;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    moved += after.means[i] != before.means[i];
  }
  EXPECT_GT(moved, 5u);  // those the plane crosses
}

INSTANTIATE_TEST_SUITE_P(Engines, Training, ::testing::ValuesIn(FastEngines()), EngineTestName);

}  // namespace
