// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields between VTK and Core: the one place that knows which arrays a field is made of. They are points in mm
// with point data `Scale` [3] mm, `Rotation` [4] w, x, y, z, `Reflectivity` [1] and field data `Gamma` [1],
// `ElevationSigma` [1] mm. There may be `ProbeElevationSigma` [1] mm and `TrainedNormals` [3] unit vectors (Beam.h),
// `FormatVersion` [1], which must be 1, and `Provenance` (Provenance.h). A field whose echoes depend on the direction has
// the arrays of ViewFromPolyData besides.
// On input any numeric type will do, cells are not looked at, and without points all arrays are optional.
#pragma once

#include <optional>
#include <string>

#include "Core/Model/FieldChunks.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/ViewDependence.h"
#include "vtkBigusDataModule.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkDataObject;
class vtkInformationIntegerKey;
class vtkPolyData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{

/// Throws Error naming the array, the index, the value and what to do. The result is valid in the sense of
/// GaussianField::Validate.
VTKBIGUSDATA_EXPORT GaussianField FieldFromPolyData(vtkPolyData* polyData);

/// Writes a field in double, with one vertex cell a point so that viewers show it, and Reflectivity as the active
/// scalars. Replaces everything in `polyData`.
VTKBIGUSDATA_EXPORT void FieldToPolyData(const GaussianField& field, vtkPolyData* polyData);

/// What the field knows of directions: point data `ViewTerm` [3], and field data `ViewVersion` [1], which must be 1,
/// `ViewMean` [9] (a rotation, row by row), `ViewSteps` [3] (radian, degrees, mm) and `ViewPoses` [16] (row by row): see
/// ViewDependence.h. Null where there is no `ViewTerm`. Throws Error as FieldFromPolyData does.
VTKBIGUSDATA_EXPORT std::optional<ViewDependence> ViewFromPolyData(vtkPolyData* polyData);

/// Adds that to a field of FieldToPolyData.
VTKBIGUSDATA_EXPORT void ViewToPolyData(const ViewDependence& view, vtkPolyData* polyData);

/// What the field's standard error rests on (Core/StandardError): the bytes of the field data's array `StandardError`, none
/// when it is absent. Throws Error for an array that is none of bytes.
VTKBIGUSDATA_EXPORT std::string StandardErrorOf(vtkDataObject* data);

/// Replaces them; of none the array is removed.
VTKBIGUSDATA_EXPORT void ReplaceStandardError(vtkDataObject* data, const std::string& bytes);

/// Checks the field in `from` as FieldFromPolyData does and makes `to` that field as FieldToPolyData does, with its
/// provenance, what it knows of directions, its labels and no other arrays. Arrays of doubles are shared, others are converted. `to` may be `from`.
VTKBIGUSDATA_EXPORT void ShareField(vtkPolyData* from, vtkPolyData* to);

/// The field data array of a part of a field that says which chunks it has: total, first, sizes.
constexpr const char* kChunksArray = "Chunks";
VTKBIGUSDATA_EXPORT void WriteChunks(const FieldChunks& chunks, vtkPolyData* part);

/// In the output information of what can give a field piece by piece: of so many chunks, dealt to the pieces. 0: it cannot.
/// It goes downstream by itself; a filter that always takes the whole field must remove it.
VTKBIGUSDATA_EXPORT vtkInformationIntegerKey* ChunksOfPiecesKey();

}  // namespace bigus
