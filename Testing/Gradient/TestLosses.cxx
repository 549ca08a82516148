// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Every term of the loss through the whole chain: the reference engine against central differences, the CPU
// engines against the reference.

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstring>
#include <iostream>

#include "Core/Engine/Engine.h"
#include "Core/Engine/Packing.h"
#include "Core/Model/Error.h"
#include "Core/Model/TransferFunction.h"
#include "Support/CentralDifferences.h"
#include "Support/Engines.h"
#include "Support/Fields.h"
#include "Support/Sweeps.h"

namespace
{

using bigus::Engine;
using bigus::GaussianField;
using bigus::Loss;
using bigus::SlicePlane;
using bigus::Sweep;
using bigus::test::CompareGradient;
using bigus::test::Flat;
using bigus::test::Problem;
using bigus::test::Random;
using bigus::test::RelativeError;

const char* const kTerms[] = {"l1", "l2", "dssim", "ffl", "contrast", "0.5*l1+0.3*l2+dssim+0.7*ffl+20*contrast"};

/// Two corners and a pixel inside that the probe never lights.
std::shared_ptr<const std::vector<std::uint8_t>> Mask(int width, int height)
{
  auto mask = std::make_shared<std::vector<std::uint8_t>>(static_cast<std::size_t>(width) * height, 1);
  for (int y = 0; y < height; ++y)
  {
    for (int x = 0; x < width; ++x)
    {
      (*mask)[y * width + x] = x + y > 1 && width - 1 - x + y > height / 8 && !(x == width - 1 && y == height / 2);
    }
  }
  return mask;
}

/// I of a plane in double, by the formulas that TestSplat.cxx checks.
std::vector<double> Intensities(const GaussianField& field, const SlicePlane& plane)
{
  std::vector<double> scattering(plane.NumberOfPixels(), 0.0);
  const auto view = bigus::MakeView<double>(plane, field.beam, Eigen::Vector3d::Zero());
  for (const auto& gaussian : bigus::PackField<double>(field, Eigen::Vector3d::Zero()))
  {
    const auto splat = bigus::Project(gaussian, view).splat;
    for (std::size_t p = 0; p < scattering.size(); ++p)
    {
      const double u = static_cast<double>(p % plane.width) - splat.mu;
      const double v = static_cast<double>(p / plane.width) - splat.mv;
      const double eta1 = splat.u11 * u + splat.u12 * v, eta2 = splat.u22 * v;
      scattering[p] += gaussian.reflectivity * splat.amplitude * std::exp(-0.5 * (eta1 * eta1 + eta2 * eta2));
    }
  }
  for (double& s : scattering)
  {
    s = field.transfer.Intensity(s);
  }
  return scattering;
}

/// Six Gaussians of which one is broad and bright, so that S > 0 everywhere; truth that differs from what
/// they show by 0.05 to 0.2 in every pixel, so that the loss is smooth. Frames of 15 x 13 pixels.
struct SmallProblem
{
  GaussianField field;
  std::shared_ptr<Sweep> sweep;

