// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Sweeps that cross and whose echoes depend on the direction: each is trained by itself first. Private to Core.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "Core/Model/Sweep.h"
#include "Core/Model/ViewDependence.h"
#include "Core/Training/TrainingLoop.h"
#include "Core/Training/TrainingPlan.h"
#include "Core/Training/TrainingProgress.h"

namespace bigus
{

/// True for sequences of at least 12 frames that cross each other, none of which crosses itself.
bool SequencesCross(const Sweep& sweep, const std::vector<int>& frames);

/// Of a field whose Gaussians each come from one of the sequences, q and r such that a Gaussian counts where its sequence
/// looks and nowhere else: the least squares of r, on planes of its own sequence, and 0, on others, over the recorded planes
/// near it. `sequences` are numbers of each Gaussian's, and of each recorded plane's.
ViewDependence Apart(GaussianField& field, const std::vector<int>& sequenceOfGaussian, const RecordedViews& views,
                     const std::vector<int>& sequenceOfView);

struct TrainedApart
{
  Fitted fitted;
  ViewDependence view;
  std::string device;
};

/// Each sequence trains a field of its own, with its frames' share of the plan's Gaussians and steps. Those fields are one
/// then, in which each Gaussian counts where its sequence looks, and that is trained on all frames with q. Null when
/// `progress` says stop. `validationFrames` (may be empty) serve early stop. `keeping` gets the state of all sequences, and
/// `state` (may be empty) is what it got, to go on from.
std::optional<TrainedApart> TrainApart(const std::shared_ptr<const Sweep>& sweep, const std::vector<int>& frames,
                                       const std::vector<int>& validationFrames, const TrainingPlan& plan,
                                       const ProgressCallback& progress, const Keeping& keeping = {},
                                       std::string_view state = {});

}  // namespace bigus
