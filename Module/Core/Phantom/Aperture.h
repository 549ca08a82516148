// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The probe that a plane carries with it: which points it lights, and the grid of lines on which echoes are summed.
#pragma once

#include <Eigen/Dense>
#include <cmath>

#include "Core/Model/SlicePlane.h"
#include "Core/Phantom/PhantomOptions.h"

namespace bigus
{

constexpr double kReach = 4;         // profiles are cut this many standard deviations out (amplitude 3e-4)
constexpr double kOversampling = 3;  // beam grid samples per standard deviation

/// Beam coordinates of a plane's point: range along the line and the line itself (mm sideways, or radian in a fan).
struct BeamPoint
{
  double range, line;
};

/// Where a plane's probe stands, what it lights, and the grid of lines and ranges on which echoes are summed.
struct Aperture
{
  Eigen::Vector3d face;                       // middle of the first row, mm
  Eigen::Vector3d lateral, axial, elevation;  // unit
  double pixelWidth, pixelHeight, centreColumn;
  int width, height;

  bool fan;
  double apex;                   // distance of the apex above the first row, mm; 0 for a linear probe
  double firstRange, lastRange;  // lit, mm
  double lastLine;               // lit to both sides, mm or radian

  double lineStep, rangeStep;                                  // of the grid
  double gridLine, gridRange;                                  // first line and range of the grid
  int lines, ranges;                                           // size of the grid
  int firstLitLine, firstLitRange, lastLitLine, lastLitRange;  // grid indices around what is lit

  Aperture(const PhantomOptions& options, const SlicePlane& plane);

  BeamPoint ToBeam(double x, double y) const
  {
    return fan ? BeamPoint{std::sqrt(x * x + (y + apex) * (y + apex)), std::atan2(x, y + apex)} : BeamPoint{y, x};
  }
  double MillimetresPerLine(double range) const { return fan ? range * lineStep : lineStep; }
  bool IsLit(const BeamPoint& p) const
  {
    const double slack = 1e-9;
    return !fan ||
           (p.range >= firstRange - slack && p.range <= lastRange + slack && std::abs(p.line) <= lastLine + slack);
  }
  BeamPoint PixelToBeam(int i, int j) const { return ToBeam((i - centreColumn) * pixelWidth, j * pixelHeight); }

  /// World position of a point of the beam, `z` mm out of the plane.
  Eigen::Vector3d ToWorld(const BeamPoint& p, double z) const
  {
    const double x = fan ? p.range * std::sin(p.line) : p.line;
    const double y = fan ? p.range * std::cos(p.line) - apex : p.range;
    return face + x * lateral + y * axial + z * elevation;
  }
};

}  // namespace bigus
