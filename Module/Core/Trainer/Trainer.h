// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From a tracked sweep to a Gaussian field: decide, then train.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Core/Deciding/Decision.h"
#include "Core/Deciding/PoseCorrection.h"
#include "Core/Engine/Exchange.h"
#include "Core/Inspection/Inspection.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
#include "Core/Model/ViewDependence.h"
#include "Core/Training/TrainerOptions.h"
#include "Core/Training/TrainingProgress.h"

namespace bigus
{

struct TrainingResult
{
  GaussianField field;
  std::optional<ViewDependence> view;  ///< of the field, where directions were found to matter
  std::vector<TrainingRecord> log;
  std::vector<Decision> decisions;
  /// The poses, of all frames of the sweep, that the field was trained at; as recorded where nothing was corrected, and for
  /// frames that the inspection left out.
  /// Held-out frames belong at these, too: their own pixels had no part in them.
  std::vector<Eigen::Matrix4d> imageToReference;
  /// The options with every choice made, so that they repeat the training. Open is poseSmoothing alone, and only where
  /// pictures corrected poses without smoothing, or smoothed sequences differently: then they do so again.
  TrainerOptions settled;
  int iterations = 0;
  double seconds = 0;
  std::string device;
  int processes = 1;     ///< that trained together
  bool aborted = false;  ///< the callback said stop; the field is the best so far
  /// All steps were taken, or validation said stop. Else a training can go on from its last checkpoint.
  bool finished = false;
  std::vector<int> trainingFrames, validationFrames, heldOutFrames;
  std::vector<Finding> findings;  ///< of the inspection; frames left out are in none of the lists above
};

/// What of a training must survive the end of its program.
struct Checkpoints
{
  double interval = 60;  ///< s, >= 0, from one call of `save` to the next
  /// Gets the whole state as bytes of this machine: at intervals, when all is decided, and at the end of a training that
  /// is not finished. Empty: nothing is kept. What it throws ends the training.
  std::function<void(const std::string& state)> save;
  /// What `save` got, to go on from there; empty: begin. The field that a training ends with is then the same, bit for
  /// bit, as if it had never stopped, for any number of threads. A time limit bounds the time of all parts together and
  /// may differ from then: a training that it ends is not repeatable. Bytes that are damaged, or of a training
  /// with another sweep, start, engine or option, are an Error that says which.
  std::string resume;
};

/// A field is trained on what an inspection left of a sweep. Frames are numbered, and poses given, as in what was recorded.
/// A sweep of several sequences (Join) is held out from, and its poses are corrected, sequence by sequence.
/// `progress` (may be empty) is called at least every 100 ms or once an iteration; returning false stops training and
/// keeps the best field so far. `start` (may be null) is a field to continue from instead of seeding; without one,
/// fewer than two frames to train on or frames of equal pixels throughout are an Error.
/// Each process of an `exchange` of several trains a part of the field. All call this, with the same sweep,
/// options and start, and get the same field with the same bits; it differs by rounding from that of another number of
/// processes. When `progress` of one says stop, all stop. The first one's `checkpoints` hold the state of all, and others' are
/// not looked at; as many processes as then go on from it.
TrainingResult Train(InspectedSweep inspected, const TrainerOptions& options, const GaussianField* start = nullptr,
                     const ProgressCallback& progress = {}, const Checkpoints& checkpoints = {},
                     Exchange& exchange = Exchange::Alone());
/// The same of a sweep that is inspected now, with the option `keep`.
TrainingResult Train(std::shared_ptr<const Sweep> sweep, const TrainerOptions& options,
                     const GaussianField* start = nullptr, const ProgressCallback& progress = {},
                     const Checkpoints& checkpoints = {}, Exchange& exchange = Exchange::Alone());

}  // namespace bigus
