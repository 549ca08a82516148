// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What one can do without a field: plain ways to predict a plane from other tracked frames.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cstdint>
#include <vector>

#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// Each predictor sees only the `training` frames of the sweep (indices in ascending order, at least one) and writes an
/// intensity in [0, 1] for every pixel of the plane, row by row. Errors are thrown as bigus::Error.

/// The training frame that lies nearest, pixel for pixel: the plane must be of the frames' size. Nearest is the root
/// mean square distance, mm, between the corners of the two images; of equals the first.
void PredictNearest(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane, float* image);

/// Mean of the training frames before and after index `frame` in its sequence, pixel for pixel (poses ignored). At an
/// end of the sequence the single neighbour.
void PredictNeighbourAverage(const Sweep& sweep, const std::vector<int>& training, int frame, float* image);

/// How a frame is sampled between its pixels. Outside of it the edge's pixels repeat.
enum class PixelInterpolation
{
  Linear,  ///< bilinear
  Cubic    ///< bicubic convolution with Keys' kernel, a = -1/2 (Catmull-Rom), clamped to [0, 1]
};

/// Pose-aware interpolation between the training frames before and after index `frame` in its sequence (at an end, the
/// one there is): from every pixel's point a line along the mean of their normals meets both planes; the frames are
/// sampled there and mixed linearly, each weighing as much as the point's distance from the other. Where the line
/// misses one of the images (by more than half a pixel) the other is taken, where it misses both 0.
void PredictPoseInterpolation(const Sweep& sweep, const std::vector<int>& training, int frame, float* image,
                              PixelInterpolation sampling = PixelInterpolation::Linear);

/// The same at any plane, which has no place in the sequence: for every pixel, of the consecutive training frames of
/// one sequence that have its point between them, the two with the smallest sum of distances. A point between none takes the sample of
/// the nearest plane it projects onto at right angles, if any.
void PredictPoseInterpolation(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane,
                              float* image, PixelInterpolation sampling = PixelInterpolation::Linear);

/// By how many pixels what a training frame shows lies elsewhere on the next one than the mean of their normals leads to. In a
/// box of the frame; outside of it as at the box's rim, and nowhere where it is empty.
struct PixelMoves
{
  int column = 0, row = 0, width = 0, height = 0;
  std::vector<float> moves;  ///< [height][width][2] along columns and rows

  /// There must be some.
  Eigen::Vector2d At(int i, int j) const
  {
    i = std::clamp(i - column, 0, width - 1);
    j = std::clamp(j - row, 0, height - 1);
    return Eigen::Map<const Eigen::Vector2f>(&moves[2 * (static_cast<std::size_t>(j) * width + i)]).cast<double>();
  }
};

/// Cubic in all three directions: two training frames on each side of index `frame`, sampled by bicubic convolution
/// where the line along the mean of the middle two's normals meets them, and between those two the cubic whose slope at
/// either is that of the parabola through it and its neighbours (evenly spaced: Catmull-Rom); clamped to [0, 1]. Where
/// an outer frame is missing, the line does not meet it, or the four planes do not follow each other along the line,
/// the slope is that between the middle two; where a middle one is missing, as PredictPoseInterpolation.
void PredictCubicInterpolation(const Sweep& sweep, const std::vector<int>& training, int frame, float* image);

/// The same at any plane: for every pixel the two frames that PredictPoseInterpolation at any plane chooses, and those
/// before and after them in `training`. A point between no two frames gets what PredictPoseInterpolation gives.
void PredictCubicInterpolation(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane,
                               float* image);

/// At points, mm, bilinear on the frames and between them the same cubic, along lines on which what lies there goes evenly
/// from where it is on one frame to where it is on the other: `moves` of each training frame but the last.
std::vector<float> PoseInterpolationAt(const Sweep& sweep, const std::vector<int>& training,
                                       const std::vector<Eigen::Vector3d>& points,
                                       const std::vector<PixelMoves>& moves);

/// What the training frames enclose: 1 for each pixel of the plane that lies between two consecutive frames, with both
/// feet of the line along the mean of their normals within the images' outermost pixel centres and lit; else 0. There a plane is predicted from
/// what was seen on both sides of it, so there methods can be compared.
void FindEnclosed(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane,
                  std::uint8_t* enclosed);

}  // namespace bigus
