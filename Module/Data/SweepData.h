// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Sweeps between VTK and Core: the one place that knows which arrays a sweep is made of.
#pragma once

#include <memory>
#include <vector>

#include "Core/Model/Sweep.h"
#include "vtkBigusDataModule.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkDoubleArray;
class vtkImageData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{

/// A sweep and where its frames came from.
struct ImportedSweep
{
  std::shared_ptr<const Sweep> sweep;
  std::vector<int> frames;  ///< [sweep frames] index in the image's third axis; rejected frames are left out
};

/// Reads a sweep from an image stack (x, y, frame) with field data `ImageToReference` [16, row-major,
/// frames], which maps (i, j, 0, 1) to mm; i and j are VTK indices, so a cropped image keeps its place.
/// Spacing and origin are not used. `Timestamp` [1] seconds, `Status` [1] (0 = rejected) and `Mask` [1, width
/// x height] are optional. Pixels are unsigned char, float in [0, 1], or unsigned short (divided by 65535).
/// The first two are not copied while no frame is rejected: the sweep keeps the image's array alive.
/// Throws Error naming the array and what to do. The result is valid in the sense of Sweep::Validate.
VTKBIGUSDATA_EXPORT ImportedSweep SweepFromImage(vtkImageData* image);

/// Several such images, of sequences in one world frame, as one sweep (Join in Sweep.h). Frames are counted on from one
/// image to the next. Throws Error, which says of which image.
VTKBIGUSDATA_EXPORT ImportedSweep SweepFromImages(const std::vector<vtkImageData*>& images);

/// Fills `array` with the images' `ImageToReference`, one after the other, in which the frames that `imported` read from
/// them lie at other poses, [sweep frames] as Sweep's. Poses of rejected frames, and poses that did not change, are the
/// images', bit for bit.
VTKBIGUSDATA_EXPORT void FillImagePoses(const std::vector<vtkImageData*>& images, const ImportedSweep& imported,
                                        const std::vector<Eigen::Matrix4d>& poses, vtkDoubleArray* array);

/// Writes a sweep as such an image stack (pixels are copied).
VTKBIGUSDATA_EXPORT void SweepToImage(const Sweep& sweep, vtkImageData* image);

}  // namespace bigus
