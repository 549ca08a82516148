// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusResliceCursorRepresentation.h"

#include <algorithm>
#include <cmath>

#include "vtkBigusReslice.h"
#include "vtkBigusSliceProp.h"
#include "vtkImageData.h"
#include "vtkImageMapToColors.h"
#include "vtkMatrix4x4.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"
#include "vtkProperty.h"
#include "vtkResliceCursor.h"
#include "vtkResliceCursorActor.h"
#include "vtkResliceCursorPolyDataAlgorithm.h"

vtkStandardNewMacro(vtkBigusResliceCursorRepresentation);

namespace
{

// Of the cursor's x, y and z; lighter than VTK's, because its blue cannot be seen on black.
constexpr double kLineColours[3][3] = {{1, 0.35, 0.3}, {0.4, 0.9, 0.35}, {0.4, 0.65, 1}};

constexpr double kHoleShare = 0.05;  // of the box's longest side: the gap where the lines meet, VTK's 16 of 320 pixels

}  // namespace

vtkBigusResliceCursorRepresentation::vtkBigusResliceCursorRepresentation()
{
  this->FieldReslice->SetOutputDimensionality(2);
  this->FieldReslice->GenerateCoverageOutputOff();
  // VTK draws the cursor's lines as ribbons along the view, which have no width there; wires have.
  for (int axis = 0; axis < 3; ++axis)
  {
    vtkProperty* line = this->ResliceCursorActor->GetCenterlineProperty(axis);
    line->SetRepresentationToWireframe();
    line->LightingOff();
    line->SetColor(kLineColours[axis][0], kLineColours[axis][1], kLineColours[axis][2]);
  }
}

vtkBigusResliceCursorRepresentation::~vtkBigusResliceCursorRepresentation() = default;

void vtkBigusResliceCursorRepresentation::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "FieldReslice: " << this->FieldReslice.Get() << "\n";
}

void vtkBigusResliceCursorRepresentation::SetInputData(vtkPolyData* field)
{
  this->FieldReslice->SetInputData(field);
  this->Modified();
}

void vtkBigusResliceCursorRepresentation::SetInputConnection(vtkAlgorithmOutput* field)
{
  this->FieldReslice->SetInputConnection(field);
  this->Modified();
}

void vtkBigusResliceCursorRepresentation::PlaceCursor(vtkResliceCursor* cursor, int normalAxis, int pixels)
{
  if (!cursor || normalAxis < 0 || normalAxis > 2 || pixels < 2)
  {
    vtkErrorMacro(<< "PlaceCursor: there must be a cursor, an axis 0, 1 or 2, and at least 2 pixels.");
    return;
  }
  if (this->FieldReslice->GetNumberOfInputConnections(0) == 0)
  {
    vtkErrorMacro(<< "PlaceCursor: there is no field; call SetInputData or SetInputConnection first.");
    return;
  }
  if (!cursor->GetImage())
  {
    vtkNew<vtkBigusSliceProp> prop;
    prop->SetInputConnection(this->FieldReslice->GetInputConnection(0, 0));
    double box[6], sizes[3];
    if (!prop->GetFieldBox(box))
    {
      vtkErrorMacro(<< "PlaceCursor: the field has no Gaussians, so there is nowhere to put the cursor.");
      return;
    }
    for (int axis = 0; axis < 3; ++axis)
    {
      sizes[axis] = box[2 * axis + 1] - box[2 * axis];
    }
    const double spacing = *std::max_element(sizes, sizes + 3) / (pixels - 1);
    vtkNew<vtkImageData> image;
    image->SetSpacing(spacing, spacing, spacing);
    image->SetOrigin(box[0], box[2], box[4]);
    image->SetDimensions(1 + std::max(1, static_cast<int>(std::lround(sizes[0] / spacing))),
                         1 + std::max(1, static_cast<int>(std::lround(sizes[1] / spacing))),
                         1 + std::max(1, static_cast<int>(std::lround(sizes[2] / spacing))));
    cursor->SetImage(image);
    cursor->SetCenter(image->GetCenter());
    // Of fixed millimetres: for one of fixed pixels VTK clips the lines anew for every picture, longer than it draws.
    cursor->SetHoleWidthInPixels(0);
    cursor->SetHoleWidth(kHoleShare * spacing * (pixels - 1));
  }
  this->GetCursorAlgorithm()->SetResliceCursor(cursor);
  this->GetCursorAlgorithm()->SetReslicePlaneNormal(normalAxis);
}

void vtkBigusResliceCursorRepresentation::SetResliceParameters(double spacingX, double spacingY, int extentX,
                                                               int extentY)
{
  // The texture covers the whole plane, so any number of pixels fits; VTK's own is padded to powers of two.
  const double step = this->GetResliceCursor()->GetImage()->GetSpacing()[0];
  const double width = spacingX * extentX, height = spacingY * extentY;  // mm
  const int columns = std::max(1, static_cast<int>(std::ceil(width / step - 1e-6)));
  const int rows = std::max(1, static_cast<int>(std::ceil(height / step - 1e-6)));
  this->FieldReslice->SetResliceAxes(this->ResliceAxes);
  this->FieldReslice->SetOutputSpacing(width / columns, height / rows, 1);
  this->FieldReslice->SetOutputOrigin(0.5 * width / columns, 0.5 * height / rows, 0);
  this->FieldReslice->SetOutputExtent(0, columns - 1, 0, rows - 1, 0, 0);
  this->ColorMap->SetInputConnection(this->FieldReslice->GetOutputPort());
}
