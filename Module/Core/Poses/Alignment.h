// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Rigid alignment of a frame to a field: how far a frame's pose must move for the field to explain it best. It tells
// tracking error from modelling error.
#pragma once

#include <Eigen/Dense>

#include "Core/Engine/Engine.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// `plane` turned by `rotation` about its centre and then shifted by `translation`, both in the plane's own axes: along
/// its rows, across them in the plane, along its normal. translation in mm, rotation a rotation vector (axis times
/// angle) in degrees.
SlicePlane Moved(const SlicePlane& plane, const Eigen::Vector3d& translation, const Eigen::Vector3d& rotation);

struct RigidAlignment
{
  SlicePlane plane;  ///< where the frame fits best, never worse than at its tracked pose; of the frame's full size
  double translation = 0;  ///< mm, length of the shift of the image's centre
  double rotation = 0;     ///< degrees
};

/// Moves `frame` of the sweep to where the field that the engine holds explains it best, from its tracked pose by at most
/// 2 mm and 3 degrees; masked pixels do not count. The result is a local optimum: it is reached from displacements of
/// about the size of a speckle. A frame without contrast, or without a visible Gaussian, stays where it is. Results are
/// the same for every number of threads. Throws Error for a frame that is not there.
RigidAlignment AlignFrame(Engine& engine, const Sweep& sweep, int frame);

}  // namespace bigus
