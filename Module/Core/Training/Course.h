// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a training keeps from one step to the next, and its bytes. Private to Core.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Engine/Exchange.h"
#include "Core/Numerics/StateBytes.h"
#include "Core/Training/FieldAverage.h"
#include "Core/Training/FrameCorrections.h"
#include "Core/Training/Targets.h"
#include "Core/Training/TrainingPlan.h"
#include "Core/Training/TrainingProgress.h"

namespace bigus
{

/// All but the engine's state. The order of the batches follows from the seed and the number of steps.
struct Course
{
  int iteration = 0;   ///< steps taken
  int firstStage = 0;  ///< of them in the first stage
  int coarseness = 1;  ///< of the first stage's frames
  SecondStage second;
  double passes = 0;  ///< over what is trained on
  bool isFirstStage = false;
  LearningRates rates;      ///< the first ones
  std::size_t cap = 0;      ///< DensificationOptions::cap
  double trainingTime = 0;  ///< s, of steps before the last resumption
  double lossSum = 0;       ///< since the last line of the log
  int lossCount = 0;
  std::size_t corrections = 0;  ///< how often frames were corrected
  Corrections corrected;        ///< what was found the last time
  std::vector<TrainingRecord> log;
  std::optional<FieldPart> best;  ///< on the validation frames
  double bestPsnr = 0;
  int sinceBest = 0;               ///< evaluations
  int endsAt = 0;                  ///< the last step, where validation frames brought it forward; 0: as planned
  FieldAverage average;            ///< of the last part
  std::optional<FieldPart> first;  ///< at the end of the first stage

  /// Notes what the validation frames say of the engine's field. False when `patience` evaluations in a row were no
  /// better than the best.
  bool Note(double psnr, const Engine& engine, int patience);
};

/// What a state may say at the most.
struct CourseBounds
{
  const TrainingPlan& plan;
  int side = 1;              ///< pixels, of the frames' shorter side
  std::size_t frames = 0;    ///< to train on
  bool isOfSeveral = false;  ///< processes
};

void SaveCourse(const Course& course, const CourseBounds& bounds, StateWriter& to);
/// Throws Error for bytes that are no such state.
Course LoadCourse(const CourseBounds& bounds, StateReader& from);

/// Of every process its part, in one state: the first keeps it for all.
void SaveParts(std::string own, Exchange& exchange, StateWriter& to);
/// The part of this process.
std::string_view LoadPart(std::string_view state, Exchange& exchange);

}  // namespace bigus
