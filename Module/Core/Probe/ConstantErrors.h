// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Errors of tracking that are the same in every frame: the delay between image and tracker, and the error of the
// image-to-probe calibration. Estimated from how well frames that see the same place again agree.
#pragma once

#include <Eigen/Dense>
#include <array>
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

/// What must be done to poses to be rid of the errors, as far as pictures tell. A number that cannot be told apart from
/// others is 0: on a straight path of constant speed a delay is the same as a shift along the image's normal, and both
/// are 0.
struct ConstantErrors
{
  /// Seconds. A frame belongs where the recorded path is so much after the frame's own time: positive where poses lag
  /// behind pictures.
  ConstantError delay;
  /// The image's motion on the probe, in its own axes (along its rows, down, along its normal) and about its centre, as
  /// Moved takes it: the inverse of the calibration's error.
  std::array<ConstantError, 3> shift;     ///< mm
  std::array<ConstantError, 3> rotation;  ///< degrees, axis times angle

  int comparisons = 0;          ///< places that were compared
  double differenceBefore = 0;  ///< root mean square difference of smoothed intensities there, at the given poses
  double differenceAfter = 0;   ///< the same without these errors; each half of the frames by what the other half says
  bool isSignificant = false;   ///< whether the evidence is enough to change poses
  std::string evidence;         ///< why, or why not; one sentence
};

/// Reads the pixels of `frames` (ascending) and of no other frame; the path is that of all frames. Tells the delay only
/// where the sweep has timestamps. Takes seconds. Same bits for any number of threads. Throws Error for a frame that is
/// not there.
ConstantErrors EstimateConstantErrors(const Sweep& sweep, const std::vector<int>& frames);

/// The numbers that are not 0, in words and with units.
std::string Describe(const ConstantErrors& errors);

/// The sweep's poses without these errors, for all frames; the very bits of the sweep where they are not significant.
std::vector<Eigen::Matrix4d> WithoutConstantErrors(const Sweep& sweep, const ConstantErrors& errors);

}  // namespace bigus
