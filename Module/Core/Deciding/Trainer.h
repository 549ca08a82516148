// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From a tracked sweep to a Gaussian field: decide, then train.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "Core/Deciding/Decision.h"
#include "Core/Deciding/PoseCorrection.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
#include "Core/Training/TrainerOptions.h"
#include "Core/Training/TrainingProgress.h"

namespace bigus
{

struct TrainingResult
{
  GaussianField field;
  std::vector<TrainingRecord> log;
  std::vector<Decision> decisions;
  /// The poses, of all frames of the sweep, that the field was trained at; as recorded where nothing was corrected.
  /// Held-out frames belong at these, too: their own pixels had no part in them.
  std::vector<Eigen::Matrix4d> imageToReference;
  TrainerOptions settled;  ///< the options with every choice made, none left open
  int iterations = 0;
  double seconds = 0;
  std::string device;
  bool aborted = false;  ///< the callback said stop; the field is the best so far
  std::vector<int> trainingFrames, validationFrames, heldOutFrames;
};

/// `progress` (may be empty) is called at least every 100 ms or once an iteration; returning false stops training and
/// keeps the best field so far. `start` (may be null) is a field to continue from instead of seeding; without one,
/// fewer than two frames to train on or frames of equal pixels throughout are an Error.
TrainingResult Train(std::shared_ptr<const Sweep> sweep, const TrainerOptions& options,
                     const GaussianField* start = nullptr, const ProgressCallback& progress = {});

}  // namespace bigus
