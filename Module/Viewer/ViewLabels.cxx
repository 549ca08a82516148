// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewLabels.h"

#include <algorithm>
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

ViewLabels::ViewLabels(vtkPolyData* field)
{
  const auto labels = LabelsFromPolyData(field);
  if (!labels)
  {
    return;
  }
  field_ = std::make_unique<LabelledField>(FieldFromPolyData(field), *labels);
  colors_ = vtkSmartPointer<vtkLookupTable>::New();
  colors_->SetNumberOfTableValues(kLargestLabel + 1);
  colors_->SetTableRange(0, kLargestLabel);
  for (int value = 0; value <= kLargestLabel; ++value)
  {
    colors_->SetTableValue(value, 0, 0, 0, 0);
  }
  for (const Label& label : field_->Labels())
  {
    colors_->SetTableValue(label.value, label.color[0], label.color[1], label.color[2], 1);
  }
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
  const SlicePlane plane = PlaneOf(slice);
  std::vector<std::uint8_t> map(plane.NumberOfPixels());
  field_->Render(plane, map.data());
  vtkNew<vtkImageData> image;
  image->SetDimensions(plane.width, plane.height, 1);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  auto* const rim = static_cast<std::uint8_t*>(image->GetScalarPointer());
  const std::size_t width = static_cast<std::size_t>(plane.width);
  for (std::size_t p = 0; p < map.size(); ++p)  // one pixel wide, inside
  {
    const auto differs = [&map, p](bool isThere, std::size_t q) { return isThere && map[q] != map[p]; };
    const bool isRim = differs(p % width > 0, p - 1) || differs((p + 1) % width > 0, p + 1) ||
                       differs(p >= width, p - width) || differs(p + width < map.size(), p + width);
    rim[p] = isRim ? map[p] : 0;
  }
  overlay.Show(image, place);
}

std::string ViewLabels::At(vtkBigusSliceProp* slice, double i, double j) const
{
  const SlicePlane plane = PlaneOf(slice);
  const int column = static_cast<int>(std::lround(i)), row = static_cast<int>(std::lround(j));
  if (!field_ || column < 0 || row < 0 || column >= plane.width || row >= plane.height)
  {
    return {};
  }
  std::uint8_t value = 0;
  field_->Render(plane, {column, row, 1, 1}, &value);
  const std::vector<Label>& labels = field_->Labels();
  const auto found =
      std::find_if(labels.begin(), labels.end(), [value](const Label& label) { return label.value == value; });
  return found == labels.end() ? std::string() : found->name;
}

}  // namespace bigus::command
