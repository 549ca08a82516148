// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusVoxelizer.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "Core/Model/Error.h"
#include "FieldRenderer.h"
#include "PipelineSupport.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkObjectFactory.h"

vtkStandardNewMacro(vtkBigusVoxelizer);

namespace
{

using RowMajorMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr double kUnitLength = 1e-6;  // by which a unit vector's length may differ from 1
constexpr double kFlat = 1e-3;        // determinant below which the axes lie nearly in one plane

}  // namespace

vtkBigusVoxelizer::vtkBigusVoxelizer()
{
  this->ElevationSigma = 0;
}

void vtkBigusVoxelizer::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "OutputDimensions: " << this->OutputDimensions[0] << " " << this->OutputDimensions[1] << " "
     << this->OutputDimensions[2] << (this->ComputeOutputDimensions ? " (default)\n" : "\n");
  os << indent << "OutputDirection:";
  for (double element : this->OutputDirection)
  {
    os << " " << element;
  }
  os << "\n";
  os << indent << "MaximumDimension: " << this->MaximumDimension << "\n";
}

void vtkBigusVoxelizer::SetOutputDimensions(int x, int y, int z)
{
  const int dimensions[3] = {x, y, z};
  this->SetOutputDimensions(dimensions);
}

void vtkBigusVoxelizer::SetOutputDimensions(const int dimensions[3])
{
  if (bigus::GiveValues(dimensions, this->OutputDimensions, this->ComputeOutputDimensions))
  {
    this->Modified();
  }
}

void vtkBigusVoxelizer::SetOutputDimensionsToDefault()
{
  if (bigus::TakeValuesBack(1, this->OutputDimensions, this->ComputeOutputDimensions))
  {
    this->Modified();
  }
}

int vtkBigusVoxelizer::RequestInformation(vtkInformation* request, vtkInformationVector** inputs,
                                          vtkInformationVector* outputs)
{
  outputs->GetInformationObject(0)->Set(vtkDataObject::DIRECTION(), this->OutputDirection, 9);
  return this->Superclass::RequestInformation(request, inputs, outputs);
}

void vtkBigusVoxelizer::ComputeGrid(double givenSpacing[3], double givenOrigin[3], int extent[6])
{
  Eigen::Map<Eigen::Vector3d> spacing(givenSpacing), origin(givenOrigin);
  Eigen::Vector3i dimensions(this->OutputDimensions);
  const Eigen::Matrix3d direction = Eigen::Map<const RowMajorMatrix3>(this->OutputDirection);
  if (!((direction.colwise().norm().array() - 1).abs().maxCoeff() < kUnitLength) ||
      !(std::abs(direction.determinant()) > kFlat))
  {
    throw bigus::Error("OutputDirection must be a 3 x 3 matrix whose columns are unit vectors that span space.");
  }
  if (this->ComputeOutputSpacing || this->ComputeOutputOrigin || this->ComputeOutputDimensions)
  {
    // The grid over the field along the given axes; what was set replaces its part, the rest keeps to its bounds.
    const bigus::FieldGrid grid =
        bigus::GridOver(this->UpdatedField(), direction, this->MaximumDimension, this->Parts());
    const Eigen::Vector3d size = grid.spacing * (grid.dimensions.cast<double>() - Eigen::Vector3d::Ones());
    const Eigen::Vector3d centre = grid.origin + 0.5 * size;
    if (this->ComputeOutputSpacing)
    {
      spacing.setConstant(grid.spacing);
      for (int axis = 0; axis < 3 && !this->ComputeOutputDimensions; ++axis)
      {
        spacing[axis] = dimensions[axis] > 1 && size[axis] > 0 ? size[axis] / (dimensions[axis] - 1) : grid.spacing;
      }
    }
    const Eigen::Vector3d originAlongAxes = direction.inverse() * origin;
    for (int axis = 0; axis < 3 && this->ComputeOutputDimensions; ++axis)
    {
      const double low = this->ComputeOutputOrigin ? grid.origin[axis] : originAlongAxes[axis];
      const double steps = (grid.origin[axis] + size[axis] - low) / std::abs(spacing[axis]);
      // The limit fits an int; so large an output is refused later.
      dimensions[axis] = static_cast<int>(std::clamp(std::round(steps), 0.0, 1e9)) + 1;
    }
    if (this->ComputeOutputOrigin)
    {
      origin = direction * (centre - 0.5 * spacing.cwiseProduct(dimensions.cast<double>() - Eigen::Vector3d::Ones()));
    }
  }
  if (dimensions.minCoeff() < 1)
  {
    throw bigus::Error("OutputDimensions are " + std::to_string(dimensions[0]) + " x " + std::to_string(dimensions[1]) +
                       " x " + std::to_string(dimensions[2]) + "; each must be at least 1.");
  }
  for (int axis = 0; axis < 3; ++axis)
  {
    extent[2 * axis] = 0;
    extent[2 * axis + 1] = dimensions[axis] - 1;
  }
}

void vtkBigusVoxelizer::ComputeIndexToWorld(const double spacing[3], const double origin[3], double matrix[16])
{
  const Eigen::Map<const RowMajorMatrix3> direction(this->OutputDirection);
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> indexToWorld(matrix);
  indexToWorld.setIdentity();
  indexToWorld.block<3, 3>(0, 0) = direction * Eigen::Map<const Eigen::Vector3d>(spacing).asDiagonal();
  indexToWorld.block<3, 1>(0, 3) = Eigen::Map<const Eigen::Vector3d>(origin);
}

void vtkBigusVoxelizer::AllocateOutputs(vtkInformationVector* outputs, const int extent[6])
{
  this->Superclass::AllocateOutputs(outputs, extent);
  vtkImageData::GetData(outputs, 0)->SetDirectionMatrix(this->OutputDirection);
}
