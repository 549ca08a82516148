// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Between VTK's data objects and Core's: the one place that knows which arrays a sweep and a field are made
// of.
#ifndef vtkBigusConvert_h
#define vtkBigusConvert_h

#include <memory>
#include <string>
#include <vector>

#include "Core/Deciding/Trainer.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
#include "vtkBigusFiltersModule.h"
#include "vtkSmartPointer.h"

class vtkDataObject;
class vtkImageData;
class vtkPolyData;

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
VTKBIGUSFILTERS_EXPORT ImportedSweep SweepFromImage(vtkImageData* image);

/// Writes a sweep as such an image stack (pixels are copied).
VTKBIGUSFILTERS_EXPORT void SweepToImage(const Sweep& sweep, vtkImageData* image);

/// Reads a field from points in mm with point data `Scale` [3] mm, `Rotation` [4] w, x, y, z, `Reflectivity`
/// [1] and field data `Gamma` [1], `ElevationSigma` [1] mm; `FormatVersion` [1], where present, must be 1.
/// Any numeric type. Cells are not looked at. With no points all arrays are optional: the empty field. Throws
/// Error naming the array and what to do. The result is valid in the sense of GaussianField::Validate.
VTKBIGUSFILTERS_EXPORT GaussianField FieldFromPolyData(vtkPolyData* polyData);

/// Writes a field as such points, in double, with one vertex cell a point so that viewers show it, and
/// Reflectivity as the active scalars. Replaces everything in `polyData`.
VTKBIGUSFILTERS_EXPORT void FieldToPolyData(const GaussianField& field, vtkPolyData* polyData);

/// Appends `key=value` to the field data's string array `Provenance`, replacing an earlier line of that key.
VTKBIGUSFILTERS_EXPORT void SetProvenance(vtkDataObject* data, const std::string& key, const std::string& value);

/// The choices a training rested on: seed, loss, the settled options by their properties' names, and
/// `decision.<what>` = choice (evidence). Nothing that differs between two equal runs, such as the time.
VTKBIGUSFILTERS_EXPORT void SetTrainingProvenance(vtkDataObject* data, const TrainingResult& result);

/// The value of `key` in `Provenance`; empty when it is not there.
VTKBIGUSFILTERS_EXPORT std::string GetProvenance(vtkDataObject* data, const std::string& key);

}  // namespace bigus

#endif
