// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What an engine trains on. Private to Core.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/Sweep.h"
#include "Core/Training/FrameCorrections.h"
#include "Core/Training/Report.h"
#include "Core/Training/TrainingPlan.h"

namespace bigus
{

/// What the second stage of a training, or its only one, trains on.
struct SecondStage
{
  int planes = 0;      ///< virtual ones in every gap
  int coarseness = 1;  ///< the frames' sides are divided by it
  int pixelStep = 1;   ///< pixels that lie so far apart are frames of their own, see Sweep::Interleaved; 1 with planes
  bool flow = true;    ///< if the plan's interpolation has it
};

/// The sweep with a mask of the pixels that count in the loss. Beside the lit area frames contradict each other:
/// tissue outside one's fan lies inside its neighbour's. So what is dark within an SSIM window of lit pixels does not
/// count. Further out it is black, lest Gaussians reach where no frame looks; nor does it count if `ignoreMasked`.
std::shared_ptr<const Sweep> WithCountedPixels(const Sweep& sweep, bool ignoreMasked);

/// The frames of a sweep that are trained on, perhaps reduced, interleaved or with corrected gains; then virtual planes.
/// Whenever they change, the engine gets them.
class Targets
{
public:
  /// `withVirtualPlanes` is what AddVirtualPlanes gives for these frames and the plan; null makes it when it is needed.
  /// What is referred to must outlive this; the plan may change.
  Targets(std::shared_ptr<const Sweep> sweep, std::vector<int> frames, const TrainingPlan& plan, Engine& engine,
          Report& report, std::shared_ptr<const Sweep> withVirtualPlanes);

  /// Recorded frames alone, their sides divided by `coarseness`.
  void SetFrames(int coarseness);

  /// The frames and virtual planes between them. False, and nothing changes, when making those would take longer than
  /// `most` seconds (0: no limit) or the caller said stop. He is told that so many seconds come `after`.
  bool SetPlanes(const SecondStage& stage, double most = 0, double after = 0);

  /// The most that a time limit leaves time for; it is set. Where planes are dense there may be fewer virtual planes, or
  /// none. Where they are sparse frames are reduced instead, because detail is learned last. Before either, planes are
  /// made without flow, which takes most of the time. `secondsOfPass` is the first stage's pace; frames of half the sides
  /// take half as long. Null, and the first stage's frames stay, when the caller said stop.
  std::optional<SecondStage> SetPlanesInTime(double secondsOfPass, double after);

  /// Undoes what was found about the frames' gains.
  void Correct(const Corrections& found);

  const Sweep& Images() const { return *images_; }
  /// Those of Images() that are trained on, in their order along the sweep.
  const std::vector<int>& Frames() const { return frames_; }
  int Coarseness() const { return coarseness_; }

  /// Of Gaussians that are trained on them.
  ParameterLimits Limits() const;

private:
  bool AddPlanes(const SecondStage& stage, double most, double after, std::shared_ptr<const Sweep>& images,
                 std::vector<int>& frames) const;
  void Upload();

  std::shared_ptr<const Sweep> sweep_;
  std::vector<int> recorded_;
  const TrainingPlan& plan_;
  Engine& engine_;
  Report& report_;
  std::shared_ptr<const Sweep> withVirtualPlanes_;  // as given
  std::shared_ptr<const Sweep> images_;
  std::vector<int> frames_;
  bool areFramesAlone_ = false;
  int coarseness_ = 1;
};

}  // namespace bigus
