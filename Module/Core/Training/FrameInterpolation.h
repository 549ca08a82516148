// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The picture between two recorded frames, guessed from them: what virtual planes are made of.
#pragma once

#include <functional>
#include <optional>
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
  /// How fast what frames show changes with the distance between them.
  enum class Decay
  {
    Rough,   ///< correlation falls as exp(-d): every frame brings speckle of its own
    Medium,  ///< as exp(-d^1.5)
    Smooth   ///< as exp(-d^1.9), almost a Gaussian: frames lie closer than the beam is thick
  };
  Path path = Path::Normals;
  /// Structures that run obliquely through the frames are moved to the plane by optical flow. The picture is the mean
  /// of those with Farneback's flow (2003), with that of dense inverse search (Kroeger 2016), and without flow.
  bool flow = false;
  Decay decay = Decay::Medium;
  /// Every band keeps the power it has in the frames, as speckle in a real frame does. The best estimate is smoother,
  /// so this has larger error and truer texture.
  bool keepContrast = false;

  /// Reads "normals" or "probe", followed by "+flow" or not and by "+rough", "+smooth" or neither, and ToString writes
  /// it. Throws Error with the names for any other.
  static FrameInterpolation Parse(const std::string& name);
  std::string ToString() const;
};

/// The plane a share (0 to 1) of the way from one plane to another: centre and pixel steps linearly, rotation by slerp;
/// a calibration with shear keeps it.
SlicePlane PlaneBetween(const SlicePlane& from, const SlicePlane& to, double share);

/// The frames of a sweep around a plane.
struct FramesAround
{
  static constexpr int kNone = -1;
  int before = kNone;         ///< the frame before `first`, or none
  int first = 0, second = 0;  ///< the plane lies between these
  int after = kNone;          ///< the frame after `second`, or none

  /// Those around the gap between frames[gap] and frames[gap + 1], of the sequence that frames[gap] is of.
  static FramesAround Gap(const Sweep& sweep, const std::vector<int>& frames, std::size_t gap);
};

/// A plane of the frames' size, a share (0 to 1) of the way from the first to the second frame.
struct PlaneInGap
{
  SlicePlane plane;
  double share;
};

/// The pictures at planes between the first and the second frame. Frames are sampled
/// bicubically and mixed band by band (four octaves). Speckle that they do not share is noise to the plane between
/// them, so each band gets the best linear estimate (simple kriging) under the correlation rho found between the inner
/// two in a window around the pixel. Frames a share d of their distance apart count as correlated by rho^(d^e), e by
/// `decay`. Optical flow is found once, at the middle one of the planes. Each of `images` gets plane.NumberOfPixels() values
/// in [0, 1].
void InterpolateFrames(const Sweep& sweep, const FramesAround& around, const std::vector<PlaneInGap>& planes,
                       const FrameInterpolation& interpolation, const std::vector<float*>& images);

/// How well `interpolation` predicts frames (at most 12, evenly chosen) from their neighbours among `frames`: mean
/// PSNR, dB. Needs three frames of a sequence; throws Error with fewer. Null when `goOn` (may be empty), asked every few frames, says
/// stop.
std::optional<double> ScoreInterpolation(const Sweep& sweep, const std::vector<int>& frames,
                                         const FrameInterpolation& interpolation,
                                         const std::function<bool()>& goOn = {});

}  // namespace bigus
