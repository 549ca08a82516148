// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Whether a sweep's echoes depend on the direction they are seen from, and how. After the ordinary training. Private to
// Core.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Formula/LearningRates.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
#include "Core/Model/ViewDependence.h"
#include "Core/Training/TrainingPlan.h"

namespace bigus
{

/// What frames that short trainings have not seen say of view dependence.
struct ViewEvidence
{
  static constexpr double kLeastGain = 0.02;  ///< dB

  std::vector<double> gains;  ///< dB, on each of those frames, of a training with q over one without
  double gain = 0;            ///< dB, their mean
  double error = 0;           ///< dB, standard error of the mean

  /// Of at least two gains.
  static ViewEvidence Of(std::vector<double> gains);
  bool IsWorth() const { return gain > kLeastGain && gain > 2 * error; }
  /// That more frames would hardly say otherwise: no gain, or one that is worth it and five times as large as need be.
  bool IsClear() const { return gain <= kLeastGain || (IsWorth() && gain > 5 * kLeastGain); }
};

/// Asks frames that nothing has seen: two thirds of `frames` train a field in a short training, which is trained on with q
/// and without; the other third judges. Where that is not clear, of fewer than 60 frames each third judges in turn, of more
/// the same third after a training twice as long. Null where there are too few frames or one orientation, or `goOn` says
/// stop.
std::optional<ViewEvidence> AskForViews(const std::shared_ptr<const Sweep>& sweep, const std::vector<int>& frames,
                                        const TrainingPlan& plan, const std::function<bool()>& goOn);

/// What a training with view dependence trains on: recorded frames and virtual planes.
struct ViewTargets
{
  std::shared_ptr<const Sweep> images;  ///< with the mask of pixels that count
  std::vector<int> frames;              ///< of them, in their order along the sweep
  ParameterLimits limits;
};

struct ViewedField
{
  GaussianField field;
  ViewDependence view;
};

/// Trains a finished field on, with q, which is off on three planes of ten, so that what is shown without it stays as good.
/// It begins with `first`; without terms it begins at 0, and is trained for half as many steps. Null when `goOn`, asked at
/// every step, says stop. `engine` must be a ViewEngine.
std::optional<ViewedField> TrainViews(Engine& engine, const ViewTargets& targets, const TrainingPlan& plan,
                                      const GaussianField& field, const ViewDependence& first,
                                      const std::function<bool()>& goOn);

}  // namespace bigus
