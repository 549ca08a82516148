// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How a training goes by its plan alone: no engine, no frame.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "Core/Training/Batches.h"
#include "Core/Training/Schedule.h"

namespace
{

using bigus::Batches;
using bigus::Moment;
using bigus::TrainingPlan;

TrainingPlan PlanOfStages()
{
  TrainingPlan plan;
  plan.iterations = 1000;
  plan.batch = 4;
  plan.virtualPlanes = 3;
  plan.finalRate = 0.1;
  plan.timeLimit = 0;
  return plan;
}

TEST(Schedule, GoesByStepsOrByTheClockWhicheverIsAhead)
{
  TrainingPlan plan = PlanOfStages();
  EXPECT_DOUBLE_EQ(FractionDone(plan, 1, 77, 0), 0);
  EXPECT_DOUBLE_EQ(FractionDone(plan, 251, 77, 0), 0.25);
  plan.timeLimit = 20;
  EXPECT_DOUBLE_EQ(FractionDone(plan, 251, 2, 0), 0.25);
  EXPECT_DOUBLE_EQ(FractionDone(plan, 251, 10, 0), 0.49)
      << "half of the time, of which it must be ahead by 0.02 at first";
  EXPECT_DOUBLE_EQ(FractionDone(plan, 251, 15, 10), 0.49) << "10 s went before the first step";
  EXPECT_EQ(FractionDone(plan, 251, 20, 0), 1) << "the clock ends it to the second";
  // 1000 steps in half of the time, of which the first takes 2 % of it: the clock never counts.
  for (const int step : {1, 2, 3, 10, 500, 1000})
  {
    EXPECT_EQ(FractionDone(plan, step, step == 1 ? 0.0 : 0.4 + 0.0096 * (step - 1), 0), (step - 1) / 1000.0) << step;
  }
}

TEST(Schedule, StepsInAllFollowFromThoseSoFarUnderATimeLimit)
{
  TrainingPlan plan = PlanOfStages();
  EXPECT_DOUBLE_EQ(StepsInAll(plan, {50, 0.25}), 1000);
  plan.timeLimit = 20;
  EXPECT_DOUBLE_EQ(StepsInAll(plan, {50, 0.25}), 200);
  EXPECT_DOUBLE_EQ(StepsInAll(plan, {900, 0.25}), 1000) << "never more than the plan's";
  EXPECT_DOUBLE_EQ(StepsInAll(plan, {0, 0}), 1000) << "none so far";
}

TEST(Schedule, RatesFallWithProgressAndPasses)
{
  const TrainingPlan plan = PlanOfStages();
  EXPECT_DOUBLE_EQ(RateLeft(plan, 40, {0, 0, 0}), 1);
  EXPECT_NEAR(RateLeft(plan, 40, {500, 0.5, 0}), std::sqrt(0.1), 1e-12);
  EXPECT_NEAR(RateLeft(plan, 40, {1000, 1, 0}), 0.1, 1e-12);
  EXPECT_NEAR(RateLeft(plan, 40, {0, 0, 300}), std::sqrt(0.5), 1e-12);
}

TEST(Schedule, AFirstStageOfDenseFramesWithoutALimitMayEndAtAnyTime)
{
  TrainingPlan plan = PlanOfStages();
  EXPECT_DOUBLE_EQ(RateLeft(plan, 40, {64, 0, 0, true}), 0.5);
  EXPECT_DOUBLE_EQ(RateLeft(plan, 40, {64, 0, 0, false}), 1);
  plan.sparse = true;
  EXPECT_DOUBLE_EQ(RateLeft(plan, 40, {64, 0, 0, true}), 1);
  plan.sparse = false;
  plan.timeLimit = 10;
  EXPECT_DOUBLE_EQ(RateLeft(plan, 40, {64, 0, 0, true}), 1);
}

TEST(Schedule, AFieldToContinueFromGetsSmallerSteps)
{
  TrainingPlan plan = PlanOfStages();
  plan.continued = true;
  plan.iterations = 40;  // one pass of 4 over 40 frames and 120 virtual planes
  EXPECT_NEAR(RateLeft(plan, 40, {}), 0.2, 1e-12);
  plan.iterations = 160;
  EXPECT_NEAR(RateLeft(plan, 40, {}), 0.4, 1e-12);
  plan.iterations = 1;
  EXPECT_NEAR(RateLeft(plan, 40, {}), 0.1, 1e-12) << "the least";
  plan.iterations = 100000;
  EXPECT_NEAR(RateLeft(plan, 40, {}), 1, 1e-12) << "the most";
}

TEST(Schedule, FewStepsAreTakenSmall)
{
  EXPECT_EQ(bigus::PartsOfBatch(499, 8), 4u);
  EXPECT_EQ(bigus::PartsOfBatch(500, 8), 2u);
  EXPECT_EQ(bigus::PartsOfBatch(2000, 8), 1u);
  EXPECT_EQ(bigus::PartsOfBatch(10, 3), 3u) << "no part is empty";
}

TEST(Schedule, DensifiesInTheMiddleAtItsInterval)
{
  TrainingPlan plan = PlanOfStages();
  EXPECT_FALSE(IsDensified(plan, 300, 0.3)) << "no interval is set";
  plan.densification.interval = 100;
  EXPECT_TRUE(IsDensified(plan, 300, 0.3));
  EXPECT_FALSE(IsDensified(plan, 301, 0.301));
  EXPECT_FALSE(IsDensified(plan, 100, 0.05));
  EXPECT_FALSE(IsDensified(plan, 700, 0.7));
}

TEST(Schedule, TwentyFieldsOfTheLastTenthAreAveraged)
{
  for (const int steps : {200, 1000, 4000})
  {
    int averaged = 0;
    for (int iteration = 1; iteration <= steps; ++iteration)
    {
      averaged += bigus::IsLastPart((iteration - 1.0) / steps) && bigus::IsAveraged(iteration, steps);
    }
    EXPECT_EQ(averaged, 20) << steps << " steps";
  }
  EXPECT_TRUE(bigus::IsAveraged(7, 10)) << "every step where there are few";
}

TEST(Schedule, WhatValidationEndsStillGetsItsLastTenth)
{
  const TrainingPlan plan = PlanOfStages();
  EXPECT_EQ(EndAfter(plan, 400, 1000), 500);
  EXPECT_EQ(EndAfter(plan, 950, 1000), 1000);
}

TEST(Schedule, TheTimeLeftCountsPlanesThatAreStillToBeMade)
{
  TrainingPlan plan = PlanOfStages();
  EXPECT_DOUBLE_EQ(SecondsLeft(plan, 40, 1, {1000, 1, 0, false}, 0.5), 0);
  EXPECT_DOUBLE_EQ(SecondsLeft(plan, 40, 1, {600, 0.6, 0, false}, 0.5), 200);
  // 150 steps of the first stage, 750 of the second, and 120 planes, of which each takes as long as two frames of a step of
  // four.
  EXPECT_DOUBLE_EQ(SecondsLeft(plan, 40, 1, {100, 0.1, 0, true}, 1), 150 + 750 + 60);
  plan.virtualPlanes = 0;
  EXPECT_DOUBLE_EQ(SecondsLeft(plan, 40, 1, {100, 0.1, 0, true}, 1), 900);
}

TEST(Schedule, AStoppedFieldSettlesForFortyStepsOrSixTenthsOfASecond)
{
  EXPECT_LT(bigus::SettlingDone(39, 0.1), 1);
  EXPECT_GE(bigus::SettlingDone(40, 0.1), 1);
  EXPECT_GE(bigus::SettlingDone(1, 0.6), 1);
  EXPECT_DOUBLE_EQ(bigus::SettlingRate(1), 0.1);
  EXPECT_DOUBLE_EQ(bigus::SettlingRate(7), 0.1) << "a step may take longer than all of it";
  EXPECT_FALSE(bigus::IsSettled(0.5));
  EXPECT_TRUE(bigus::IsSettled(0.7));
}

TEST(Batches, EveryPassSeesEveryFrameOnceAndABatchIsSpreadAlongTheSweep)
{
  const std::vector<int> frames = {3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14};
  Batches batches(frames, 4, 5);
  std::set<std::vector<int>> orders;
  for (int pass = 0; pass < 5; ++pass)
  {
    std::vector<int> seen;
    for (int k = 0; k < 3; ++k)
    {
      std::vector<int> batch = batches.Next();
      ASSERT_EQ(batch.size(), 4u);
      seen.insert(seen.end(), batch.begin(), batch.end());
      std::sort(batch.begin(), batch.end());
      for (std::size_t n = 1; n < batch.size(); ++n)
      {
        EXPECT_GE(batch[n] - batch[n - 1], 3) << "12 frames in batches of 4";
      }
    }
    orders.insert(seen);
    std::sort(seen.begin(), seen.end());
    EXPECT_EQ(seen, frames);
  }
  EXPECT_GT(orders.size(), 1u);
}

TEST(Batches, FollowFromTheSeedAndTheirNumber)
{
  const std::vector<int> frames = {0, 1, 2, 3, 4, 5, 6};
  Batches all(frames, 3, 9), later(frames, 3, 9);
  for (int k = 0; k < 11; ++k)
  {
    all.Next();
  }
  later.Skip(11);
  EXPECT_EQ(later.Next(), all.Next());
}

}  // namespace
