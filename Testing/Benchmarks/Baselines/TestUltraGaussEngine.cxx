// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <vector>

#include "Core/Model/Error.h"
#include "Support/CentralDifferences.h"
#include "Support/Sweeps.h"
#include "UltraGaussEngine.h"

namespace
{

using bigus::Engine;
using bigus::GaussianField;
using bigus::Loss;
using bigus::SlicePlane;
using bigus::Sweep;
using bigus::test::Random;

/// Gaussians of both signs, and three frames of 31 x 27 pixels of which a corner is masked.
struct Problem
{
  GaussianField field;
  std::shared_ptr<Sweep> sweep;

  explicit Problem(std::size_t gaussians)
  {
    Random random(12);
    field = bigus::test::RandomField(random, gaussians, 4.0, 0.3, 2.0, 0.4);
    field.means[0] = {0.3, -0.2, 0.1};  // one that is seen everywhere
    field.scales[0] = {9, 7, 8};
    std::vector<SlicePlane> planes;
    for (int i = 0; i < 3; ++i)
    {
      planes.push_back(bigus::test::RandomPlane(random, random.Vector(0.5), 0.25, 31, 27));
    }
    sweep = bigus::test::RandomSweep(random, planes, 0.0, 1.0);
    auto mask = std::make_shared<std::vector<std::uint8_t>>(sweep->PixelsPerFrame(), 1);
    for (int p = 0; p < 9; ++p)
    {
      (*mask)[31 * (p / 3) + p % 3] = 0;
    }
    sweep->mask = mask;
  }
};

TEST(UltraGaussEngine, RendersTheWeightedMeanOfReflectivities)
{
  const Problem problem(60);
  const SlicePlane plane = problem.sweep->Plane(1);
  const std::size_t pixels = plane.NumberOfPixels();
  const auto reference = Engine::Create("reference"), engine = bigus::CreateUltraGaussEngine();
  reference->SetField(problem.field);
  engine->SetAccuracy({1e-9, true});
  engine->SetField(problem.field);
  std::vector<float> s(pixels), w(pixels), scattering(pixels), coverage(pixels), image(pixels), part(5 * 4);
  reference->Render(plane, bigus::ViewOutput::Scattering, s.data(), w.data());
  engine->Render(plane, bigus::ViewOutput::Scattering, scattering.data(), coverage.data());
  engine->Render(plane, bigus::ViewOutput::Intensity, image.data());
  for (std::size_t p = 0; p < pixels; ++p)
  {
    EXPECT_NEAR(scattering[p], s[p], 1e-6);
    EXPECT_NEAR(coverage[p], w[p], 1e-6);
    EXPECT_NEAR(image[p], s[p] / (1e-3 + w[p]), 1e-5);
  }
  engine->Render(plane, {7, 11, 5, 4}, bigus::ViewOutput::Intensity, part.data(), nullptr);
  for (int p = 0; p < 20; ++p)
  {
    EXPECT_EQ(part[p], image[(11 + p / 5) * 31 + 7 + p % 5]);
  }

  GaussianField flat = problem.field;  // of one reflectivity
  flat.reflectivities.assign(flat.Size(), 0.6);
  engine->SetField(flat);
  engine->Render(plane, bigus::ViewOutput::Intensity, image.data(), coverage.data());
  for (std::size_t p = 0; p < pixels; ++p)
  {
    EXPECT_NEAR(image[p], 0.6 * coverage[p] / (1e-3 + coverage[p]), 1e-6);
  }
}

TEST(UltraGaussEngine, FootprintsEndWhereTheirWeightFallsBelowTheTolerance)
{
  Problem problem(1);
  problem.field.scales[0] = {0.7, 0.4, 0.5};
  const SlicePlane plane = problem.sweep->Plane(0);
  const auto reference = Engine::Create("reference"), engine = bigus::CreateUltraGaussEngine();
  std::vector<float> all(plane.NumberOfPixels()), cut(all);
  reference->SetField(problem.field);
  reference->Render(plane, bigus::ViewOutput::Scattering, cut.data(), all.data());
  engine->SetAccuracy({0.1, true});
  engine->SetField(problem.field);
  engine->Render(plane, bigus::ViewOutput::Scattering, std::vector<float>(cut).data(), cut.data());
  for (std::size_t p = 0; p < all.size(); ++p)
  {
    EXPECT_NEAR(cut[p], all[p] >= 0.1f ? all[p] : 0.0f, 1e-6);
  }
}

TEST(UltraGaussEngine, GradientEqualsCentralDifferences)
{
  for (const double elevationSigma : {0.0, 0.4})
  {
    for (const char* text : {"l2", "0.3*l2+dssim+20*contrast"})
    {
      Problem problem(6);
      problem.field.beam.elevationSigma = elevationSigma;
      const auto engine = bigus::CreateUltraGaussEngine();
      engine->SetAccuracy({0, true});
      engine->SetFrames(problem.sweep);
      engine->SetField(problem.field);
      engine->Backpropagate({0, 1, 2}, Loss::Parse(text));
      bigus::test::CompareGradient(problem.field, engine->GetGradient(),
                                   [&](const GaussianField& field)
                                   {
                                     engine->SetField(field);
                                     return engine->Backpropagate({0, 1, 2}, Loss::Parse(text));
                                   });
    }
  }
}

TEST(UltraGaussEngine, TrainsAndDoesNotDependOnTheNumberOfThreads)
{
  const Problem problem(200);
  auto* pixels = static_cast<float*>(const_cast<void*>(problem.sweep->pixels.get()));
  for (std::size_t p = 0; p < 3 * problem.sweep->PixelsPerFrame(); ++p)
  {
    pixels[p] = 0.5f + 0.3f * std::sin(0.2f * (p % 31));
  }
  std::vector<double> one;
  for (const int threads : {1, 2, 5})
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const auto engine = bigus::CreateUltraGaussEngine();
    engine->SetFrames(problem.sweep);
    engine->SetField(problem.field);
    engine->ResetScores();
    std::vector<double> losses;
    for (int step = 0; step < 60; ++step)
    {
      losses.push_back(engine->TrainStep({0, 1, 2}, Loss(), {0.01, 0.01, 0.01, 0.02}, {0.1, 5, true}));
    }
    EXPECT_LT(losses.back(), 0.3 * losses.front());
    EXPECT_EQ(engine->GuardedUpdates(), 0u);
    const Engine::Scores scores = engine->GetScores();
    EXPECT_GT(scores.visits[0], 0);
    losses.insert(losses.end(), scores.error.begin(), scores.error.end());
    if (threads == 1)
    {
      one = losses;
    }
    EXPECT_EQ(losses, one) << threads << " threads";
  }
}

}  // namespace
