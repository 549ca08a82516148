// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field that several processes train, each a part of it, against the same field trained by one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "Core/Engine/ViewEngine.h"
#include "Core/Evaluation/Evaluation.h"
#include "Core/Model/Error.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Trainer/Trainer.h"
#include "Support/Fields.h"
#include "Support/Psnr.h"
#include "Support/Sweeps.h"
#include "ThreadExchange.h"

namespace bigus::test
{
namespace
{

const LearningRates kRates{0.02, 0.03, 0.03, 0.05};
constexpr int kProcesses[] = {1, 2, 3, 4};

/// Some steps, in which Gaussians are lost, split and added on the way.
GaussianField Trained(Engine& engine, const Problem& problem, bool isRestructured)
{
  ParameterLimits limits;
  limits.minimumScale = 0.05;
  limits.maximumScale = 5;
  engine.SetAccuracy({1e-4, true});
  engine.SetFrames(problem.sweep);
  engine.SetField(problem.field);
  const auto steps = [&]
  {
    for (int k = 0; k < 10; ++k)
    {
      engine.TrainStep({k % 3, (k + 1) % 3}, Loss::Parse("l2"), kRates, limits);
    }
  };
  steps();
  if (isRestructured)
  {
    GaussianField field = engine.GetField();
    std::vector<int> parents;
    GaussianField next;
    next.beam = field.beam;
    next.transfer = field.transfer;
    const auto add = [&](std::size_t i, int parent)
    {
      next.means.push_back(field.means[i]);
      next.scales.push_back(field.scales[i]);
      next.rotations.push_back(field.rotations[i]);
      next.reflectivities.push_back(field.reflectivities[i] / 2);
      parents.push_back(parent);
    };
    for (std::size_t i = 0; i < field.Size(); ++i)
    {
      if (i % 5 != 0)
      {
        add(i, static_cast<int>(i));
      }
      if (i % 7 == 0)
      {
        add(i, -1);
      }
    }
    engine.SetField(next, &parents);
    steps();
  }
  return engine.GetField();
}

/// The largest difference of a parameter of two fields, in units of its first step.
double LargestDifference(const GaussianField& a, const GaussianField& b)
{
  double largest = a.Size() == b.Size() ? 0 : INFINITY;
  for (std::size_t i = 0; i < std::min(a.Size(), b.Size()); ++i)
  {
    const Eigen::Matrix3d turn = RotationMatrix(a.rotations[i]).transpose() * RotationMatrix(b.rotations[i]);
    const Eigen::Vector3d axis(turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1));
    largest = std::max({largest, (a.means[i] - b.means[i]).norm() / kRates.mean,
                        (a.scales[i].array() / b.scales[i].array()).log().matrix().norm() / kRates.logScale,
                        axis.norm() / 2 / kRates.rotation,
                        std::abs(a.reflectivities[i] - b.reflectivities[i]) / kRates.reflectivity});
  }
  return largest;
}

/// Every process's answer in its place.
template <class Answer>
std::vector<Answer> Answers(int processes, const std::string& engine, const std::function<Answer(Engine&)>& work)
{
  std::vector<Answer> answers(static_cast<std::size_t>(processes));
  const auto errors = InThreads(processes,
                                [&](Exchange& exchange)
                                {
                                  const auto parts = exchange.CreateEngine(engine);
                                  answers[static_cast<std::size_t>(exchange.Rank())] = work(*parts);
                                });
  EXPECT_EQ(errors, std::vector<std::string>(static_cast<std::size_t>(processes)));
  return answers;
}

// Sums of n numbers in another order differ by at most n 2^-53 of the sum of their magnitudes: 1e-13 here. A gradient's
// terms cancel to a hundredth, so its relative error is 1e-11 of the largest. Adam divides by the gradient's own size,
// and one in a million is a ten-thousandth of the largest or smaller. So a step of Adam, which is at most two rates long
// here, differs by 1e-7 of a rate, and twenty steps that build on each other by less than 1e-5.
constexpr double kMostOfARate = 1e-5;

TEST(PartEngine, TrainsWhatOneProcessTrains)
{
  const Problem problem = RandomProblem(5, 700, 6, 3, 0.3, 30, 26);
  for (const bool isRestructured : {false, true})
  {
    const GaussianField truth = Trained(*Engine::Create("cpu-double"), problem, isRestructured);
    for (const int processes : kProcesses)
    {
      const auto fields = Answers<GaussianField>(
          processes, "cpu-double", [&](Engine& engine) { return Trained(engine, problem, isRestructured); });
      EXPECT_LT(LargestDifference(fields[0], truth), kMostOfARate) << processes << " processes";
      EXPECT_GT(LargestDifference(fields[0], problem.field), 1);  // of what has moved at all
      for (const GaussianField& field : fields)
      {
        EXPECT_TRUE(SameField(field, fields[0]));
      }
    }
  }
}

TEST(PartEngine, SameProcessesGiveTheSameBits)
{
  const Problem problem = RandomProblem(6, 700, 6, 3, 0.3, 30, 26);
  for (const int processes : {2, 4})
  {
    const auto train = [&] {
      return Answers<GaussianField>(processes, "cpu",
                                    [&](Engine& engine) { return Trained(engine, problem, true); })[0];
    };
    EXPECT_TRUE(SameField(train(), train()));
  }
}

TEST(PartEngine, MoreProcessesThanGaussians)
{
  const Problem problem = RandomProblem(7, 2, 2, 3, 0.3, 30, 26);
  const GaussianField truth = Trained(*Engine::Create("cpu-double"), problem, false);
  const auto fields =
      Answers<GaussianField>(4, "cpu-double", [&](Engine& engine) { return Trained(engine, problem, false); });
  EXPECT_LT(LargestDifference(fields[3], truth), kMostOfARate);
}

TEST(PartEngine, EveryProcessHasItsShare)
{
  const Problem problem = RandomProblem(8, 3000, 6, 3, 0.3, 30, 26);
  const auto sizes = Answers<std::size_t>(4, "cpu",
                                          [&](Engine& engine)
                                          {
                                            engine.SetField(problem.field);
                                            EXPECT_EQ(engine.FieldSize(), 3000u);
                                            return engine.GetPart().field.Size();
                                          });
  EXPECT_EQ(sizes[0] + sizes[1] + sizes[2] + sizes[3], 3000u);
  EXPECT_LE(*std::max_element(sizes.begin(), sizes.end()) - *std::min_element(sizes.begin(), sizes.end()), 128u);
}

TEST(PartEngine, ShowsWhatOneProcessShows)
{
  const Problem problem = RandomProblem(9, 2000, 6, 3, 0.3, 60, 50);
  const double tolerance = 1e-3;
  const auto show = [&](Engine& engine)
  {
    engine.SetAccuracy({tolerance, false});
    engine.SetField(problem.field);
    std::vector<float> images(2 * problem.sweep->PixelsPerFrame());
    engine.Render(problem.sweep->Plane(0), ViewOutput::Intensity, images.data(),
                  images.data() + problem.sweep->PixelsPerFrame());
    return images;
  };
  const std::vector<float> truth = show(*Engine::Create("reference"));
  for (const int processes : kProcesses)
  {
    const auto images = Answers<std::vector<float>>(processes, "cpu", show);
    const std::size_t pixels = problem.sweep->PixelsPerFrame();
    for (std::size_t p = 0; p < pixels; ++p)
    {
      ASSERT_NEAR(images[0][p], truth[p], tolerance);  // of the sum, whatever the number of processes
      ASSERT_NEAR(images[0][pixels + p], truth[pixels + p], 0.01 * truth[pixels + p] + 0.1);
    }
    EXPECT_EQ(images.front(), images.back());
  }
}

TEST(PartEngine, GradientsAndScoresAreThoseOfTheWholeField)
{
  const Problem problem = RandomProblem(10, 700, 6, 3, 0.3, 30, 26);
  const auto find = [&](Engine& engine)
  {
    engine.SetAccuracy({1e-4, true});
    engine.SetFrames(problem.sweep);
    engine.SetField(problem.field);
    engine.ResetScores();
    engine.Backpropagate({0, 2}, Loss::Parse("0.7*l2+0.2*dssim+0.1*contrast"));
    std::vector<double> numbers = Flat(engine.GetGradient());
    const Engine::Scores scores = engine.GetScores();
    numbers.insert(numbers.end(), scores.error.begin(), scores.error.end());
    numbers.insert(numbers.end(), scores.visits.begin(), scores.visits.end());
    return numbers;
  };
  const std::vector<double> truth = find(*Engine::Create("cpu-double"));
  for (const int processes : kProcesses)
  {
    const auto found = Answers<std::vector<double>>(processes, "cpu-double", find);
    EXPECT_LT(RelativeError(truth, found[0]), 1e-11) << processes << " processes";
    EXPECT_EQ(found.front(), found.back());
  }
}

TEST(PartEngine, WhatEachFrameReflectsIsThatOfTheWholeField)
{
  const Problem problem = RandomProblem(11, 700, 6, 3, 0.3, 30, 26);
  const std::vector<int> frames = {0, 2};
  Random random(12);
  std::vector<float> viewed(frames.size() * problem.field.Size());
  std::generate(viewed.begin(), viewed.end(), [&random] { return static_cast<float>(random.Uniform(-0.5, 0.5)); });
  const auto find = [&](Engine& engine)
  {
    ViewEngine& views = *ViewEngine::Of(engine);
    engine.SetAccuracy({1e-4, true});
    engine.SetFrames(problem.sweep);
    engine.SetField(problem.field);
    std::vector<float> derivatives, sums;
    std::vector<double> numbers = {views.Backpropagate(frames, Loss::Parse("l2"), viewed, derivatives)};
    const std::vector<double> gradient = Flat(engine.GetGradient());
    const auto square = [](std::size_t, int, float* line)
    { std::transform(line, line + 30, line, [](float s) { return s * s; }); };
    views.Walk(frames, viewed, square, &sums);
    std::vector<double> changed = views.Reflectivities();
    std::reverse(changed.begin(), changed.end());
    views.SetReflectivities(changed);
    const std::vector<double> now = engine.GetField().reflectivities;
    numbers.insert(numbers.end(), gradient.begin(), gradient.end());
    numbers.insert(numbers.end(), derivatives.begin(), derivatives.end());
    numbers.insert(numbers.end(), sums.begin(), sums.end());
    numbers.insert(numbers.end(), now.begin(), now.end());
    return numbers;
  };
  const std::vector<double> truth = find(*Engine::Create("cpu-double"));
  for (const int processes : kProcesses)
  {
    const auto found = Answers<std::vector<double>>(processes, "cpu-double", find);
    ASSERT_EQ(found[0].size(), truth.size());
    // Derivatives and sums are handed on as float, which rounds each by at most 6e-8 of itself.
    EXPECT_LT(RelativeError(truth, found[0]), 1e-7) << processes << " processes";
    EXPECT_EQ(found.front(), found.back());
  }
}

TEST(PartEngine, EnginesThatCannotSaySo)
{
  const auto errors = InThreads(2, [](Exchange& exchange) { exchange.CreateEngine("reference"); });
  for (const std::string& error : errors)
  {
    EXPECT_NE(error.find("choose \"cpu\""), std::string::npos) << error;
  }
}

TrainerOptions QuickOptions()
{
  TrainerOptions options;
  options.engine = "cpu";
  options.automatic = false;
  options.gaussians = 1500;
  options.iterations = 30;
  options.holdOut = 6;
  return options;
}

/// The results of all processes, which are the same.
TrainingResult TrainTogether(int processes, const std::shared_ptr<const Sweep>& sweep, const TrainerOptions& options)
{
  std::vector<TrainingResult> results(static_cast<std::size_t>(processes));
  const auto errors = InThreads(
      processes, [&](Exchange& exchange)
      { results[static_cast<std::size_t>(exchange.Rank())] = Train(sweep, options, nullptr, {}, {}, exchange); });
  EXPECT_EQ(errors, std::vector<std::string>(static_cast<std::size_t>(processes)));
  for (const TrainingResult& result : results)
  {
    EXPECT_TRUE(SameField(result.field, results[0].field));
    EXPECT_EQ(result.view.has_value(), results[0].view.has_value());
    EXPECT_TRUE(!result.view || result.view->terms == results[0].view->terms);
    EXPECT_EQ(result.processes, processes);
  }
  return results[0];
}

// Training makes rounding grow: l1 pulls at a pixel with full strength to the side on which it is, and after some hundred
// steps fields differ as those of two instruction sets do. l2 and thirty iterations, of four small steps each, leave the
// growth far below what anybody sees.
TEST(TrainingInParts, GivesAFieldAsGood)
{
  const auto sweep = RenderedSweep();
  std::vector<TrainerOptions> all(4, QuickOptions());
  all[1].densification.interval = 5;
  all[2].validation = 4;
  all[2].frameGains = true;
  all[3].loss = Loss::Parse("l2+0.2*dssim");
  for (TrainerOptions& options : all)
  {
    options.engine = "cpu-double";
    options.loss = options.loss.value_or(Loss::Parse("l2"));
    const TrainingResult alone = Train(sweep, options);
    const double truth = PsnrOn(alone.field, *sweep, alone.heldOutFrames, "cpu");
    for (const int processes : {1, 2, 4})
    {
      const TrainingResult result = TrainTogether(processes, sweep, options);
      EXPECT_NEAR(PsnrOn(result.field, *sweep, result.heldOutFrames, "cpu"), truth, 0.01) << processes << " processes";
      EXPECT_EQ(result.iterations, alone.iterations);
    }
  }
}

TEST(TrainingInParts, OneProcessGivesTheBitsOfATrainingAlone)
{
  const auto sweep = RenderedSweep();
  EXPECT_TRUE(SameField(TrainTogether(1, sweep, QuickOptions()).field, Train(sweep, QuickOptions()).field));
}

TEST(TrainingInParts, DecidesTogether)
{
  TrainerOptions options = QuickOptions();
  options.automatic = true;
  options.gaussians.reset();
  const TrainingResult result = TrainTogether(2, RenderedSweep(), options);
  EXPECT_GT(result.decisions.size(), 2u);
}

TEST(TrainingInParts, LearnsDirectionsAsOneProcessDoes)
{
  PhantomOptions made;
  made.width = 32;
  made.height = 28;
  made.pixelSize = 0.4;
  made.frames = 24;
  made.tilt = 8;
  made.passes = 2;
  const auto sweep = std::make_shared<const Sweep>(Phantom(made).MakeSweep());
  TrainerOptions options = QuickOptions();
  options.engine = "cpu-double";
  options.loss = Loss::Parse("l2");
  options.gaussians = 300;
  options.viewDependence = true;
  const TrainingResult alone = Train(sweep, options);
  ASSERT_TRUE(alone.view);
  const double truth = ScoreField(alone.field, *sweep, alone.heldOutFrames, "cpu", &*alone.view).psnr;
  for (const int processes : {1, 2, 3})
  {
    const TrainingResult result = TrainTogether(processes, sweep, options);
    ASSERT_TRUE(result.view) << processes << " processes";
    EXPECT_TRUE(result.view->views == alone.view->views);
    EXPECT_NEAR(ScoreField(result.field, *sweep, result.heldOutFrames, "cpu", &*result.view).psnr, truth, 0.01);
  }
}

TEST(TrainingInParts, GoesByTheClockOfTheFirst)
{
  TrainerOptions options = QuickOptions();
  options.iterations = 10000000;
  options.timeLimit = 1.5;
  const TrainingResult result = TrainTogether(3, RenderedSweep(), options);
  EXPECT_GT(result.iterations, 0);
  EXPECT_LT(result.iterations, 10000000);
}

TEST(TrainingInParts, WhatStopsOneStopsAll)
{
  const auto sweep = RenderedSweep();
  std::vector<TrainingResult> results(3);
  const auto errors = InThreads(
      3,
      [&](Exchange& exchange)
      {
        const int rank = exchange.Rank();
        results[static_cast<std::size_t>(rank)] = Train(
            sweep, QuickOptions(), nullptr,
            [rank](const TrainingProgress& now) { return rank != 2 || now.record.iteration < 20; }, {}, exchange);
      });
  EXPECT_EQ(errors, std::vector<std::string>(3));
  for (const TrainingResult& result : results)
  {
    EXPECT_TRUE(result.aborted);
    EXPECT_EQ(result.iterations, 20);
    EXPECT_TRUE(SameField(result.field, results[0].field));
  }
}

TEST(TrainingInParts, WhatFailsInOneFailsInAll)
{
  const auto sweep = RenderedSweep();
  const auto errors = InThreads(4,
                                [&](Exchange& exchange)
                                {
                                  const bool fails = exchange.Rank() == 2;
                                  Train(
                                      sweep, QuickOptions(), nullptr,
                                      [fails](const TrainingProgress& now) -> bool
                                      {
                                        if (fails && now.record.iteration == 17)
                                        {
                                          throw Error("the disk is full");
                                        }
                                        return true;
                                      },
                                      {}, exchange);
                                });
  EXPECT_EQ(errors[2], "the disk is full");
  EXPECT_EQ(errors[0], "Process 2 of 4: the disk is full");
}

TEST(TrainingInParts, RefusesWhatCannotWork)
{
  const auto sweep = RenderedSweep();
  const auto ask = [&](const std::function<void(int, TrainerOptions&)>& change)
  {
    return InThreads(2,
                     [&](Exchange& exchange)
                     {
                       TrainerOptions options = QuickOptions();
                       change(exchange.Rank(), options);
                       Train(sweep, options, nullptr, {}, {}, exchange);
                     });
  };
  const std::vector<std::pair<std::function<void(int, TrainerOptions&)>, std::string>> wrong = {
      {[](int rank, TrainerOptions& options) { options.batch = 2 + rank; }, "process 1 has 'batch: 3'"},
      {[](int rank, TrainerOptions& options) { options.timeLimit = 1 + rank; }, "process 1 has 'TimeLimit: 2'"},
      {[](int rank, TrainerOptions& options) { options.batch = rank; }, "batch"}};
  for (const auto& [change, words] : wrong)
  {
    for (const std::string& error : ask(change))
    {
      EXPECT_NE(error.find(words), std::string::npos) << error;
    }
  }
}

}  // namespace
}  // namespace bigus::test
