// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The picture between two recorded frames, guessed from them: what virtual planes are made of.
#pragma once

#include <string>
#include <vector>

#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// How two frames meet in a plane between them.
struct FrameInterpolation
{
  /// Which points of the two frames belong together.
  enum class Path
  {
    Normals,  ///< those on a line along the frames' mean normal: trusts the tracked poses
    Probe     ///< those of the same pixel: trusts the smoothness of the probe's path more than its poses
  };
  Path path = Path::Normals;
  /// Structures that run obliquely through both frames are moved to the plane by optical flow (Farneback 2003); the
  /// picture is averaged with the one without it.
  bool flow = false;
  /// Every band keeps the power it has in the frames, as speckle in a real frame does. The best estimate is smoother,
  /// so this has larger error and truer texture.
  bool keepContrast = false;

  /// Reads "normals", "normals+flow", "probe" or "probe+flow", and ToString writes it. Throws Error with the names for
  /// any other.
  static FrameInterpolation Parse(const std::string& name);
  std::string ToString() const;
};

/// The plane a share (0 to 1) of the way from one plane to another: centre and pixel steps linearly, rotation by slerp;
/// a calibration with shear keeps it.
SlicePlane PlaneBetween(const SlicePlane& from, const SlicePlane& to, double share);

/// The picture at `plane`, which lies a share of the way from frame `a` to frame `b` of the sweep. Both are sampled
/// bicubically and mixed band by band (four octaves). Speckle that the two do not share is noise to the plane between
/// them, so each band gets the best linear estimate under the correlation rho found between the frames in a window
/// around the pixel. The correlation with a plane a share s away is taken as rho^(s^1.5), between an exponential's
/// exponent, 1, and a Gaussian's, 2. `image` gets plane.NumberOfPixels() values in [0, 1]; the plane is of the frames'
/// size.
void InterpolateFrames(const Sweep& sweep, int a, int b, const SlicePlane& plane, double share,
                       const FrameInterpolation& interpolation, float* image);

/// How well `interpolation` predicts frames (at most 12, evenly chosen) from their neighbours among `frames`: mean
/// PSNR, dB. Needs three frames; throws Error with fewer.
double ScoreInterpolation(const Sweep& sweep, const std::vector<int>& frames, const FrameInterpolation& interpolation);

}  // namespace bigus
