// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewDoubts.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "Console.h"
#include "Data/FieldData.h"
#include "vtkBigusReslice.h"
#include "vtkBigusSliceProp.h"
#include "vtkImageData.h"
#include "vtkLookupTable.h"
#include "vtkMatrix4x4.h"
#include "vtkPolyData.h"

namespace bigus::command
{

namespace
{

constexpr double kSure = 0.1;                    // of white: a standard error up to this is not tinted
constexpr double kTint[] = {1, 0.72, 0.2, 0.4};  // with its opacity

const float* ImageOf(vtkBigusSliceProp* slice)
{
  slice->UpdateSlice();
  return static_cast<const float*>(slice->GetReslice()->GetOutput()->GetScalarPointer());
}

}  // namespace

SlicePlane PlaneOf(vtkBigusSliceProp* slice)
{
  Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose;
  std::copy_n(slice->GetPlane()->GetData(), 16, pose.data());
  const double* const origin = slice->GetSliceOrigin();
  pose.col(3) += origin[0] * pose.col(0) + origin[1] * pose.col(1);
  pose.col(0) *= slice->GetSliceSpacing()[0];
  pose.col(1) *= slice->GetSliceSpacing()[1];
  return SlicePlane::FromImageToReference(pose, slice->GetSliceSize()[0], slice->GetSliceSize()[1]);
}

ViewDoubts::ViewDoubts(vtkPolyData* field)
{
  const std::string bytes = StandardErrorOf(field);
  kept_ = bytes.empty() ? nullptr : std::make_unique<const StandardError>(bytes);
  if (std::optional<ViewDependence> view = ViewFromPolyData(field))
  {
    recorded_ = std::move(view->views);
  }
  tints_ = vtkSmartPointer<vtkLookupTable>::New();
  tints_->SetNumberOfTableValues(2);
  tints_->SetTableRange(0, 2 * kSure);
  tints_->SetTableValue(0, 0, 0, 0, 0);
  tints_->SetTableValue(1, kTint[0], kTint[1], kTint[2], kTint[3]);
  tints_->SetNanColor(kTint[0], kTint[1], kTint[2], kTint[3]);
}

bool ViewDoubts::IsMostlyGuessed(vtkBigusSliceProp* slice) const
{
  return kept_ && kept_->IsMostlyGuessed(PlaneOf(slice), ImageOf(slice));
}

std::string ViewDoubts::Direction(vtkBigusSliceProp* slice) const
{
  return recorded_ ? FormatNumber(recorded_->Turn(PlaneOf(slice)), 0) + " deg beside recorded frames" : "";
}

std::vector<float> ViewDoubts::Sigma(vtkBigusSliceProp* slice) const
{
  const SlicePlane plane = PlaneOf(slice);
  std::vector<float> sigma(static_cast<std::size_t>(plane.width) * plane.height);
  kept_->Evaluate(plane, ImageOf(slice), sigma.data());
  return sigma;
}

std::string ViewDoubts::At(vtkBigusSliceProp* slice, double i, double j) const
{
  const int *size = slice->GetSliceSize(), column = static_cast<int>(std::lround(i)),
            row = static_cast<int>(std::lround(j));
  if (column < 0 || row < 0 || column >= size[0] || row >= size[1])
  {
    return {};
  }
  const std::size_t pixel = static_cast<std::size_t>(row) * size[0] + column;
  const std::string intensity = "intensity " + FormatNumber(ImageOf(slice)[pixel], 3);
  if (!kept_)
  {
    return intensity;
  }
  const float sigma = Sigma(slice)[pixel];
  return intensity + (std::isnan(sigma) ? ", not known" : " +- " + FormatNumber(sigma, 3));
}

std::string ViewDoubts::Inside(vtkBigusSliceProp* slice, const std::vector<Eigen::Vector2d>& polygon) const
{
  const int *size = slice->GetSliceSize(), width = size[0];
  std::vector<unsigned char> inside(static_cast<std::size_t>(width) * size[1], 0);
  double sum = 0, count = 0;
  const float* const image = ImageOf(slice);
  for (std::size_t p = 0; p < inside.size(); ++p)
  {
    const Eigen::Vector2d pixel(static_cast<double>(p % width), static_cast<double>(p / width));
    for (std::size_t k = 0; k < polygon.size(); ++k)  // a line to the right crosses its sides an odd number of times
    {
      const Eigen::Vector2d a = polygon[k] - pixel, b = polygon[(k + 1) % polygon.size()] - pixel;
      inside[p] ^= (a[1] > 0) != (b[1] > 0) && a[0] - a[1] * (b[0] - a[0]) / (b[1] - a[1]) > 0 ? 1 : 0;
    }
    sum += inside[p] != 0 ? image[p] : 0;
    count += inside[p];
  }
  if (count == 0)
  {
    return {};
  }
  const std::string mean = "mean " + FormatNumber(sum / count, 3);
  if (!kept_)
  {
    return mean;
  }
  const std::vector<float> sigma = Sigma(slice);
  bool isKnown = true;  // of every pixel that the mean is of
  for (std::size_t p = 0; p < sigma.size(); ++p)
  {
    isKnown = isKnown && (inside[p] == 0 || !std::isnan(sigma[p]));
  }
  const double error = kept_->OfMean(PlaneOf(slice), sigma.data(), inside.data());
  return mean + (isKnown && !std::isnan(error) ? " +- " + FormatNumber(error, 3) : ", not known");
}

void ViewDoubts::AddTo(vtkRenderer* renderer, ViewOverlay& overlay) const
{
  overlay.AddTo(renderer, tints_);
}

void ViewDoubts::Tint(vtkBigusSliceProp* slice, const Eigen::Matrix4d& place, ViewOverlay& overlay) const
{
  if (!kept_)
  {
    return;
  }
  const std::vector<float> sigma = Sigma(slice);
  vtkNew<vtkImageData> image;
  image->SetDimensions(slice->GetSliceSize()[0], slice->GetSliceSize()[1], 1);
  image->AllocateScalars(VTK_FLOAT, 1);
  std::copy(sigma.begin(), sigma.end(), static_cast<float*>(image->GetScalarPointer()));
  overlay.Show(image, place);
}

}  // namespace bigus::command
