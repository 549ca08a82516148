// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusVoxelizer.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "Core/Model/Error.h"
#include "vtkBigusFieldRenderer.h"
#include "vtkErrorCode.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkStreamingDemandDrivenPipeline.h"

vtkStandardNewMacro(vtkBigusVoxelizer);

namespace
{

bigus::ViewOutput ToViewOutput(int mode)
{
  return mode == vtkBigusVoxelizer::ScatteringField ? bigus::ViewOutput::Scattering : bigus::ViewOutput::Intensity;
}

}  // namespace

vtkBigusVoxelizer::vtkBigusVoxelizer() : Renderer(std::make_unique<bigus::FieldRenderer>())
{
  this->SetEngine("auto");
}

vtkBigusVoxelizer::~vtkBigusVoxelizer()
{
  this->SetEngine(nullptr);
}

void vtkBigusVoxelizer::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "OutputSpacing: " << this->OutputSpacing[0] << " " << this->OutputSpacing[1] << " "
     << this->OutputSpacing[2] << (this->ComputeOutputSpacing ? " (automatic)\n" : "\n");
  os << indent << "OutputOrigin: " << this->OutputOrigin[0] << " " << this->OutputOrigin[1] << " "
     << this->OutputOrigin[2] << (this->ComputeOutputOrigin ? " (automatic)\n" : "\n");
  os << indent << "OutputDimensions: " << this->OutputDimensions[0] << " " << this->OutputDimensions[1] << " "
     << this->OutputDimensions[2] << (this->ComputeOutputDimensions ? " (automatic)\n" : "\n");
  os << indent << "OutputDirection:";
  for (double element : this->OutputDirection)
  {
    os << " " << element;
  }
  os << "\n";
  os << indent << "MaximumDimension: " << this->MaximumDimension << "\n";
  os << indent << "OutputMode: " << (this->OutputMode == Intensity ? "Intensity" : "ScatteringField") << "\n";
  os << indent << "OutputScalarType: " << vtkImageScalarTypeNameMacro(this->OutputScalarType) << "\n";
  os << indent << "ElevationSigma: " << this->ElevationSigma << "\n";
  os << indent << "Tolerance: " << this->Tolerance << "\n";
  os << indent << "MaximumOutputPixels: " << this->MaximumOutputPixels << "\n";
  os << indent << "Engine: " << (this->Engine ? this->Engine : "(none)") << "\n";
  os << indent << "Device: " << this->GetDevice() << "\n";
}

void vtkBigusVoxelizer::SetOutputSpacing(double x, double y, double z)
{
  const double spacing[3] = {x, y, z};
  this->SetOutputSpacing(spacing);
}

void vtkBigusVoxelizer::SetOutputSpacing(const double spacing[3])
{
  std::copy(spacing, spacing + 3, this->OutputSpacing);
  this->ComputeOutputSpacing = false;
  this->Modified();
}

void vtkBigusVoxelizer::SetOutputSpacingToDefault()
{
  std::fill_n(this->OutputSpacing, 3, 1.0);
  this->ComputeOutputSpacing = true;
  this->Modified();
}

void vtkBigusVoxelizer::SetOutputOrigin(double x, double y, double z)
{
  const double origin[3] = {x, y, z};
  this->SetOutputOrigin(origin);
}

void vtkBigusVoxelizer::SetOutputOrigin(const double origin[3])
{
  std::copy(origin, origin + 3, this->OutputOrigin);
  this->ComputeOutputOrigin = false;
  this->Modified();
}

void vtkBigusVoxelizer::SetOutputOriginToDefault()
{
  std::fill_n(this->OutputOrigin, 3, 0.0);
  this->ComputeOutputOrigin = true;
  this->Modified();
}

void vtkBigusVoxelizer::SetOutputDimensions(int x, int y, int z)
{
  const int dimensions[3] = {x, y, z};
  this->SetOutputDimensions(dimensions);
}

void vtkBigusVoxelizer::SetOutputDimensions(const int dimensions[3])
{
  std::copy(dimensions, dimensions + 3, this->OutputDimensions);
  this->ComputeOutputDimensions = false;
  this->Modified();
}

void vtkBigusVoxelizer::SetOutputDimensionsToDefault()
{
  std::fill_n(this->OutputDimensions, 3, 1);
  this->ComputeOutputDimensions = true;
  this->Modified();
}

const char* vtkBigusVoxelizer::GetDevice() const
{
  return this->Renderer->Device().c_str();
}

int vtkBigusVoxelizer::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkPolyData");
  return 1;
}

