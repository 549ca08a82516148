// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/Aperture.h"

#include <algorithm>
#include <cstddef>
#include <string>

#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"

namespace bigus
{

namespace
{

void RequireRightAngles(const SlicePlane& plane)
{
  plane.Validate("phantom plane");
  if (std::abs(plane.columnStep.dot(plane.rowStep)) > 1e-4 * plane.columnStep.norm() * plane.rowStep.norm())
  {
    throw Error(
        "phantom plane: rows and columns are not orthogonal; beams run along the rows' step, so a sheared "
        "plane has no probe that could see it.");
  }
}

/// That the image can be simulated: echo samples and scatterers as they are expected, in double since they may be too many.
void RequireSmall(const SlicePlane& plane, double samples, double scatterers)
{
  Require(plane.NumberOfPixels() <= (std::size_t(1) << 28) && samples <= std::ldexp(1.0, 26) &&
              scatterers <= std::ldexp(1.0, 30),
          "phantom plane: ", plane.width, " x ", plane.height, " pixels of ", plane.columnStep.norm(), " x ",
          plane.rowStep.norm(),
          " mm are too large an image to simulate (at most 2^28 pixels, 2^26 echo samples and 2^30 "
          "scatterers); ask for a smaller plane.");
}

}  // namespace

Aperture::Aperture(const PhantomOptions& options, const SlicePlane& plane)
{
  RequireRightAngles(plane);
  const double a = plane.columnStep.norm(), b = plane.rowStep.norm();
  axial = plane.rowStep / b;
  elevation = plane.Normal();
  lateral = axial.cross(elevation);
  width = plane.width;
  height = plane.height;
  pixelWidth = a;
  pixelHeight = b;
  centreColumn = 0.5 * (width - 1);
  face = plane.origin + centreColumn * plane.columnStep;

  fan = options.probe != ProbeKind::Linear;
  double margin = kReach * options.lateralSigma;
  if (fan)
  {
    const double halfAngle = options.halfAngle * kPi / 180;
    apex = options.probeRadius * std::cos(halfAngle);
    firstRange = options.probeRadius;
    lastRange = apex + (options.height - 1) * options.pixelSize;
    lastRange = std::max(lastRange, firstRange);
    lastLine = halfAngle;
    lineStep = options.lateralSigma / kOversampling / lastRange;
    margin = std::min(margin / firstRange, 3.1 - halfAngle);
  }
  else
  {
    apex = 0;
    firstRange = 0;
    lastRange = (height - 1) * pixelHeight;
    lastLine = centreColumn * pixelWidth;
    lineStep = options.lateralSigma / kOversampling;
  }
  rangeStep = options.axialSigma / kOversampling;

  const double half = std::ceil((lastLine + margin) / lineStep);
  const double padding = std::ceil(kReach * kOversampling);
  const double deep = std::ceil((lastRange - firstRange) / rangeStep) + 1;
  const double samples = (2 * half + 1) * (deep + 2 * padding);
  const double area = (lastRange - firstRange + 2 * kReach * options.axialSigma) *
                      ((fan ? 2 * lastLine * lastRange : 2 * lastLine) + 2 * kReach * options.lateralSigma);
  const double scatterers = area * 2 * kReach * options.elevationSigma * options.scattererDensity;
  RequireSmall(plane, samples, scatterers);
  Require(face.cwiseAbs().maxCoeff() <= 1e6,
          "phantom plane: it lies more than 1e6 mm from the phantom's origin; are the pose's units mm?");
  lines = static_cast<int>(2 * half) + 1;
  ranges = static_cast<int>(deep + 2 * padding) + 1;
  gridLine = -half * lineStep;
  gridRange = firstRange - padding * rangeStep;
  firstLitLine = std::max(0, static_cast<int>(half - std::ceil(lastLine / lineStep)) - 1);
  lastLitLine = lines - 1 - firstLitLine;
  firstLitRange = static_cast<int>(padding);
  lastLitRange = static_cast<int>(padding + deep);
}

}  // namespace bigus
