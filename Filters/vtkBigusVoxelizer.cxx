// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusVoxelizer.h"

#include "Core/Slicing/Bands.h"
#include "PipelineSupport.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkObjectFactory.h"

vtkStandardNewMacro(vtkBigusVoxelizer);

namespace
{

using RowMajorMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

}  // namespace

vtkBigusVoxelizer::vtkBigusVoxelizer()
{
  this->SetNumberOfOutputPorts(2);
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

vtkBigusDerivedPropertyMacro(vtkBigusVoxelizer, OutputDimensions, int, 3, 1);

int vtkBigusVoxelizer::RequestInformation(vtkInformation* request, vtkInformationVector** inputs,
                                          vtkInformationVector* outputs)
{
  for (int port = 0; port < 2; ++port)
  {
    outputs->GetInformationObject(port)->Set(vtkDataObject::DIRECTION(), this->OutputDirection, 9);
  }
  return this->Superclass::RequestInformation(request, inputs, outputs);
}

bigus::OutputGrid vtkBigusVoxelizer::ComputeGrid(bigus::GivenGrid given)
{
  if (!this->ComputeOutputDimensions)
  {
    const int* n = this->OutputDimensions;
    given.extent = {0, n[0] - 1, 0, n[1] - 1, 0, n[2] - 1};
  }
  return bigus::VoxelGrid(given, Eigen::Map<const RowMajorMatrix3>(this->OutputDirection),
                          [this] { return this->GridOverInput(this->OutputDirection, this->MaximumDimension); });
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
  for (int port = 0; port < 2; ++port)
  {
    vtkImageData::GetData(outputs, port)->SetDirectionMatrix(this->OutputDirection);
  }
}