int vtkBigusVoxelizer::RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputs)
{
  this->SetErrorCode(vtkErrorCode::NoError);
  Eigen::Vector3d spacing(this->OutputSpacing), origin(this->OutputOrigin);
  Eigen::Vector3i dimensions(this->OutputDimensions);
  try
  {
    bigus::CheckGrid(spacing.data(), origin.data());  // defaults in there are sound
    const Eigen::Matrix3d direction =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(this->OutputDirection);
    if (!((direction.colwise().norm().array() - 1).abs().maxCoeff() < 1e-6) ||
        !(std::abs(direction.determinant()) > 1e-3))
    {
      throw bigus::Error("OutputDirection must be a 3 x 3 matrix whose columns are unit vectors that span space.");
    }
    if (this->ComputeOutputSpacing || this->ComputeOutputOrigin || this->ComputeOutputDimensions)
    {
      // The grid over the field along the given axes; what was set replaces its part, the rest keeps to its
      // bounds.
      const bigus::FieldGrid grid =
          bigus::GridOver(this->Renderer->Load(bigus::UpdatedInput(this)), direction, this->MaximumDimension);
      const Eigen::Vector3d size = grid.spacing * (grid.dimensions.cast<double>() - Eigen::Vector3d::Ones());
      const Eigen::Vector3d centre = grid.origin + 0.5 * size;
      if (this->ComputeOutputSpacing)
      {
        spacing.setConstant(grid.spacing);
        if (!this->ComputeOutputDimensions)
        {
          for (int axis = 0; axis < 3; ++axis)
          {
            spacing[axis] = dimensions[axis] > 1 && size[axis] > 0 ? size[axis] / (dimensions[axis] - 1) : grid.spacing;
          }
        }
      }
      const Eigen::Vector3d givenOrigin = direction.inverse() * origin;
      if (this->ComputeOutputDimensions)
      {
        for (int axis = 0; axis < 3; ++axis)
        {
          const double low = this->ComputeOutputOrigin ? grid.origin[axis] : givenOrigin[axis];
          const double steps = (grid.origin[axis] + size[axis] - low) / std::abs(spacing[axis]);
          dimensions[axis] = static_cast<int>(std::clamp(std::round(steps), 0.0, 1e9)) + 1;
        }
      }
      if (this->ComputeOutputOrigin)
      {
        origin = direction * (centre - 0.5 * spacing.cwiseProduct(dimensions.cast<double>() - Eigen::Vector3d::Ones()));
      }
    }
    if (dimensions.minCoeff() < 1)
    {
      throw bigus::Error("OutputDimensions are " + std::to_string(dimensions[0]) + " x " +
                         std::to_string(dimensions[1]) + " x " + std::to_string(dimensions[2]) +
                         "; each must be at least 1.");
    }
    bigus::CheckPixelFormat(ToViewOutput(this->OutputMode), this->OutputScalarType);
  }
  catch (const std::exception& error)
  {
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UserError);
    return 0;
  }

  vtkInformation* info = outputs->GetInformationObject(0);
  const int extent[6] = {0, dimensions[0] - 1, 0, dimensions[1] - 1, 0, dimensions[2] - 1};
  info->Set(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), extent, 6);
  info->Set(vtkDataObject::SPACING(), spacing.data(), 3);
  info->Set(vtkDataObject::ORIGIN(), origin.data(), 3);
  info->Set(vtkDataObject::DIRECTION(), this->OutputDirection, 9);
  info->Set(vtkAlgorithm::CAN_PRODUCE_SUB_EXTENT(), 1);
  vtkDataObject::SetPointDataActiveScalarInfo(info, this->OutputScalarType, 1);
  return 1;
}

int vtkBigusVoxelizer::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  return 1;
}

int vtkBigusVoxelizer::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkInformation* info = outputs->GetInformationObject(0);
  vtkImageData* image = vtkImageData::GetData(info);
  image->Initialize();
  this->SetErrorCode(vtkErrorCode::NoError);
  try
  {
    int whole[6], extent[6];
    info->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), whole);
    vtkStreamingDemandDrivenPipeline::GetUpdateExtent(info, extent);
    bigus::CheckOutputSize(extent, this->MaximumOutputPixels);
    if (!this->Engine)
    {
      throw bigus::Error("No Engine is set; \"auto\" takes the fastest.");
    }
    this->Renderer->Upload(vtkPolyData::GetData(inputs[0]), {this->Engine, this->ElevationSigma, this->Tolerance});

    const Eigen::Map<const Eigen::Vector3d> spacing(info->Get(vtkDataObject::SPACING()));
    const Eigen::Map<const Eigen::Vector3d> origin(info->Get(vtkDataObject::ORIGIN()));
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> direction(this->OutputDirection);
    Eigen::Matrix4d indexToWorld = Eigen::Matrix4d::Identity();
    indexToWorld.block<3, 3>(0, 0) = direction * spacing.asDiagonal();
    indexToWorld.block<3, 1>(0, 3) = origin;
    image->SetOrigin(origin.data());
    image->SetSpacing(spacing.data());
    image->SetDirectionMatrix(this->OutputDirection);

    const bigus::ViewOutput output = ToViewOutput(this->OutputMode);
    bigus::AllocatePixels(image, extent, this->OutputScalarType,
                          output == bigus::ViewOutput::Scattering ? "ScatteringField" : "Intensity");
    const bool finished = this->Renderer->Render(indexToWorld, whole, extent, output, false,
                                                 [&](const bigus::FieldRenderer::Band& band)
                                                 {
                                                   bigus::StorePixels(band.image, band.first, band.count, image);
                                                   return bigus::ReportProgress(this, band.fraction);
                                                 });
    if (!finished)
    {
      image->Initialize();  // an empty output is made anew at the next update
    }
    return 1;
  }
  catch (const std::exception& error)
  {
    image->Initialize();
    bigus::ForgetRequests(outputs);
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UserError);
    return 0;
  }
}
