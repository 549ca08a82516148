// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Planes at right angles to a sweep's frames, along the sweep: what nobody recorded, and what a field is for. There is no
// truth, but there is a limit: frames a gap d apart support nothing finer than a wave of 2 d along the sweep.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// A plane along the sweep. Pixels (i, j): i runs along a direction of the middle frame, j along its normal.
struct CrossPlane
{
  SlicePlane plane;
  std::vector<std::uint8_t> enclosed;  ///< [height][width], as by FindEnclosed
};

/// Through the middle frame of `frames`: `each` planes along its columns (axial) and then `each` along its rows
/// (lateral), evenly spread over the frame. Along i there is a pixel for every `stride` pixels of the frame, along j one
/// for every `step` mm. They reach as far along the middle frame's normal as the frames' centres, where a frame that is
/// further away than kBreak usual gaps for each frame between has no part: one that strays makes no planes of metres.
/// Of more than 16 rows for each frame those in the middle are made.
/// Throws Error for fewer than two frames, and unless the other numbers are positive.
std::vector<CrossPlane> MakeCrossPlanes(const Sweep& sweep, const std::vector<int>& frames, int each, double step,
                                        int stride = 1);

/// Power of pictures along j, as variance: a wave of amplitude a has a^2 / 2. Mean over all windows of 8 gaps (32 pixels,
/// stride 16, Hann's taper, mean removed) along j whose pixels are all enclosed. Between the two bands lies one frequency
/// that belongs to neither, because the taper spreads each over its neighbours.
struct PowerAlong
{
  double within = 0;  ///< below the frames' Nyquist frequency, 1 / (2 d); the mean has no part in it
  double beyond = 0;  ///< above it
};

/// Samples a gap of the frames; what is finer than half of that would be missed.
constexpr int kSamplesPerGap = 4;

/// A method's pictures of cross-planes beside linear interpolation between the frames (PredictPoseInterpolation), over
/// the same pixels.
struct CrossScores
{
  PowerAlong power, linear;
  double detail = 0;     ///< power.within / linear.within: below 1, the picture is blurred along the sweep
  double scratches = 0;  ///< power.beyond / linear.beyond: above 1, it has what frames cannot support
};

/// Scores methods on one sweep; the planes, what is enclosed and linear interpolation are made once.
class CrossPlaneScorer
{
public:
  /// Three axial and three lateral cross-planes of at most 128 columns, with kSamplesPerGap pixels to the median gap of
  /// `frames`. Of more than 400 frames those in the middle are looked at.
  CrossPlaneScorer(const Sweep& sweep, const std::vector<int>& training);

  /// `predict(plane, image)` is called for one plane after another. Nothing for sweeps of eight frames or fewer, and where
  /// linear interpolation is flat.
  std::optional<CrossScores> Score(const std::function<void(const SlicePlane&, float*)>& predict) const;

private:
  std::vector<CrossPlane> planes_;
  std::optional<PowerAlong> linear_;
};

}  // namespace bigus
