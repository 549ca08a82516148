// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Whether and how strongly the tracker's noise is taken out of a sweep's poses, by how well frames predict their
// neighbours at the changed poses. Needs no training.
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "Core/Deciding/Decision.h"
#include "Core/Model/Sweep.h"
#include "Core/Poses/Trajectory.h"
#include "Core/Probe/ConstantErrors.h"

namespace bigus
{

struct PoseCorrectionOptions
{
  /// As TrajectoryOptions::strength; empty: chosen by evidence, and 0 where there is none. A given 0 keeps every pose,
  /// bit for bit: nor are constant errors looked for.
  std::optional<double> strength;
  /// Whether frames are aligned to others where evidence says so; not with a strength of 0.
  bool isRefined = true;
};

/// From one strength to another, and what pictures say of it (PoseCorrection.md).
struct PoseStep
{
  double from = 0, to = 0;  ///< strengths; 0: as recorded
  double share = 0,
         shareError = 0;           ///< of what the step changes in poses, that pictures confirm, and its standard error
  double gain = 0, gainError = 0;  ///< dB by which neighbours are predicted better
  bool isTaken = false;
  /// The share that frames of other times at the same places confirm, and its standard error; NaN where fewer than 8 do.
  double revisitShare = std::numeric_limits<double>::quiet_NaN();
  double revisitError = std::numeric_limits<double>::quiet_NaN();
};

struct PoseCorrection
{
  Trajectory trajectory;        ///< corrected poses of all frames, and what is known of the tracker
  double strength = 0;          ///< that was chosen; 0: no noise is taken out
  std::vector<PoseStep> steps;  ///< that were asked for, in this order; none where a strength is given
  ConstantErrors constant;  ///< delay and calibration error, found at poses without noise; taken out where significant
  ConfirmedStep alignment;  ///< of frames to each other; asked for where the probe comes back
  Decision decision;        ///< the choice, what it rests on, and seconds
  bool aborted = false;     ///< `progress` said stop; every pose is the recorded one

  /// Nothing was smoothed, but pictures do not refuse the first step by two standard errors.
  bool IsUndecided() const;
};

/// Corrects the poses of all frames of the sweep. Of pixels only those of `frames` are looked at; other frames go
/// through the trajectory by their poses alone. With fewer than 8 `frames` there is no evidence, and poses are kept
/// unless a strength is given. The same for every number of threads. Throws Error as SmoothTrajectory does.
/// `progress` (may be empty) is called with a number from 0 to 1 before each strength is compared, and before constant
/// errors are looked for; returning false stops the work.
PoseCorrection CorrectPoses(const Sweep& sweep, const std::vector<int>& frames,
                            const PoseCorrectionOptions& options = {},
                            const std::function<bool(double)>& progress = {});

/// The sweep at the corrected poses, pixels shared.
Sweep AtCorrectedPoses(const Sweep& sweep, const PoseCorrection& correction);

}  // namespace bigus
