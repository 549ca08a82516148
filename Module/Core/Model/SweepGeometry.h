// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How far the planes of a sweep lie apart, and how large its pixels are.
#pragma once

#include <vector>

#include "Core/Model/Sweep.h"

namespace bigus
{

/// What the seeder and the trainer's defaults derive from a sweep's geometry, all mm.
struct SweepGeometry
{
  double pixelSize = 0;  ///< geometric mean of the pixel sides; of several sequences the smallest
  /// Between neighbouring planes of a sequence, as GapsBetween measures: the median of the gaps. Where the probe
  /// lingered, most gaps are short and tell little of the sweep, so that it is the median along the path (half of the
  /// path, breaks left out, lies in shorter gaps) if that is more than three times as long.
  double usualSpacing = 0;
  double smallestSpacing = 0;
  double largestSpacing = 0;
};
SweepGeometry MeasureGeometry(const Sweep& sweep, const std::vector<int>& frames);

/// How far frames[k + 1] lies from frames[k] along the latter's normal, mm: at the image's centre. A probe that turns about
/// that moves elsewhere, so that of a sequence whose centres hardly move it is the mean over the image. [frames - 1]
std::vector<double> GapsBetween(const Sweep& sweep, const std::vector<int>& frames);

/// The way that the image's centre goes along the frames, mm; the mean over the image where that turns about its centre.
double PathLength(const Sweep& sweep, const std::vector<int>& frames);

/// Of steps of a probe, in their order, the one that is usual as `usualSpacing` says; 0 of none.
double UsualStep(const std::vector<double>& steps);

/// What is usual around step k: the longer of the medians of the five steps before it and of the five after it; of fewer
/// than three steps 0. A part of a sweep that is faster than the rest is usual there.
double UsualAround(const std::vector<double>& steps, std::size_t k);

/// Frames further apart than this many usual gaps belong to different strokes of the probe: nothing is known of what lies
/// between them, so it gets neither seeds nor virtual planes.
constexpr double kBreak = 4.0;

/// From frames[k] to frames[k + 1], measured as `usualSpacing` is, the longest gap that is no break, mm: kBreak times what is
/// usual in the sweep, or around k if that is longer. Negative at the end of a sequence. [frames - 1]
std::vector<double> LongestGaps(const Sweep& sweep, const std::vector<int>& frames);

/// Distance along the normal of frame `from` between its pixel (i, j) and the same pixel of frame `to`, mm.
double GapBetween(const Sweep& sweep, int from, int to, double i, double j);

/// Normals of the frames' planes that stand for all. Every frame has one of them within 5 degrees (a plane's two sides
/// are the same), and no two of them are that near to each other.
std::vector<Eigen::Vector3d> DistinctNormals(const Sweep& sweep, const std::vector<int>& frames);

/// True for the slices of a volume: planes of one orientation, one exactly above another (to 1e-4 of the distance). Some
/// may be missing. Needs three frames.
bool IsVolume(const Sweep& sweep, const std::vector<int>& frames);

/// True where space is seen from more than one side. At least half of the frames (24 are looked at) meet another within
/// both images, at 30 degrees or more.
bool FramesCross(const Sweep& sweep, const std::vector<int>& frames);

}  // namespace bigus
