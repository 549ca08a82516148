// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/PhantomOptions.h"

#include <string>

#include "Core/Model/Error.h"

namespace bigus
{

void PhantomOptions::Validate() const
{
  const auto check = [](const char* name, double value, double low, double high, const char* unit)
  {
    if (!(value >= low && value <= high))
    {
      const auto text = [](double v)
      {
        std::string s = std::to_string(v);
        s.erase(s.find_last_not_of('0') + 1);
        return s.back() == '.' ? s.substr(0, s.size() - 1) : s;
      };
      throw Error("phantom: " + std::string(name) + " is " + text(value) + "; it must lie between " + text(low) +
                  " and " + text(high) + unit + ".");
    }
  };
  check("scene", static_cast<int>(scene), 0, 2, "");
  check("probe", static_cast<int>(probe), 0, 2, "");
  check("seed", static_cast<double>(seed), 0, 9007199254740992.0, "");  // 2^53: every whole number up to it is a double
  check("frames", frames, 1, 100000, "");
  if (width != 0)
  {
    check("width", width, 8, 8192, " pixels (or 0 for the probe's default)");
  }
  check("height", height, 8, 8192, " pixels");
  check("pixelSize", pixelSize, 0.01, 5, " mm");
  if (probe != ProbeKind::Linear && probeRadius != 0)
  {
    check("probeRadius", probeRadius, 2, 500, " mm (or 0 for the probe's default)");
  }
  if (probe != ProbeKind::Linear && halfAngle != 0)
  {
    check("halfAngle", halfAngle, 1, 80, " degrees (or 0 for the probe's default)");
  }
  check("frequency", frequency, 0.5, 50, " MHz");
  check("axialSigma", axialSigma, 0.02, 5, " mm");
  check("lateralSigma", lateralSigma, 0.02, 5, " mm");
  check("elevationSigma", elevationSigma, 0.05, 10, " mm");
  check("scattererDensity", scattererDensity, 1, 1000, " per cubic millimetre");
  check("attenuation", attenuation, 0, 3, " dB / (cm MHz)");
  check("dynamicRange", dynamicRange, 10, 120, " dB");
  check("whiteLevel", whiteLevel, -40, 100, " dB");
  check("frameSpacing", frameSpacing, 0, 20, " mm");
  check("speedVariation", speedVariation, 0, 0.95, "");
  check("tilt", tilt, 0, 45, " degrees");
  check("wander", wander, 0, 20, " mm");
  check("sweepAngle", sweepAngle, -360, 360, " degrees");
  check("passes", passes, 1, 100, "");
  check("frameRate", frameRate, 0.1, 10000, " frames a second");
  check("droppedShare", droppedShare, 0, 0.9, "");
  check("trackingNoise", trackingNoise, 0, 10, " mm");
  check("trackingRotationNoise", trackingRotationNoise, 0, 20, " degrees");
  check("trackingDrift", trackingDrift, 0, 100, " mm");
  check("trackingRotationDrift", trackingRotationDrift, 0, 20, " degrees");
  check("outlierShare", outlierShare, 0, 0.5, "");
  check("outlierSize", outlierSize, 0, 100, " mm");
  check("trackingDelay", trackingDelay, -1, 1, " seconds");
  check("trackingQuantum", trackingQuantum, 0, 10, " mm");
  check("trackingRotationQuantum", trackingRotationQuantum, 0, 20, " degrees");
  for (int axis = 0; axis < 3; ++axis)
  {
    check("calibrationShift", calibrationShift[axis], -100, 100, " mm");
    check("calibrationRotation", calibrationRotation[axis], -45, 45, " degrees");
  }
}

}  // namespace bigus
