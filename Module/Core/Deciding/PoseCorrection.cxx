// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Deciding/PoseCorrection.h"

#include "Core/Deciding/DecisionRules.h"
#include "Core/Deciding/Format.h"
#include "Core/Training/Stopwatch.h"

namespace bigus
{

PoseCorrection CorrectPoses(const Sweep& sweep, const std::vector<int>& /*frames*/,
                            const PoseCorrectionOptions& options)
{
  const Stopwatch watch;
  PoseCorrection correction;
  correction.strength = options.strength.value_or(0);
  TrajectoryOptions smoothing;
  smoothing.strength = correction.strength;
  correction.trajectory = SmoothTrajectory(sweep, smoothing);
  correction.decision = {"poses", correction.trajectory.IsChanged() ? "smoothed" : "as tracked",
                         options.strength ? "given" : "", watch.Seconds()};
  return correction;
}

Sweep AtCorrectedPoses(const Sweep& sweep, const PoseCorrection& correction)
{
  Sweep corrected = sweep;
  corrected.imageToReference = correction.trajectory.imageToReference;
  return corrected;
}

}  // namespace bigus
