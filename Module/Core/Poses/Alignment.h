// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Rigid alignment of a frame to a field: how far a frame's pose must move for the field to explain it best.
// Tells tracking error from modelling error, and refines poses in training.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <functional>

#include "Core/Engine/Engine.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// `plane` turned by `rotation` about its centre and then shifted by `translation`, both in the plane's own axes: along
/// its rows, across them in the plane, along its normal. translation in mm, rotation a rotation vector (axis times
/// angle) in degrees.
SlicePlane Moved(const SlicePlane& plane, const Eigen::Vector3d& translation, const Eigen::Vector3d& rotation);

struct AlignmentOptions
{
  double maximumTranslation = 2;  ///< mm, 0 to 1000: longest shift; 0 keeps the position
  double maximumRotation = 3;     ///< degrees, 0 to 45: largest angle; 0 keeps the orientation
  double translationPrior = 0;    ///< mm: standard deviation of the tracked position on each axis; 0: unknown
  double rotationPrior = 0;       ///< degrees: the same of the tracked orientation; 0: unknown
  int iterations = 8;             ///< Gauss-Newton steps at most, 0 to 1000; each takes about 13 renders
  int stride = 1;                 ///< compares every stride-th pixel of every stride-th row, 1 to 4096

  /// Throws Error naming the option, its value and its range.
  void Validate() const;
};

struct RigidAlignment
{
  SlicePlane plane;           ///< where the frame fits best; of the frame's full size
  double translation = 0;     ///< mm, length of the shift of the image's centre
  double rotation = 0;        ///< degrees
  double residualBefore = 0;  ///< root mean square difference of intensity at the tracked pose, lit pixels compared
  double residualAfter = 0;   ///< the same at `plane`; never larger
  int iterations = 0;         ///< Gauss-Newton steps taken
};

/// Aligns `frame` of the sweep to the field the engine holds, from its tracked pose; masked pixels do not count. The
/// result is a local optimum: it is reached from displacements of about the size of a speckle. A frame without
/// contrast, or without a visible Gaussian, stays where it is. Results are the same for every number of threads. Throws
/// Error for options out of range or a frame that is not there.
RigidAlignment AlignFrame(Engine& engine, const Sweep& sweep, int frame, const AlignmentOptions& options = {});

/// The same for any image that `render(plane, image)` can predict: plane.NumberOfPixels() intensities, row by row.
/// `image` lies at `plane`; where `mask` (null: none) is 0 it does not count. `render` must be repeatable.
RigidAlignment AlignImage(const std::function<void(const SlicePlane&, float*)>& render, const float* image,
                          const std::uint8_t* mask, const SlicePlane& plane, const AlignmentOptions& options = {});

}  // namespace bigus