  SmallProblem()
  {
    Random random(23);
    field = bigus::test::RandomField(random, 6, 2.0, 0.5, 1.6, 0.4);
    field.means[5] = {0.3, -0.2, 0.1};
    field.scales[5] = {9, 7, 8};
    field.reflectivities[5] = 3.0;
    std::vector<SlicePlane> planes;
    for (int i = 0; i < 3; ++i)
    {
      planes.push_back(bigus::test::RandomPlane(random, random.Vector(0.5), 0.4, 15, 13));
    }
    sweep = bigus::test::RandomSweep(random, planes, 0, 1);
    auto* pixels = static_cast<float*>(const_cast<void*>(sweep->pixels.get()));
    for (int f = 0; f < 3; ++f)
    {
      for (double intensity : Intensities(field, sweep->Plane(f)))
      {
        const double offset = random.Uniform(0.05, 0.2);
        *pixels++ = static_cast<float>(intensity + (random.Uniform() < 0.5 || intensity > 0.8 ? -offset : offset));
      }
    }
  }
};

/// The focal frequency loss of the three frames; its weights, which are not differentiated, are those of the
/// first call.
class FrozenFocalFrequency
{
public:
  double operator()(const SmallProblem& problem, const GaussianField& field)
  {
    const Sweep& sweep = *problem.sweep;
    const int w = sweep.width, h = sweep.height;
    double loss = 0;
    for (int f = 0; f < 3; ++f)
    {
      std::vector<double> difference = Intensities(field, sweep.Plane(f));
      std::vector<float> truth(difference.size());
      sweep.CopyFrame(f, truth.data());
      int counted = 0;
      for (std::size_t p = 0; p < truth.size(); ++p)
      {
        difference[p] = sweep.IsLit(p) ? difference[p] - truth[p] : 0;
        counted += sweep.IsLit(p);
      }
      std::vector<double> squares;
      for (int k = 0; k < w * h; ++k)
      {
        std::complex<double> sum = 0;
        for (int p = 0; p < w * h; ++p)
        {
          sum += difference[p] * turns_[(k % w) * (p % w) % w][0] * turns_[(k / w) * (p / w) % h][1];
        }
        squares.push_back(std::norm(sum) / (w * h));
      }
      if (weights_[f].empty())
      {
        const double most = *std::max_element(squares.begin(), squares.end());
        for (double square : squares)
        {
          weights_[f].push_back(std::sqrt(square / most));
        }
      }
      for (std::size_t k = 0; k < squares.size(); ++k)
      {
        loss += weights_[f][k] * squares[k] / (3.0 * counted);
      }
    }
    return loss;
  }

