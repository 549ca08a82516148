// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewLabels.h"

#include <cmath>

#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "ViewDoubts.h"
#include "vtkBigusSliceProp.h"
#include "vtkImageData.h"
#include "vtkLookupTable.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

/// What lies at the rim of its label: one pixel wide, inside.
bool IsRim(const std::vector<std::uint8_t>& map, int width, int height, int i, int j)
{
  const auto differs = [&](int column, int row)
  { return map[static_cast<std::size_t>(row) * width + column] != map[static_cast<std::size_t>(j) * width + i]; };
  return (i > 0 && differs(i - 1, j)) || (i + 1 < width && differs(i + 1, j)) || (j > 0 && differs(i, j - 1)) ||
         (j + 1 < height && differs(i, j + 1));
}

}  // namespace

ViewLabels::ViewLabels(vtkPolyData* field)
{
  const auto labels = LabelsFromPolyData(field);
  if (!labels)
  {
    return;
  }
  field_ = std::make_unique<LabelledField>(FieldFromPolyData(field), *labels);
  labels_ = labels->labels;
  colors_ = vtkSmartPointer<vtkLookupTable>::New();
  colors_->SetNumberOfTableValues(kLargestLabel + 1);
  colors_->SetTableRange(0, kLargestLabel);
  for (int value = 0; value <= kLargestLabel; ++value)
  {
    colors_->SetTableValue(value, 0, 0, 0, 0);
  }
  for (const Label& label : labels_)
  {
    colors_->SetTableValue(label.value, label.color[0], label.color[1], label.color[2], 1);
  }
}

std::vector<std::uint8_t> ViewLabels::Map(vtkBigusSliceProp* slice) const
{
  const SlicePlane plane = PlaneOf(slice);
  std::vector<std::uint8_t> map(plane.NumberOfPixels());
  field_->Render(plane, map.data());
  return map;
}

void ViewLabels::AddTo(vtkRenderer* renderer, ViewOverlay& overlay) const
{
  if (field_)
  {
    overlay.AddTo(renderer, colors_);
  }
}

void ViewLabels::Outline(vtkBigusSliceProp* slice, const Eigen::Matrix4d& place, ViewOverlay& overlay) const
{
  if (!field_)
  {
    return;
  }
  const std::vector<std::uint8_t> map = Map(slice);
  const int width = slice->GetSliceSize()[0], height = slice->GetSliceSize()[1];
  vtkNew<vtkImageData> image;
  image->SetDimensions(width, height, 1);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  auto* out = static_cast<std::uint8_t*>(image->GetScalarPointer());
  for (int j = 0; j < height; ++j)
  {
    for (int i = 0; i < width; ++i)
    {
      *out++ = IsRim(map, width, height, i, j) ? map[static_cast<std::size_t>(j) * width + i] : 0;
    }
  }
  overlay.Show(image, place);
}

std::string ViewLabels::At(vtkBigusSliceProp* slice, double i, double j) const
{
  const int *size = slice->GetSliceSize(), column = static_cast<int>(std::lround(i)),
            row = static_cast<int>(std::lround(j));
  if (!field_ || column < 0 || row < 0 || column >= size[0] || row >= size[1])
  {
    return {};
  }
  const int value = Map(slice)[static_cast<std::size_t>(row) * size[0] + column];
  for (const Label& label : labels_)
  {
    if (label.value == value)
    {
      return label.name;
    }
  }
  return {};
}

}  // namespace bigus::command
