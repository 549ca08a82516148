// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/Schedule.h"

#include <algorithm>
#include <cmath>

namespace bigus
{
namespace
{

/// Passes over the frames beyond which the rates fall with the root of their number. On a volume of 64
/// slices no such fall gives 0.8 dB less after 2500 passes, and 100 instead of 300 gives 0.25 dB less after 125.
constexpr double kSettledPasses = 300;

/// Steps after which the rates of the first stage are halved where frames are dense and no time limit tells its end,
/// because the field is to be good whenever somebody stops. The second stage begins at full rates again, so this costs
/// 0.04 dB of 43.1 (ShortTrainingMeasured.md has the gain). Sparse frames gain nothing by it: brain sweep -0.1 to -0.2 dB, spine 0.
constexpr double kOpenEndedSteps = 64;

/// The share of the first rates that a field to continue from begins with, for a training of one pass over frames and
/// virtual planes; it grows with the root of passes, up to 1. Whole steps throw a good field back, and few passes do not
/// make up for that (ShortTraining.md).
constexpr double kContinuedRate = 0.2, kLeastContinuedRate = 0.1;

/// Steps on one frame that take as long as a virtual plane to be made, for what is told of the time left. Liver sweep at half
/// and at full size, brain and spine sweep, whose planes are made by flow: 1.4, 2.4, 6.7 and 6.
constexpr double kStepsToMakeDensePlane = 2, kStepsToMakeSparsePlane = 6;

/// Steps in all, below which every step is taken as two or four on parts of its batch. Few steps are better taken
/// small; in long training they jitter. Held-out PSNR of the liver sweep (half, 100,000 Gaussians), whole steps, halves
/// and quarters: 38.01, 38.32 and 38.53 dB with 153 steps, 42.45, 42.59 and 42.56 with 1376, 43.31 and 43.22 with 3670.
constexpr double kQuarteredSteps = 500, kHalvedSteps = 2000;

/// The end of training that the field is averaged over, and how many fields of it are. A step of Adam jitters by its
/// rate, which the mean does not, so rates need not fall as far (Measured.md has what this gains).
constexpr double kAveragedFrom = 0.9;
constexpr double kAveragedFields = 20;

/// What a field that is stopped amid training still gets: so many steps or seconds, whichever are over first, because who
/// stops a program waits for it; the share of the rates of then that is left at their end; and the part of them from
/// which on fields are averaged.
constexpr int kSettlingSteps = 40;
constexpr double kSettlingSeconds = 0.6, kSettlingRate = 0.1, kSettledFrom = 2.0 / 3;

/// First and last densification, as fractions of training: not before error scores mean something, and not so late that
/// what is new cannot settle.
constexpr double kFirstDensification = 0.1, kLastDensification = 0.6;

/// Lines of the log that a training of many iterations writes; each costs a pass over the validation frames.
constexpr int kLogLines = 100;

/// Seconds that a time limit leaves to training at the least, so that nothing is divided by 0.
constexpr double kLeastTime = 1e-3;

/// By what share of a time limit the clock must be ahead of the steps at first to count, falling to 0 at its end. So the
/// first steps, which are slow, and a busy moment change nothing where the limit is never reached.
constexpr double kClockLead = 0.02;

double MeanMagnitude(const std::vector<double>& values)
{
  double sum = 0;
  for (double value : values)
  {
    sum += std::abs(value);
  }
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

/// By what the rates of a field to continue from are less than those of seeds.
double ContinuedRate(const TrainingPlan& plan, std::size_t frames, const Moment& now)
{
  if (!plan.continued)
  {
    return 1;
  }
  const double views = static_cast<double>(frames) * (1 + plan.virtualPlanes);
  const double passes = StepsInAll(plan, now) * plan.batch / views;
  return std::clamp(kContinuedRate * std::sqrt(passes), kLeastContinuedRate, 1.0);
}

}  // namespace

bool HasFirstStage(const TrainingPlan& plan)
{
  // Gains are found on the way, which needs all frames as they are from the first step on.
  return plan.iterations > 0 && !plan.frameGains;
}

double FractionDone(const TrainingPlan& plan, int iteration, double seconds, double begun)
{
  const double fraction = static_cast<double>(iteration - 1) / plan.iterations;
  if (plan.timeLimit > 0)
  {
    const double clock = (seconds - begun) / std::max(plan.timeLimit - begun, kLeastTime);
    return std::max(fraction, clock - kClockLead * (1 - clock));
  }
  return fraction;
}

double StepsInAll(const TrainingPlan& plan, const Moment& now)
{
  return plan.timeLimit > 0 && now.fraction > 0 ? std::min<double>(plan.iterations, now.iteration / now.fraction)
                                                : plan.iterations;
}

LearningRates FirstRates(const TrainingPlan& plan, const GaussianField& field)
{
  const double meanMagnitude = MeanMagnitude(field.reflectivities);
  LearningRates rates;
  rates.mean = plan.meanRate * plan.pixelSize;
  rates.logScale = plan.shapeRate;
  rates.rotation = plan.shapeRate;
  // An all-dark start has no magnitude to go by; 1 is the mean scattering that gamma aims at.
  rates.reflectivity = plan.reflectivityRate * (meanMagnitude > 0 ? meanMagnitude : 1.0);
  return rates;
}

/// What a step of Adam jitters by is in proportion to its rate, so long training at full rate wears a field out.
double RateLeft(const TrainingPlan& plan, std::size_t frames, const Moment& now)
{
  const double left = std::pow(plan.finalRate, now.fraction) / std::sqrt(1 + now.passes / kSettledPasses);
  const bool isOpenEnded = now.isFirstStage && !plan.sparse && plan.timeLimit == 0;
  return ContinuedRate(plan, frames, now) * (isOpenEnded ? left / (1 + now.iteration / kOpenEndedSteps) : left);
}

LearningRates Scaled(const LearningRates& rates, double factor)
{
  return {rates.mean * factor, rates.logScale * factor, rates.rotation * factor, rates.reflectivity * factor};
}

std::size_t PartsOfBatch(double stepsInAll, std::size_t batch)
{
  const std::size_t wanted = stepsInAll < kQuarteredSteps ? 4 : stepsInAll < kHalvedSteps ? 2 : 1;
  return std::min(batch, wanted);
}

bool IsDensified(const TrainingPlan& plan, int iteration, double fraction)
{
  const int interval = plan.densification.interval;
  return interval > 0 && iteration % interval == 0 && fraction >= kFirstDensification && fraction <= kLastDensification;
}

bool IsLastPart(double fraction)
{
  return fraction >= kAveragedFrom;
}

bool IsAveraged(int iteration, double stepsInAll)
{
  return iteration % std::max(1L, std::lround((1 - kAveragedFrom) * stepsInAll / kAveragedFields)) == 0;
}

int EndAfter(const TrainingPlan& plan, int iteration, double stepsInAll)
{
  const double end = iteration + std::ceil((1 - kAveragedFrom) * stepsInAll);
  return static_cast<int>(std::min<double>(end, plan.iterations));
}

int LogInterval(const TrainingPlan& plan)
{
  return std::max(1, plan.iterations / kLogLines);
}

/// 1.5 on the liver sweep and 1.3 on the brain's, whose sides are halved first; 1.03 where frames are interleaved then.
double Growth(const TrainingPlan& plan, int coarseness)
{
  return plan.virtualPlanes > 0 ? std::sqrt(static_cast<double>(coarseness)) : 1;
}

double SecondsLeft(const TrainingPlan& plan, std::size_t frames, int coarseness, const Moment& now, double pace)
{
  if (!now.isFirstStage)
  {
    return pace * (plan.iterations - now.iteration);
  }
  const double first = kFirstStage * plan.iterations;
  const double planes = (plan.sparse ? kStepsToMakeSparsePlane : kStepsToMakeDensePlane) * plan.virtualPlanes *
                        static_cast<double>(frames) / plan.batch;
  return pace * (std::max(0.0, first - now.iteration) + Growth(plan, coarseness) * (plan.iterations - first + planes));
}

double SecondsOfSecondStage(const TrainingPlan& plan, int coarseness, double pace)
{
  return (1 - kFirstStage) * Growth(plan, coarseness) * pace * plan.iterations;
}

double SettlingDone(int k, double seconds)
{
  return std::max(static_cast<double>(k) / kSettlingSteps, seconds / kSettlingSeconds);
}

double SettlingRate(double done)
{
  return std::pow(kSettlingRate, std::min(done, 1.0));
}

bool IsSettled(double done)
{
  return done > kSettledFrom;
}

}  // namespace bigus