  explicit FrozenFocalFrequency(const Sweep& sweep) : turns_(std::max(sweep.width, sweep.height))
  {
    for (std::size_t t = 0; t < turns_.size(); ++t)
    {
      turns_[t] = {std::polar(1.0, -2 * bigus::kPi * static_cast<double>(t) / sweep.width),
                   std::polar(1.0, -2 * bigus::kPi * static_cast<double>(t) / sweep.height)};
    }
  }

private:
  std::vector<std::array<std::complex<double>, 2>> turns_;
  std::vector<double> weights_[3];
};

class LossGradientTest : public testing::TestWithParam<std::tuple<const char*, bool>>
{
};

TEST_P(LossGradientTest, EqualsCentralDifferences)
{
  const Loss loss = Loss::Parse(std::get<0>(GetParam()));
  const SmallProblem problem;
  if (std::get<1>(GetParam()))
  {
    problem.sweep->mask = Mask(15, 13);
  }
  FrozenFocalFrequency focalFrequency(*problem.sweep);
  focalFrequency(problem, problem.field);
  Loss rest = loss;
  rest.ffl = 0;
  const bool nothingElse = loss.l1 + loss.l2 + loss.dssim + loss.contrast == 0;
  const auto engine = Engine::Create("reference");
  engine->SetFrames(problem.sweep);
  engine->SetField(problem.field);
  engine->Backpropagate({0, 1, 2}, loss);
  CompareGradient(problem.field, engine->GetGradient(),
                  [&](const GaussianField& field)
                  {
                    double value = loss.ffl > 0 ? loss.ffl * focalFrequency(problem, field) : 0;
                    if (!nothingElse)
                    {
                      engine->SetField(field);
                      value += engine->Backpropagate({0, 1, 2}, rest);
                    }
                    return value;
                  });
}

INSTANTIATE_TEST_SUITE_P(Terms, LossGradientTest, testing::Combine(testing::ValuesIn(kTerms), testing::Bool()));

/// Frames of 61 x 47 pixels, some of which are masked.
Problem LargeProblem()
{
  Problem problem = bigus::test::RandomProblem(12, 400, 7, 3, 0.25, 61, 47);
  problem.sweep->mask = Mask(61, 47);
  return problem;
}

class LossOfEngines : public bigus::test::EngineTest
{
};

TEST_P(LossOfEngines, EqualsTheReference)
{
  Problem problem = LargeProblem();
  const auto mask = problem.sweep->mask;
  const auto reference = Engine::Create("reference");
  const double bound = bigus::test::IsDouble(GetParam()) ? 1e-6 : 3e-5;  // what the tolerance drops; rounding
  for (const char* text : kTerms)
  {
    for (const bool masked : {false, true})
    {
      problem.sweep->mask = masked ? mask : nullptr;
      std::vector<double> gradients[2];
      double losses[2];
      Engine* const engines[2] = {reference.get(), engine_.get()};
      for (int e = 0; e < 2; ++e)
      {
        engines[e]->SetAccuracy({1e-9, true});
        engines[e]->SetFrames(problem.sweep);
        engines[e]->SetField(problem.field);
        losses[e] = engines[e]->Backpropagate({0, 2}, Loss::Parse(text));
        gradients[e] = Flat(engines[e]->GetGradient());
      }
      EXPECT_NEAR(losses[1], losses[0], bound * losses[0]) << text;
      const double error = RelativeError(gradients[0], gradients[1]);
      EXPECT_LE(error, bound) << text;
      if (masked)
      {
        std::cout << text << ": relative error of the gradient " << error << '\n';
      }
    }
  }
}

TEST(Losses, PixelsNeverLitHaveNoPartInAnyTerm)
{
  Problem problem = LargeProblem();
  for (const std::string& name : Engine::Names())
  {
    double losses[2];
    std::vector<double> gradients[2];
    for (int other = 0; other < 2; ++other)
    {
      auto* pixels = static_cast<float*>(const_cast<void*>(problem.sweep->pixels.get()));
      for (std::size_t p = 0; p < 3 * problem.sweep->PixelsPerFrame(); ++p)
      {
        if (!problem.sweep->IsLit(p % problem.sweep->PixelsPerFrame()))
        {
          pixels[p] = other;
        }
      }
      const auto engine = Engine::Create(name);
      engine->SetFrames(problem.sweep);
      engine->SetField(problem.field);
      losses[other] = engine->Backpropagate({0, 1, 2}, Loss::Parse(kTerms[5]));
      gradients[other] = Flat(engine->GetGradient());
    }
    EXPECT_EQ(losses[0], losses[1]) << name;
    EXPECT_EQ(gradients[0], gradients[1]) << name;
  }
}

TEST(Losses, FramesWithoutAWindowAreRefusedBySizeAndTheFieldIsLeftAlone)
{
  Random random(4);
  const GaussianField field = bigus::test::RandomField(random, 20, 2.0, 0.5, 1.0, 0.3);
  const auto sweep = bigus::test::RandomSweep(random, {bigus::test::RandomPlane(random, {0, 0, 0}, 0.4, 14, 10)}, 0, 1);
  for (const std::string& name : Engine::Names())
  {
    const auto engine = Engine::Create(name);
    engine->SetFrames(sweep);
    engine->SetField(field);
    for (const char* text : {"dssim", "l1+contrast"})
    {
      try
      {
        engine->TrainStep({0}, Loss::Parse(text), {1, 1, 1, 1}, {});
        ADD_FAILURE() << name << ", " << text;
      }
      catch (const bigus::Error& error)
      {
        EXPECT_NE(std::string(error.what()).find("14 x 10"), std::string::npos) << error.what();
      }
    }
    EXPECT_NEAR(engine->GetField().reflectivities[3], field.reflectivities[3], 1e-6) << name;
    EXPECT_TRUE(std::isfinite(engine->TrainStep({0}, Loss::Parse("l1+ffl"), {0.1, 0.1, 0.1, 0.1}, {})));
    Loss bad;
    bad.ffl = -1;
    EXPECT_THROW(engine->Backpropagate({0}, bad), bigus::Error);
    bad = {0, 0, 0, 0, 0};
    EXPECT_THROW(engine->Backpropagate({0}, bad), bigus::Error);
  }
}

TEST_P(LossOfEngines, BlackConstantAndWhiteFramesTrainSoundly)
{
  const Problem problem = LargeProblem();
  for (const float grey : {0.0f, 0.5f, 1.0f})
  {
    auto* pixels = static_cast<float*>(const_cast<void*>(problem.sweep->pixels.get()));
    std::fill_n(pixels, 3 * problem.sweep->PixelsPerFrame(), grey);
    for (const bool dark : {false, true})
    {
      GaussianField field = problem.field;
      for (double& r : field.reflectivities)
      {
        r = dark ? 0.0 : r;  // every image is constant
      }
      engine_->SetFrames(problem.sweep);
      engine_->SetField(field);
      for (int step = 0; step < 10; ++step)
      {
        EXPECT_TRUE(std::isfinite(
            engine_->TrainStep({step % 3, (step + 1) % 3}, Loss::Parse(kTerms[5]), {0.05, 0.02, 0.02, 0.05}, {})));
      }
      for (double r : engine_->GetField().reflectivities)
      {
        EXPECT_TRUE(std::isfinite(r));
      }
      EXPECT_EQ(engine_->GuardedUpdates(), 0u);
    }
  }
}

TEST_P(LossOfEngines, TrainingMakesEveryTermSmaller)
{
  const Problem problem = LargeProblem();
  auto* pixels = static_cast<float*>(const_cast<void*>(problem.sweep->pixels.get()));
  engine_->SetField(problem.field);
  for (int f = 0; f < 3; ++f)  // frames that a field can show
  {
    engine_->Render(problem.sweep->Plane(f), bigus::ViewOutput::Intensity,
                    pixels + f * problem.sweep->PixelsPerFrame());
  }
  Random random(6);
  GaussianField start = problem.field;
  for (std::size_t i = 0; i < start.Size(); ++i)
  {
    start.means[i] += random.Vector(0.15);
    start.reflectivities[i] += random.Uniform(-0.3, 0.3);
  }
  for (const char* text : kTerms)
  {
    engine_->SetFrames(problem.sweep);
    engine_->SetField(start);
    const auto step = [&](double rate) {
      return engine_->TrainStep({0, 1, 2}, Loss::Parse(text), {rate, rate, rate, rate}, {0.1, 5, false});
    };
    const double before = step(0.01);
    for (int i = 1; i < 60; ++i)
    {
      step(0.01);
    }
    const double after = step(0.0);
    EXPECT_LT(after, 0.5 * before) << text;
    EXPECT_EQ(engine_->GuardedUpdates(), 0u);
    std::cout << text << ": " << before << " to " << after << " in 60 steps\n";
  }
}

TEST_P(LossOfEngines, BitsDoNotDependOnTheNumberOfThreads)
{
  const Problem problem = LargeProblem();
  std::vector<double> one;
  for (const int threads : {1, 2, 5})
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const auto engine = Engine::Create(GetParam());
    engine->SetFrames(problem.sweep);
    engine->SetField(problem.field);
    std::vector<double> all;
    for (int step = 0; step < 3; ++step)
    {
      all.push_back(engine->TrainStep({step, (step + 1) % 3}, Loss::Parse(kTerms[5]), {0.1, 0.05, 0.05, 0.02}, {}));
    }
    all.push_back(engine->Backpropagate({0, 1, 2}, Loss::Parse(kTerms[5])));
    const std::vector<double> gradient = Flat(engine->GetGradient());
    all.insert(all.end(), gradient.begin(), gradient.end());
    if (threads == 1)
    {
      one = all;
    }
    ASSERT_EQ(one.size(), all.size());
    EXPECT_EQ(0, std::memcmp(one.data(), all.data(), one.size() * sizeof(double))) << threads << " threads";
  }
}

INSTANTIATE_TEST_SUITE_P(Engines, LossOfEngines, testing::ValuesIn(bigus::test::FastEngines()),
                         bigus::test::EngineTestName);

}  // namespace
