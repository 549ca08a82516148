// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a correction of poses found, in arrays by their names in VTK's data: VTK's filter and Python take them from here.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "Core/Deciding/PoseCorrection.h"

namespace bigus
{

struct NamedNumbers
{
  const char* name;
  std::vector<const char*> components;
  std::vector<double> values;  ///< [tuples][components]
};

/// The tracker's noise (mm, degrees, mm at the image's corners); of the delay, the calibration's shifts and rotations the
/// estimate, its standard error, and whether pictures tell it; of the delay, the calibration and the alignment of frames to
/// each other, what frames that had no part say of it, NaN where not asked; and the strength.
inline std::vector<NamedNumbers> NumbersOf(const PoseCorrection& found)
{
  const ConstantErrors& constant = found.constant;
  const auto &shift = constant.shift, &rotation = constant.rotation;
  const std::array<ConstantError, 7> errors = {constant.delay, shift[0],    shift[1],   shift[2],
                                               rotation[0],    rotation[1], rotation[2]};
  std::vector<double> estimates(3 * errors.size()), steps;
  for (std::size_t k = 0; k < errors.size(); ++k)
  {
    estimates[k] = errors[k].value;
    estimates[errors.size() + k] = errors[k].standardError;
    estimates[2 * errors.size() + k] = errors[k].isObservable ? 1 : 0;
  }
  for (const ConfirmedStep* step : {&constant.delayStep, &constant.calibrationStep, &found.alignment})
  {
    steps.insert(steps.end(), {step->share, step->shareError, step->gain, step->isTaken ? 1.0 : 0.0});
  }
  const Trajectory& path = found.trajectory;
  return {{"ConstantErrors",
           {"Delay", "ShiftX", "ShiftY", "ShiftZ", "RotationX", "RotationY", "RotationZ"},
           std::move(estimates)},
          {"ConfirmedSteps", {"Share", "ShareError", "Gain", "Taken"}, std::move(steps)},
          {"TrackerNoise",
           {"Translation", "Rotation", "Corner"},
           {path.translationNoise, path.rotationNoise, path.cornerNoise}},
          {"PoseStrength", {""}, {found.strength}}};
}

}  // namespace bigus
