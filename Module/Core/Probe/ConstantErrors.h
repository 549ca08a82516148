// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Errors of tracking that are the same in every frame: the delay between image and tracker, and the error of the
// image-to-probe calibration. Estimated from how well frames that see the same place again agree.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <limits>
#include <string>
#include <vector>

#include "Core/Model/Sweep.h"

namespace bigus
{

struct ConstantError
{
  double value = 0;
  double standardError = 0;   ///< in the unit of the value; infinite where nothing tells of it
  bool isObservable = false;  ///< whether the pictures tell this number apart from the other six
};

/// A step from poses to others, such as those without a delay, and what frames that had no part in finding it say of it.
/// Where it is not asked for, as where a delay does not differ from 0, numbers are not numbers.
struct ConfirmedStep
{
  bool isAsked = false;
  double share = std::numeric_limits<double>::quiet_NaN();  ///< of the step that they confirm: 1 all of it, 0 nothing
  double shareError = std::numeric_limits<double>::quiet_NaN();  ///< standard error
  double gain = std::numeric_limits<double>::quiet_NaN();        ///< dB by which they agree better
  double bending = 0;    ///< mm by which the step moves frames against each other
  bool isTaken = false;  ///< whether the evidence is enough to change poses
};

/// What must be done to poses to be rid of the errors, as far as pictures tell. A number that cannot be told apart from
/// others is 0: on a straight path of constant speed a delay is the same as a shift along the image's normal, and both
/// are 0. Numbers of a step that is not taken are what was found; poses do not change by them.
struct ConstantErrors
{
  /// Seconds. A frame belongs where the recorded path is so much after the frame's own time: positive where poses lag
  /// behind pictures.
  ConstantError delay;
  /// The image's motion on the probe, in its own axes (along its rows, down, along its normal) and about its centre, as
  /// Moved takes it: the inverse of the calibration's error.
  std::array<ConstantError, 3> shift;     ///< mm
  std::array<ConstantError, 3> rotation;  ///< degrees, axis times angle

  ConfirmedStep delayStep, calibrationStep;
  int comparisons = 0;   ///< places that were compared
  std::string evidence;  ///< what was asked for and confirmed, or why nothing was; one sentence

  bool IsSignificant() const { return delayStep.isTaken || calibrationStep.isTaken; }  ///< whether poses change
};

/// Reads the pixels of `frames` (ascending) and of no other frame; the path is that of all frames. Tells the delay only
/// where the sweep has timestamps. Takes seconds. Same bits for any number of threads. Throws Error for a frame that is
/// not there.
ConstantErrors EstimateConstantErrors(const Sweep& sweep, const std::vector<int>& frames);

/// The numbers that are not 0 of steps that are taken, in words and with units.
std::string Describe(const ConstantErrors& errors);

/// The sweep's poses without these errors, for all frames; the very bits of the sweep where no step is taken.
std::vector<Eigen::Matrix4d> WithoutConstantErrors(const Sweep& sweep, const ConstantErrors& errors);

}  // namespace bigus
