// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/PhantomOptions.h"

#include <string>

#include "Core/Model/Error.h"

namespace bigus
{

namespace
{

std::string Text(double value)
{
  std::string text = std::to_string(value);
  text.erase(text.find_last_not_of('0') + 1);
  return text.back() == '.' ? text.substr(0, text.size() - 1) : text;
}

void Check(const char* name, double value, double low, double high, const char* unit)
{
  if (!(value >= low && value <= high))
  {
    throw Error("phantom: " + std::string(name) + " is " + Text(value) + "; it must lie between " + Text(low) +
                " and " + Text(high) + unit + ".");
  }
}

}  // namespace

void PhantomOptions::Validate() const
{
  Check("scene", static_cast<int>(scene), 0, 2, "");
  Check("probe", static_cast<int>(probe), 0, 2, "");
  Check("seed", static_cast<double>(seed), 0, 9007199254740992.0, "");  // 2^53: every whole number up to it is a double
  Check("frames", frames, 1, 100000, "");
  if (width != 0)
  {
    Check("width", width, 8, 8192, " pixels (or 0 for the probe's default)");
  }
  Check("height", height, 8, 8192, " pixels");
  Check("pixelSize", pixelSize, 0.01, 5, " mm");
  if (probe != ProbeKind::Linear && probeRadius != 0)
  {
    Check("probeRadius", probeRadius, 2, 500, " mm (or 0 for the probe's default)");
  }
  if (probe != ProbeKind::Linear && halfAngle != 0)
  {
    Check("halfAngle", halfAngle, 1, 80, " degrees (or 0 for the probe's default)");
  }
  Check("frequency", frequency, 0.5, 50, " MHz");
  Check("axialSigma", axialSigma, 0.02, 5, " mm");
  Check("lateralSigma", lateralSigma, 0.02, 5, " mm");
  Check("elevationSigma", elevationSigma, 0.05, 10, " mm");
  Check("scattererDensity", scattererDensity, 1, 1000, " per cubic millimetre");
  Check("attenuation", attenuation, 0, 3, " dB / (cm MHz)");
  Check("dynamicRange", dynamicRange, 10, 120, " dB");
  Check("whiteLevel", whiteLevel, -40, 100, " dB");
  Check("frameSpacing", frameSpacing, 0, 20, " mm");
  Check("speedVariation", speedVariation, 0, 0.95, "");
  Check("tilt", tilt, 0, 45, " degrees");
  Check("wander", wander, 0, 20, " mm");
  Check("sweepAngle", sweepAngle, -360, 360, " degrees");
  Check("passes", passes, 1, 100, "");
  Check("shake", shake, 0, 10, " mm");
  Check("shakeRotation", shakeRotation, 0, 20, " degrees");
  Check("shakeCorrelation", shakeCorrelation, 0, 1000, " pictures");
  Check("frameRate", frameRate, 0.1, 10000, " frames a second");
  Check("droppedShare", droppedShare, 0, 0.9, "");
  Check("trackingNoise", trackingNoise, 0, 10, " mm");
  Check("trackingRotationNoise", trackingRotationNoise, 0, 20, " degrees");
  Check("noiseCorrelation", noiseCorrelation, 0, 1000, " frames");
  Check("trackingDrift", trackingDrift, 0, 100, " mm");
  Check("trackingRotationDrift", trackingRotationDrift, 0, 20, " degrees");
  Check("outlierShare", outlierShare, 0, 0.5, "");
  Check("outlierSize", outlierSize, 0, 100, " mm");
  Check("trackingDelay", trackingDelay, -1, 1, " seconds");
  Check("trackingQuantum", trackingQuantum, 0, 10, " mm");
  Check("trackingRotationQuantum", trackingRotationQuantum, 0, 20, " degrees");
  for (int axis = 0; axis < 3; ++axis)
  {
    Check("calibrationShift", calibrationShift[axis], -100, 100, " mm");
    Check("calibrationRotation", calibrationRotation[axis], -45, 45, " degrees");
  }
}

}  // namespace bigus
