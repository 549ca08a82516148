// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How a training goes, by its plan and the numbers of its steps alone: rates, losses, stages, what is densified, averaged
// and logged when, and the time left. Pure functions. Private to Core.
#pragma once

#include <array>
#include <cstddef>

#include "Core/Formula/LearningRates.h"
#include "Core/Model/GaussianField.h"
#include "Core/Training/TrainingPlan.h"

namespace bigus
{

/// Share of training that sees the recorded frames alone, perhaps reduced. Virtual planes join then.
constexpr double kFirstStage = 0.25;

/// When frames' gains are found, as fractions of training: once the field says more than one frame does, and again when
/// it is better.
constexpr std::array<double, 2> kCorrections = {0.3, 0.6};

/// Where a training is, before a step.
struct Moment
{
  int iteration = 0;    ///< steps taken
  double fraction = 0;  ///< of training, 0 to 1: FractionDone of the step that comes
  double passes = 0;    ///< over what is trained on
  bool isFirstStage = false;
};

/// False where what training sees changes on the way, by gains of frames found in it: then there is one stage.
bool HasFirstStage(const TrainingPlan& plan);

/// How far training is before step `iteration`, from 1: by steps, and by the clock where that is ahead, so that the rates
/// are spent when it ends. A limit that steps do not reach changes nothing. `seconds` of the plan's time limit have passed,
/// `begun` of them before the first step.
double FractionDone(const TrainingPlan& plan, int iteration, double seconds, double begun);

/// Steps in all. With a time limit they follow from those so far, of which there may be none.
double StepsInAll(const TrainingPlan& plan, const Moment& now);

/// The step sizes that a training of such a field begins with.
LearningRates FirstRates(const TrainingPlan& plan, const GaussianField& field);

/// The share of the first rates that is left, for so many `frames` to train on.
double RateLeft(const TrainingPlan& plan, std::size_t frames, const Moment& now);

LearningRates Scaled(const LearningRates& rates, double factor);

/// In how many parts a step takes its batch where there are so many steps in all: more, smaller steps where they are few.
std::size_t PartsOfBatch(double stepsInAll, std::size_t batch);

/// Whether Gaussians are added and removed after this step.
bool IsDensified(const TrainingPlan& plan, int iteration, double fraction);

/// Whether this is the end of training that the field is averaged over, and whether it is averaged after this step.
bool IsLastPart(double fraction);
bool IsAveraged(int iteration, double stepsInAll);

/// The last step where validation frames say after this one that it is enough: the mean at the end is worth more than
/// what single fields no longer gain, so the end comes, but not at once.
int EndAfter(const TrainingPlan& plan, int iteration, double stepsInAll);

/// Steps from one line of the log to the next.
int LogInterval(const TrainingPlan& plan);

/// By how much a step of the second stage takes longer than one on the first's frames, whose sides are divided by
/// `coarseness`, for what is told of the time left.
double Growth(const TrainingPlan& plan, int coarseness);

/// Seconds that the steps left after `now` will take, and the virtual planes to be made, at a pace of so many seconds a
/// step.
double SecondsLeft(const TrainingPlan& plan, std::size_t frames, int coarseness, const Moment& now, double pace);

/// Seconds of the second stage at the first's pace.
double SecondsOfSecondStage(const TrainingPlan& plan, int coarseness, double pace);

/// What a field that is stopped amid training still gets: `done` of that after step k, from 1, and so many seconds; it is
/// over from 1 on.
double SettlingDone(int k, double seconds);
/// The share of the rates of then that is left, and whether the field is averaged.
double SettlingRate(double done);
bool IsSettled(double done);

}  // namespace bigus
