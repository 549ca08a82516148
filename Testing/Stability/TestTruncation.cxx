// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The guarantee of Accuracy: all that is dropped at any one pixel changes I by at most `tolerance`. Measured
// as |I - I_exact| at every pixel of many fields against the untruncated reference engine, beside what the
// arithmetic may add:
//
//   float    gamma e A(p), A(p) = sum_i |r_i| w_i(p), e = the relative error of a splat inside its footprint
//   plus
//            N 2^-24 for the sum. For |U (p - m)| <= k and positions off by d standard deviations that error
//            is exp(k d) - 1 < 2 k d, with k <= 10 (exp(-50) is dropped at any tolerance here) and d from
//            Displacement, beside FlatError for the recurrence. Fields are built so that this stays a
//            fraction of the tolerance: intensities in proportion to it, shapes that are no needles.
//   double   1e-9, and nothing else.
//   both     half a unit in the last place of I in either image of floats.

#include <algorithm>
#include <limits>

#include "Stability/HardCases.h"

namespace
{

using namespace bigus;
using namespace bigus::test;

struct Outcome
{
  double error = 0;   ///< largest |dI|
  double excess = 0;  ///< largest |dI| over what is allowed
  std::size_t nonFinite = 0;
};

class Truncation : public EngineTest
{
protected:
  std::unique_ptr<Engine> reference_ = Engine::Create("reference");
  const double unit_ = UnitRoundoff(GetParam());

  /// The relative error of a splat inside its footprint, at worst over the field, and of the sum.
  double RoundingOf(const GaussianField& field, const SlicePlane& plane) const
  {
    double largest = 0;
    for (std::size_t i = 0; i < field.Size(); ++i)
    {
      largest = std::max(largest, Displacement(field, i, plane, unit_));
    }
    return FlatError(unit_) + 2 * 10 * largest + static_cast<double>(field.Size()) * unit_;
  }

  void Check(const GaussianField& field, const SlicePlane& plane, const Accuracy& accuracy, Outcome& outcome)
  {
    reference_->SetField(field);
    const std::vector<float> exact = RenderWhole(*reference_, plane, ViewOutput::Intensity).values;
    GaussianField magnitudes = field;
    for (double& r : magnitudes.reflectivities)
    {
      r = std::abs(r);
    }
    reference_->SetField(magnitudes);
    const std::vector<float> magnitude = RenderWhole(*reference_, plane, ViewOutput::Scattering).values;
    engine_->SetAccuracy(accuracy);
    engine_->SetField(field);
    const RenderedPlane image = RenderWhole(*engine_, plane, ViewOutput::Intensity);
    outcome.nonFinite += CountNonFinite(image.values) + CountNonFinite(image.coverage);
    const bool isFloat = unit_ > 1e-10;
    const double relative = isFloat ? RoundingOf(field, plane) : 0;
    for (std::size_t p = 0; p < exact.size(); ++p)
    {
      const double error = std::abs(static_cast<double>(image.values[p]) - exact[p]);
      const double arithmetic = isFloat ? field.transfer.gamma * relative * magnitude[p] : 1e-9;
      const double allowed = accuracy.tolerance + arithmetic + 2 * kFloatRounding * exact[p];
      outcome.error = std::max(outcome.error, error);
      outcome.excess = std::max(outcome.excess, std::isfinite(error) ? error / allowed : HUGE_VAL);
    }
  }

