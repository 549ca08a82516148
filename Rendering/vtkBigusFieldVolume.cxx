// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldVolume.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Model/GaussianField.h"
#include "Core/Numerics/Statistics.h"
#include "Data/FieldData.h"
#include "vtkAutoInit.h"
#include "vtkBigusVoxelizer.h"
#include "vtkColorTransferFunction.h"
#include "vtkImageData.h"
#include "vtkMath.h"
#include "vtkObjectFactory.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkSmartVolumeMapper.h"
#include "vtkUnsignedCharArray.h"
#include "vtkVolumeProperty.h"

// vtkSmartVolumeMapper asks the object factory for what draws on the card.
VTK_MODULE_INIT(vtkRenderingVolumeOpenGL2);

vtkStandardNewMacro(vtkBigusFieldVolume);

namespace
{

constexpr int kLongestSide = 160;        // voxels; four million in a cube, which llvmpipe draws within a second
constexpr double kDiagonalShare = 0.01;  // of the volume's diagonal: the length that opacities hold for
constexpr int kLargestLevel = 255;
constexpr double kReach = 3;  // standard deviations of the median Gaussian around the centres: nearly all of its echo

struct Stop
{
  double quantile, opacity, red, green, blue;
};
constexpr std::array<Stop, 4> kStops = {{{0.5, 0, 0.25, 0.14, 0.10},
                                         {0.9, 0.08, 0.75, 0.50, 0.38},
                                         {0.995, 0.5, 1.0, 0.92, 0.80},
                                         {1.0, 0.8, 1.0, 1.0, 1.0}}};

}  // namespace

vtkBigusFieldVolume::vtkBigusFieldVolume()
{
  this->Voxelizer->SetOutputScalarTypeToUnsignedChar();
  this->Voxelizer->SetMaximumDimension(kLongestSide);
  this->SmartMapper->SetInputConnection(this->Voxelizer->GetOutputPort());
  this->SetMapper(this->SmartMapper);
  vtkVolumeProperty* property = this->GetProperty();
  property->SetInterpolationTypeToLinear();
  property->ShadeOff();  // speckle has a gradient everywhere
}

vtkBigusFieldVolume::~vtkBigusFieldVolume() = default;

void vtkBigusFieldVolume::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "AutomaticTransfer: " << this->AutomaticTransfer << "\n";
  os << indent << "CropToCenters: " << this->CropToCenters << "\n";
  os << indent << "Voxelizer:\n";
  this->Voxelizer->PrintSelf(os, indent.GetNextIndent());
}

void vtkBigusFieldVolume::SetInputData(vtkPolyData* field)
{
  this->Voxelizer->SetInputData(field);
}

void vtkBigusFieldVolume::SetInputConnection(vtkAlgorithmOutput* field)
{
  this->Voxelizer->SetInputConnection(field);
}

double vtkBigusFieldVolume::FillTransfer(vtkImageData* volume, vtkPiecewiseFunction* opacity,
                                         vtkColorTransferFunction* color)
{
  opacity->RemoveAllPoints();
  color->RemoveAllPoints();
  opacity->AddPoint(0, 0);
  color->AddRGBPoint(0, 0, 0, 0);

  std::array<double, kLargestLevel + 1> below{};  // voxels above 0, up to each level
  if (auto* voxels = vtkUnsignedCharArray::SafeDownCast(volume->GetPointData()->GetScalars()))
  {
    for (vtkIdType k = 0; k < voxels->GetNumberOfValues(); ++k)
    {
      below[voxels->GetValue(k)] += 1;
    }
  }
  below[0] = 0;
  for (int level = 1; level <= kLargestLevel; ++level)
  {
    below[level] += below[level - 1];
  }
  int level = 0;
  for (const Stop& stop : kStops)
  {
    // Every stop has a level of its own, so that the functions stay such where few levels are in use.
    do
    {
      ++level;
    } while (level < kLargestLevel && below[level] < stop.quantile * below[kLargestLevel]);
    opacity->AddPoint(level, below[kLargestLevel] > 0 ? stop.opacity : 0);
    color->AddRGBPoint(level, stop.red, stop.green, stop.blue);
  }
  return kDiagonalShare * volume->GetLength();
}

void vtkBigusFieldVolume::Crop()
{
  this->Voxelizer->GetInputAlgorithm()->Update();
  auto* input = vtkPolyData::SafeDownCast(this->Voxelizer->GetInputDataObject(0, 0));
  const int longest = this->Voxelizer->GetMaximumDimension();
  if (!input || (input->GetMTime() == this->CropTime && longest == this->CropDimension))
  {
    return;
  }
  this->CropTime = input->GetMTime();
  this->CropDimension = longest;
  Eigen::AlignedBox3d box;
  std::vector<double> scales;
  try
  {
    const bigus::GaussianField field = bigus::FieldFromPolyData(input);
    for (std::size_t i = 0; i < field.Size(); ++i)
    {
      box.extend(field.means[i]);
      scales.push_back(std::cbrt(field.scales[i].prod()));
    }
  }
  catch (const bigus::Error&)
  {
    return;  // the voxelizer tells what is wrong with it
  }
  if (scales.empty())
  {
    return;
  }
  const double middle = bigus::Median(std::move(scales));
  box.min().array() -= kReach * middle;
  box.max().array() += kReach * middle;
  const double spacing = box.sizes().maxCoeff() / (longest - 1);
  const auto voxels = [&](int axis) { return 1 + static_cast<int>(std::lround(box.sizes()[axis] / spacing)); };
  this->Voxelizer->SetOutputOrigin(box.min().data());
  this->Voxelizer->SetOutputSpacing(spacing, spacing, spacing);
  this->Voxelizer->SetOutputDimensions(voxels(0), voxels(1), voxels(2));
}

void vtkBigusFieldVolume::UpdateVolume()
{
  if (this->Voxelizer->GetNumberOfInputConnections(0) == 0)
  {
    return;
  }
  if (this->CropToCenters)
  {
    this->Crop();
  }
  this->Voxelizer->Update();
  vtkImageData* volume = this->Voxelizer->GetOutput();
  if (this->AutomaticTransfer && volume->GetMTime() != this->VolumeTime)
  {
    this->VolumeTime = volume->GetMTime();
    vtkNew<vtkPiecewiseFunction> opacity;
    vtkNew<vtkColorTransferFunction> color;
    const double length = FillTransfer(volume, opacity, color);
    vtkVolumeProperty* property = this->GetProperty();
    property->SetScalarOpacity(opacity);
    property->SetColor(color);
    if (length > 0)
    {
      property->SetScalarOpacityUnitDistance(length);
    }
  }
}

double* vtkBigusFieldVolume::GetBounds()
{
  this->UpdateVolume();
  if (this->Voxelizer->GetNumberOfInputConnections(0) == 0 || this->Voxelizer->GetOutput()->GetNumberOfPoints() == 0)
  {
    vtkMath::UninitializeBounds(this->Bounds);
    return this->Bounds;
  }
  return this->Superclass::GetBounds();
}

int vtkBigusFieldVolume::RenderVolumetricGeometry(vtkViewport* viewport)
{
  this->UpdateVolume();
  if (this->Voxelizer->GetNumberOfInputConnections(0) == 0 || this->Voxelizer->GetOutput()->GetNumberOfPoints() == 0)
  {
    return 0;
  }
  return this->Superclass::RenderVolumetricGeometry(viewport);
}
