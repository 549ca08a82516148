// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Labels between VTK and Core (Core/Labels). A field has point data `LabelWeight` [K], float, and may have field data
// `LabelPoints` [4], double (x, y, z and scale, mm), and `LabelPointWeight` [K], float, of as many tuples. As an image of
// label pictures it has field data `LabelNames` [1], strings, `LabelValues` [1], int, and `LabelColors` [3], double, of K
// tuples.
#pragma once

#include <optional>
#include <vector>

#include "Core/Labels/Labels.h"
#include "vtkBigusDataModule.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkDataObject;
class vtkImageData;
class vtkPolyData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{

/// The labels' names; none when `LabelValues` is absent. Names and colours that are absent are made. Throws Error.
VTKBIGUSDATA_EXPORT std::vector<Label> LabelNamesOf(vtkDataObject* data);
/// Replaces them.
VTKBIGUSDATA_EXPORT void ReplaceLabelNames(vtkDataObject* data, const std::vector<Label>& labels);

/// Null where there is no `LabelWeight`. Throws Error as FieldFromPolyData does.
VTKBIGUSDATA_EXPORT std::optional<FieldLabels> LabelsFromPolyData(vtkPolyData* polyData);
/// Adds them to a field, in place of those that it has.
VTKBIGUSDATA_EXPORT void LabelsToPolyData(const FieldLabels& labels, vtkPolyData* polyData);

/// Label pictures for the frames of a sweep, an image [depth][height][width] of whole numbers from 0 to 255. Slice k is of
/// the sweep's frame that has the same `SourceFrame`. Where pictures have no such array, there is one for each frame of the
/// sweep, or for each of its file, counted from 0. As many as frames, of which none has the number of the first frame, are
/// taken in order. Those that do not begin at the first pixel of the first frame were cropped: they lie where their extent
/// says, and beside them is nothing. Pictures of frames that the sweep does not have are passed over. Values without a name
/// get one. `frames`: those of the image `sweep` that count (ImportedSweep), as the result counts them. Throws Error naming
/// what does not fit.
VTKBIGUSDATA_EXPORT LabelFrames LabelFramesFromImage(vtkImageData* drawn, vtkImageData* sweep,
                                                     const std::vector<int>& frames);

}  // namespace bigus