  void Conclude(const char* name, double tolerance, const Outcome& outcome)
  {
    char text[64];
    std::snprintf(text, sizeof(text), "%s at %g, dI", name, tolerance);
    test::Conclude("truncation", text, GetParam(), outcome.error, outcome.excess, outcome.nonFinite);
  }
};

constexpr double kTolerances[] = {1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6};

SlicePlane SmallPlane(Random& random)
{
  return RandomPlane(random, random.Vector(1), 0.3, 40, 32);
}

/// As wide, of fewer pixels: for fields that the reference engine takes long over.
SlicePlane CoarsePlane(Random& random)
{
  return RandomPlane(random, random.Vector(0.5), 0.5, 15, 13);
}

/// Reflectivities in proportion to the tolerance: each splat a hundred times it at most, or a share of that.
void InProportion(GaussianField& field, double tolerance)
{
  field.transfer.gamma = 1;
  for (double& r : field.reflectivities)
  {
    r *= std::min(1.0, 100 * tolerance);
  }
}

TEST_P(Truncation, RandomFields)
{
  for (const double tolerance : kTolerances)
  {
    Random random(31);
    Outcome outcome;
    for (int k = 0; k < 24; ++k)
    {
      // From a few Gaussians to many that overlap, all beams and gammas.
      const auto count = static_cast<std::size_t>(random.LogUniform(1, 800));
      GaussianField field = RandomField(random, count, 6, 0.4, 2, k % 4 ? random.LogUniform(0.01, 2) : 0.0);
      InProportion(field, tolerance);
      const double gamma = random.LogUniform(0.05, 5);
      field.transfer.gamma = gamma;
      for (double& r : field.reflectivities)
      {
        r /= gamma;
      }
      Accuracy accuracy{tolerance};
      accuracy.direct = k % 3 == 0;
      Check(field, SmallPlane(random), accuracy, outcome);
    }
    Conclude("random fields", tolerance, outcome);
  }
}

TEST_P(Truncation, FieldsAsBrightAsImagesAre)
{
  for (const double tolerance : kTolerances)
  {
    Random random(32);
    Outcome outcome;
    for (int k = 0; k < 8; ++k)
    {
      GaussianField field = RandomField(random, 400, 6, 0.4, 2, 0.3);
      Check(field, SmallPlane(random), {tolerance}, outcome);
    }
    Conclude("bright fields", tolerance, outcome);
  }
}

TEST_P(Truncation, ThousandsOfFaintGaussiansOnOneSpot)
{
  // Each alone is below the tolerance, all together thousands of times above it: whoever judges them one by
  // one drops the whole image. From far below an equal share of the tolerance, to just below it, to just
  // above.
  constexpr std::size_t kCount = 4000;
  for (const double tolerance : kTolerances)
  {
    Random random(33);
    Outcome outcome;
    for (const double share : {0.01, 0.4, 0.5, 0.9, 0.999, 1.001, 2.0, 30.0, 1000.0, 0.9 * kCount})
    {
      GaussianField field = RandomField(random, kCount, 0.5, 0.6, 2, 0.3);
      field.transfer.gamma = 1;
      for (double& r : field.reflectivities)
      {
        r = share * tolerance / kCount;
      }
      Check(field, CoarsePlane(random), {tolerance}, outcome);
      // The same among a hundred bright ones, which reach much further.
      for (std::size_t i = 0; i < 100; ++i)
      {
        field.reflectivities[i] = 2 * tolerance * random.Uniform();
        field.means[i] = random.Vector(5);
      }
      Check(field, CoarsePlane(random), {tolerance}, outcome);
    }
    Conclude("4000 faint ones", tolerance, outcome);
  }
}

TEST_P(Truncation, CrowdsInSomePlacesOfALargerImage)
{
  // Faint crowds here and there, long needles across all of them, wide ones over everything: whoever shares
  // the tolerance by place must count all that reaches a place.
  for (const double tolerance : {1e-1, 1e-3, 1e-5})
  {
    Random random(37);
    Outcome outcome;
    for (const double share : {0.0008, 0.003, 0.01, 0.1})
    {
      const SlicePlane plane = RandomPlane(random, {0, 0, 0}, 0.3, 110, 75);
      GaussianField field = RandomField(random, 600, 1, 0.5, 1, 0.3);
      field.transfer.gamma = 1;
      for (std::size_t i = 0; i < field.Size(); ++i)
      {
        field.reflectivities[i] = share * tolerance * random.Uniform(0.5, 2);
        double column = 32.0 * static_cast<double>(1 + i % 4), row = 32.0 * static_cast<double>(1 + i / 4 % 3);
        if (i % 10 == 0)
        {
          field.scales[i] = {random.Uniform(5, 20), 0.7, 0.7};
        }
        else if (i % 10 == 1)
        {
          field.scales[i] = {random.Uniform(5, 20), random.Uniform(5, 20), 3};
          column = random.Uniform(-20, 130);
          row = random.Uniform(-20, 95);
        }
        PlaceInView(field, i, plane, column + random.Uniform(-4, 4), row + random.Uniform(-4, 4), {0, 0},
                    random.Uniform(-2, 2));
      }
      Check(field, plane, {tolerance}, outcome);
    }
    Conclude("crowds", tolerance, outcome);
  }
}

TEST_P(Truncation, EveryFrameOfATrainingBatch)
{
  // On black frames the L1 loss is the mean of I, so what is dropped changes it by at most the tolerance. The
  // crowd lies where only the last frame of the batch sees it.
  for (const double tolerance : {1e-2, 1e-4})
  {
    Random random(38);
    std::vector<SlicePlane> planes(3, FlatPlane(24, 20, 0.3, 0.3));
    for (int f = 0; f < 3; ++f)
    {
      planes[f].origin[2] = 20 * f;
    }
    GaussianField field = RandomField(random, 2400, 1, 0.6, 1.5, 0.3);
    field.transfer.gamma = 1;
    for (std::size_t i = 0; i < field.Size(); ++i)
    {
      field.means[i][2] += i < 100 ? 0 : (i < 200 ? 20 : 40);
      field.reflectivities[i] = 0.4 * tolerance;
    }
    const auto sweep = RandomSweep(random, planes, 0, 0);
    double losses[2];
    Engine* engines[2] = {reference_.get(), engine_.get()};
    for (int e = 0; e < 2; ++e)
    {
      engines[e]->SetAccuracy({tolerance});
      engines[e]->SetField(field);
      engines[e]->SetFrames(sweep);
      losses[e] = engines[e]->Backpropagate({0, 1, 2}, Loss());
    }
    Outcome outcome;
    outcome.error = std::abs(losses[1] - losses[0]);
    // Rounding as in Check; S, and so its mean, is below 2400 * 0.4 * tolerance.
    const double arithmetic =
        unit_ > 1e-10 ? RoundingOf(field, planes[2]) * std::min(1.0, 2400 * 0.4 * tolerance) : 1e-9;
    outcome.excess = outcome.error / (tolerance + arithmetic);
    Conclude("batch of frames", tolerance, outcome);
  }
}

TEST_P(Truncation, CancellingPairs)
{
  // Pairs of opposite sign, exact and nearly so: what is left is small, what is dropped is a share of |r|.
  for (const double tolerance : kTolerances)
  {
    Random random(34);
    Outcome outcome;
    for (int k = 0; k < 12; ++k)
    {
      GaussianField field = RandomField(random, 300, 4, 0.5, 2, k % 3 ? 0.3 : 0.0);
      InProportion(field, tolerance);
      for (std::size_t i = 1; i < field.Size(); i += 2)
      {
        field.means[i] = field.means[i - 1] + random.Vector(k % 2 ? 0.2 : 0.0);
        field.scales[i] = field.scales[i - 1] * (k % 2 ? random.Uniform(0.9, 1.1) : 1.0);
        field.rotations[i] = field.rotations[i - 1];
        field.reflectivities[i] = -field.reflectivities[i - 1];
      }
      // On a ground that keeps S positive, where I has a slope and errors of either sign show.
      field.means[0].setZero();
      field.scales[0].setConstant(8);
      field.reflectivities[0] = std::min(1.0, 300 * tolerance);
      Check(field, SmallPlane(random), {tolerance}, outcome);
    }
    Conclude("cancelling pairs", tolerance, outcome);
  }
}

TEST_P(Truncation, OneSplatAloneWhenEachIsBoundedAlone)
{
  for (const double tolerance : kTolerances)
  {
    Random random(35);
    Outcome outcome;
    for (int k = 0; k < 60; ++k)
    {
      GaussianField field = RandomField(random, 1, 1, 0.4, 4, k % 3 ? 0.3 : 0.0);
      field.reflectivities[0] = random.LogUniform(0.5, 1000) * tolerance;
      field.transfer.gamma = 1;
      const SlicePlane plane = SmallPlane(random);
      PlaceInView(field, 0, plane, random.Uniform(0, 39), random.Uniform(0, 31), {0, 0}, random.Uniform(-3, 3));
      Check(field, plane, {tolerance, true}, outcome);
    }
    Conclude("one splat, bounded alone", tolerance, outcome);
  }
}

TEST_P(Truncation, NothingIsDroppedAtToleranceZero)
{
  Random random(36);
  Outcome outcome;
  for (int k = 0; k < 24; ++k)
  {
    GaussianField field = RandomField(random, 200, 6, 0.4, 2, k % 3 ? 0.3 : 0.0);
    InProportion(field, random.LogUniform(1e-8, 1e-2));
    Check(field, SmallPlane(random), {0.0, k % 2 == 0}, outcome);
  }
  Conclude("random fields", 0, outcome);
}

INSTANTIATE_TEST_SUITE_P(Engines, Truncation, ::testing::ValuesIn(FastEngines()), EngineTestName);

}  // namespace
