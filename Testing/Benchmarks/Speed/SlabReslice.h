// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a pipeline uses today for a slice of some thickness: voxels, and vtkImageSlabReslice through them.
#pragma once

#include "Console.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"
#include "vtkImageSlabReslice.h"
#include "vtkSmartPointer.h"

class vtkImageData;

namespace bigus::bench
{

/// S of the field itself (no beam) as float voxels of a workload pixel's side, over a box (pixels) around the
/// origin. Throws Interrupted.
vtkSmartPointer<vtkImageData> SampleField(GaussianField field, const Eigen::Vector3d& box, command::Console& console);

/// The mean of 9 linear samples across a slab whose variance is the beam's, at the plane's pixels; one
/// thread.
vtkSmartPointer<vtkImageSlabReslice> NewSlabReslice(vtkImageData* volume, const SlicePlane& plane,
                                                    double elevationSigma);

}  // namespace bigus::bench
