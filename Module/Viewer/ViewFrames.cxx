// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ViewFrames.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "Console.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Model/FrameDistance.h"
#include "Core/Numerics/Constants.h"
#include "vtkBigusReslice.h"
#include "vtkBigusSliceProp.h"
#include "vtkImageData.h"
#include "vtkImageProperty.h"
#include "vtkLookupTable.h"

namespace bigus::command
{

namespace
{

// Differences that may have the full colour, shares of white. The least is taken that kInRange of the pixels keep to.
constexpr double kRanges[] = {0.02, 0.05, 0.1, 0.2, 0.5, 1};
constexpr double kInRange = 0.95;
constexpr int kAsked = 5;     // points along each side of a slice, to tell which frame is nearest
constexpr int kShades = 255;  // odd, so that black is exactly no difference

vtkSmartPointer<vtkImageData> FloatImage(int width, int height)
{
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(width, height, 1);
  image->AllocateScalars(VTK_FLOAT, 1);
  std::fill_n(static_cast<float*>(image->GetScalarPointer()), static_cast<std::size_t>(width) * height, 0.0f);
  return image;
}

/// From blue (too dark) over black to orange (too bright).
vtkSmartPointer<vtkLookupTable> DifferenceTable()
{
  auto table = vtkSmartPointer<vtkLookupTable>::New();
  table->SetNumberOfTableValues(kShades);
  for (int k = 0; k < kShades; ++k)
  {
    const double share = 2.0 * k / (kShades - 1) - 1, strength = std::abs(share);
    const Color full = share < 0 ? Color{0.25, 0.55, 1} : Color{1, 0.58, 0.15};
    table->SetTableValue(k, strength * full[0], strength * full[1], strength * full[2], 1);
  }
  return table;
}

/// The range for these differences, which are reordered.
double RangeFor(std::vector<float>& sizes)
{
  const auto most = sizes.begin() + static_cast<std::ptrdiff_t>(kInRange * (sizes.size() - 1));
  std::nth_element(sizes.begin(), most, sizes.end());
  const double* const range = std::lower_bound(std::begin(kRanges), std::end(kRanges) - 1, *most);
  return *range;
}

/// The frame from which a plane lies least far, in the mean over its points, and how far that is, mm.
std::pair<int, double> NearestFrame(const Sweep& sweep, SlicePlane plane)
{
  plane.columnStep *= (plane.width - 1.0) / (kAsked - 1);
  plane.rowStep *= (plane.height - 1.0) / (kAsked - 1);
  plane.width = plane.height = kAsked;
  std::pair<int, double> nearest(0, std::numeric_limits<double>::infinity());
  std::array<float, kAsked * kAsked> distances;
  for (int frame = 0; frame < sweep.NumberOfFrames(); ++frame)
  {
    DistanceToFrames(sweep, {frame}, plane, distances.data());
    const double mean = std::accumulate(distances.begin(), distances.end(), 0.0) / distances.size();
    if (mean < nearest.second)
    {
      nearest = {frame, mean};
    }
  }
  return nearest;
}

}  // namespace

ViewFrames::ViewFrames(std::shared_ptr<const Sweep> sweep, vtkBigusSliceProp* slice)
    : sweep_(std::move(sweep)),
      slice_(slice),
      recordedImage_(FloatImage(sweep_->width, sweep_->height)),
      differenceImage_(FloatImage(sweep_->width, sweep_->height)),
      differenceTable_(DifferenceTable())
{
  const SlicePlane plane = sweep_->Plane(0);
  recorded.mapper->SetInputData(recordedImage_);
  rendered.mapper->SetInputConnection(slice_->GetReslice()->GetOutputPort());
  difference.mapper->SetInputData(differenceImage_);
  for (Cell* cell : Cells())
  {
    cell->picture->SetMapper(cell->mapper);
    cell->picture->SetScale(plane.columnStep.norm(), plane.rowStep.norm(), 1);  // pixels to mm
    cell->renderer->AddViewProp(cell->picture);
  }
  for (Cell* cell : {&recorded, &rendered})
  {
    cell->picture->SetProperty(slice_->GetProperty());  // window and level
  }
  difference.picture->GetProperty()->SetLookupTable(differenceTable_);
  difference.picture->GetProperty()->UseLookupTableScalarRangeOn();
}

void ViewFrames::Show(int frame)
{
  sweep_->CopyFrame(frame, static_cast<float*>(recordedImage_->GetScalarPointer()));
  recordedImage_->Modified();
  for (Cell* cell : Cells())
  {
    cell->measure.Clear();
  }
}

void ViewFrames::ShowFrame(int frame)
{
  Show(frame);
  slice_->UpdateSlice();
  const auto* const predicted = static_cast<const float*>(slice_->GetReslice()->GetOutput()->GetScalarPointer());
  const auto* const seen = static_cast<const float*>(recordedImage_->GetScalarPointer());
  auto* const off = static_cast<float*>(differenceImage_->GetScalarPointer());
  std::vector<float> litPredicted, litSeen, sizes;
  for (std::size_t pixel = 0; pixel < sweep_->PixelsPerFrame(); ++pixel)
  {
    const bool lit = sweep_->IsLit(pixel);
    off[pixel] = lit ? predicted[pixel] - seen[pixel] : 0;
    if (lit)
    {
      litPredicted.push_back(predicted[pixel]);
      litSeen.push_back(seen[pixel]);
      sizes.push_back(std::abs(off[pixel]));
    }
  }
  psnr_ = litSeen.empty() ? std::numeric_limits<double>::quiet_NaN()
                          : bigus::Psnr(litPredicted.data(), litSeen.data(), litSeen.size());
  const double range = sizes.empty() ? kRanges[0] : RangeFor(sizes);
  differenceTable_->SetTableRange(-range, range);
  differenceImage_->Modified();
  difference.picture->VisibilityOn();
  recorded.SetCaption("recorded   frame " + std::to_string(frame));
  rendered.SetCaption("rendered   " + FormatNumber(psnr_, 1) + " dB");
  difference.SetCaption("rendered - recorded   +-" + FormatNumber(100 * range, 0) + " % of white");
}

void ViewFrames::ShowNearest()
{
  const SlicePlane plane = PlaneOf(slice_);
  const auto [frame, distance] = NearestFrame(*sweep_, plane);
  Show(frame);
  const double cosine = std::min(1.0, std::abs(plane.Normal().dot(sweep_->Plane(frame).Normal())));
  psnr_ = std::numeric_limits<double>::quiet_NaN();
  difference.picture->VisibilityOff();
  recorded.SetCaption("nearest: frame " + std::to_string(frame) + ", " + FormatNumber(distance, 1) + " mm, " +
                      FormatNumber(std::acos(cosine) / kRadiansPerDegree, 0) + " degrees   f: back");
  rendered.SetCaption("rendered");
  difference.SetCaption("");
}

void ViewFrames::Fit()
{
  const double* step = recorded.picture->GetScale();
  const Eigen::Vector3d middle(0.5 * (sweep_->width - 1) * step[0], 0.5 * (sweep_->height - 1) * step[1], 0);
  for (Cell* cell : Cells())
  {
    cell->LookAt(middle, Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitY(), sweep_->width * step[0],
                 sweep_->height * step[1]);
  }
}

}  // namespace bigus::command
