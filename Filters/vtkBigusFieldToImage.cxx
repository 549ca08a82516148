// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldToImage.h"

#include <algorithm>
#include <string>

#include "CollectiveExecutive.h"
#include "Core/Model/Error.h"
#include "Data/Progress.h"
#include "FieldRenderer.h"
#include "PipelineSupport.h"
#include "vtkErrorCode.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationExecutivePortVectorKey.h"
#include "vtkInformationVector.h"
#include "vtkMultiProcessController.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"
#include "vtkStreamingDemandDrivenPipeline.h"

namespace
{

bigus::ViewOutput ToViewOutput(int mode)
{
  return mode == vtkBigusFieldToImage::ScatteringField ? bigus::ViewOutput::Scattering : bigus::ViewOutput::Intensity;
}

// Throws Error unless pixels of this type can hold what is wanted.
void CheckPixelFormat(int mode, int scalarType)
{
  if (scalarType != VTK_FLOAT && scalarType != VTK_UNSIGNED_CHAR)
  {
    throw bigus::Error(std::string("OutputScalarType is ") + vtkImageScalarTypeNameMacro(scalarType) +
                       "; float and unsigned char are possible.");
  }
  if (mode == vtkBigusFieldToImage::ScatteringField && scalarType != VTK_FLOAT)
  {
    throw bigus::Error("The scattering field is signed and unbounded; set OutputScalarType to float.");
  }
}

void CheckOutputSize(const int extent[6], vtkIdType maximum)
{
  if (bigus::ExtentSize(extent) > static_cast<double>(maximum))
  {
    throw bigus::Error("The output asked for is " + std::to_string(extent[1] - extent[0] + 1) + " x " +
                       std::to_string(extent[3] - extent[2] + 1) + " x " + std::to_string(extent[5] - extent[4] + 1) +
                       " pixels, more than MaximumOutputPixels (" + std::to_string(maximum) +
                       "). Make it smaller or its spacing larger, or stream it in pieces.");
  }
}

// What the asking port wants together with what the consumers of the others want, so that a filter connected to two
// outputs finds both.
void CombineUpdateExtents(vtkInformation* request, vtkInformationVector* outputs, const int whole[6], int extent[6])
{
  const int asking = std::max(0, request->Get(vtkExecutive::FROM_OUTPUT_PORT()));
  vtkStreamingDemandDrivenPipeline::GetUpdateExtent(outputs->GetInformationObject(asking), extent);
  for (int port = 0; port < outputs->GetNumberOfInformationObjects(); ++port)
  {
    vtkInformation* other = outputs->GetInformationObject(port);
    int wanted[6];
    vtkStreamingDemandDrivenPipeline::GetUpdateExtent(other, wanted);
    if (vtkExecutive::CONSUMERS()->Length(other) > 0 && bigus::ExtentSize(wanted) > 0)
    {
      for (int axis = 0; axis < 3; ++axis)
      {
        extent[2 * axis] = std::min(extent[2 * axis], std::max(wanted[2 * axis], whole[2 * axis]));
        extent[2 * axis + 1] = std::max(extent[2 * axis + 1], std::min(wanted[2 * axis + 1], whole[2 * axis + 1]));
      }
    }
  }
}

// An empty output is made anew at the next update.
void Clear(vtkInformationVector* outputs)
{
  for (int port = 0; port < outputs->GetNumberOfInformationObjects(); ++port)
  {
    vtkDataObject::GetData(outputs, port)->Initialize();
  }
}

}  // namespace

vtkBigusFieldToImage::vtkBigusFieldToImage() : Renderer(std::make_unique<bigus::FieldRenderer>())
{
  this->SetEngine("auto");
}

vtkBigusFieldToImage::~vtkBigusFieldToImage()
{
  this->SetEngine(nullptr);
  this->SetController(nullptr);
}

vtkExecutive* vtkBigusFieldToImage::CreateDefaultExecutive()
{
  bigus::CollectiveExecutive* const executive = bigus::CollectiveExecutive::New();
  executive->Failed = [this](bool isData)
  {
    if (isData)
    {
      this->TellOfNoInput();
    }
  };
  return executive;
}

void vtkBigusFieldToImage::SetController(vtkMultiProcessController* controller)
{
  if (controller != this->Controller)
  {
    vtkSetObjectBodyMacro(Controller, vtkMultiProcessController, controller);
    this->Renderer->SetParts(controller ? std::make_unique<bigus::FieldParts>(controller) : nullptr);
  }
}

const bigus::FieldParts* vtkBigusFieldToImage::Parts() const
{
  return this->Renderer->Parts();
}

void vtkBigusFieldToImage::Agree(const std::function<void()>& work)
{
  if (this->Parts())
  {
    this->Parts()->Agree(work);
  }
  else
  {
    work();
  }
}

void vtkBigusFieldToImage::TellOfNoInput()
{
  if (this->WaitsForInput && this->Parts())
  {
    this->WaitsForInput = false;
    try
    {
      this->Parts()->Agree([] { throw bigus::Error("its part of the field could not be made"); });
    }
    catch (const bigus::Error& error)
    {
      vtkErrorMacro(<< error.what());
      this->SetErrorCode(vtkErrorCode::UserError);
    }
  }
}

void vtkBigusFieldToImage::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "OutputSpacing: " << this->OutputSpacing[0] << " " << this->OutputSpacing[1] << " "
     << this->OutputSpacing[2] << (this->ComputeOutputSpacing ? " (default)\n" : "\n");
  os << indent << "OutputOrigin: " << this->OutputOrigin[0] << " " << this->OutputOrigin[1] << " "
     << this->OutputOrigin[2] << (this->ComputeOutputOrigin ? " (default)\n" : "\n");
  os << indent << "OutputMode: " << (this->OutputMode == Intensity ? "Intensity" : "ScatteringField") << "\n";
  os << indent << "OutputScalarType: " << vtkImageScalarTypeNameMacro(this->OutputScalarType) << "\n";
  os << indent << "ElevationSigma: " << this->ElevationSigma << "\n";
  os << indent << "Tolerance: " << this->Tolerance << "\n";
  os << indent << "MaximumOutputPixels: " << this->MaximumOutputPixels << "\n";
  os << indent << "Controller: " << this->Controller << "\n";
  os << indent << "Engine: " << (this->Engine ? this->Engine : "(none)") << "\n";
  os << indent << "Device: " << this->GetDevice() << "\n";
}

void vtkBigusFieldToImage::SetOutputSpacing(double x, double y, double z)
{
  const double spacing[3] = {x, y, z};
  this->SetOutputSpacing(spacing);
}

void vtkBigusFieldToImage::SetOutputSpacing(const double spacing[3])
{
  if (bigus::GiveValues(spacing, this->OutputSpacing, this->ComputeOutputSpacing))
  {
    this->Modified();
  }
}

void vtkBigusFieldToImage::SetOutputSpacingToDefault()
{
  if (bigus::TakeValuesBack(1.0, this->OutputSpacing, this->ComputeOutputSpacing))
  {
    this->Modified();
  }
}

void vtkBigusFieldToImage::SetOutputOrigin(double x, double y, double z)
{
  const double origin[3] = {x, y, z};
  this->SetOutputOrigin(origin);
}

void vtkBigusFieldToImage::SetOutputOrigin(const double origin[3])
{
  if (bigus::GiveValues(origin, this->OutputOrigin, this->ComputeOutputOrigin))
  {
    this->Modified();
  }
}

void vtkBigusFieldToImage::SetOutputOriginToDefault()
{
  if (bigus::TakeValuesBack(0.0, this->OutputOrigin, this->ComputeOutputOrigin))
  {
    this->Modified();
  }
}

const char* vtkBigusFieldToImage::GetDevice() const
{
  return this->Renderer->Device().c_str();
}

const bigus::GaussianField& vtkBigusFieldToImage::UpdatedField()
{
  int port = 0;
  if (vtkAlgorithm* producer = this->GetInputAlgorithm(0, 0, port))
  {
    producer->Update(port);
  }
  const bigus::GaussianField* field = nullptr;
  this->Agree([&] { field = &this->Renderer->Load(vtkPolyData::SafeDownCast(this->GetInputDataObject(0, 0))); });
  return *field;
}

int vtkBigusFieldToImage::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkPolyData");
  return 1;
}

int vtkBigusFieldToImage::RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputs)
{
  this->SetErrorCode(vtkErrorCode::NoError);
  double spacing[3], origin[3];
  int extent[6];
  std::copy_n(this->OutputSpacing, 3, spacing);
  std::copy_n(this->OutputOrigin, 3, origin);
  try
  {
    bigus::CheckGrid(spacing, origin);  // defaults in there are sound
    this->ComputeGrid(spacing, origin, extent);
    CheckPixelFormat(this->OutputMode, this->OutputScalarType);
  }
  catch (const std::exception& error)
  {
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UserError);
    return 0;
  }
  for (int port = 0; port < outputs->GetNumberOfInformationObjects(); ++port)
  {
    vtkInformation* info = outputs->GetInformationObject(port);
    info->Set(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), extent, 6);
    info->Set(vtkDataObject::SPACING(), spacing, 3);
    info->Set(vtkDataObject::ORIGIN(), origin, 3);
    info->Set(vtkAlgorithm::CAN_PRODUCE_SUB_EXTENT(), 1);
  }
  vtkDataObject::SetPointDataActiveScalarInfo(outputs->GetInformationObject(0), this->OutputScalarType, 1);
  return 1;
}

int vtkBigusFieldToImage::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  this->WaitsForInput = true;
  return 1;
}

int vtkBigusFieldToImage::RequestData(vtkInformation* request, vtkInformationVector** inputs,
                                      vtkInformationVector* outputs)
{
  Clear(outputs);
  this->SetErrorCode(vtkErrorCode::NoError);
  this->WaitsForInput = false;
  try
  {
    vtkInformation* info = outputs->GetInformationObject(0);
    int whole[6], extent[6];
    info->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), whole);
    this->Agree(
        [&]
        {
          CombineUpdateExtents(request, outputs, whole, extent);
          CheckOutputSize(extent, this->MaximumOutputPixels);
          if (!this->Engine)
          {
            throw bigus::Error("No Engine is set; \"auto\" takes the fastest.");
          }
        });
    this->Renderer->Upload(vtkPolyData::GetData(inputs[0]), {this->Engine, this->ElevationSigma, this->Tolerance});

    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> indexToWorld;
    bigus::Slab slab;
    this->Agree(
        [&]
        {
          this->ComputeIndexToWorld(info->Get(vtkDataObject::SPACING()), info->Get(vtkDataObject::ORIGIN()),
                                    indexToWorld.data());
          slab = this->ComputeSlab();
          this->AllocateOutputs(outputs, extent);
        });
    const bool finished =
        this->Renderer->Render(indexToWorld, whole, extent, ToViewOutput(this->OutputMode), this->NeedsCoverage(), slab,
                               [&](const bigus::PixelBand& band)
                               {
                                 this->StoreBand(band, outputs);
                                 return bigus::ReportProgress(this, band.fraction);
                               });
    if (!finished)
    {
      Clear(outputs);
    }
    return 1;
  }
  catch (const std::exception& error)
  {
    Clear(outputs);
    bigus::ForgetRequests(outputs);
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UserError);
    return 0;
  }
}

bigus::Slab vtkBigusFieldToImage::ComputeSlab()
{
  return {};
}

void vtkBigusFieldToImage::AllocateOutputs(vtkInformationVector* outputs, const int extent[6])
{
  vtkInformation* info = outputs->GetInformationObject(0);
  vtkImageData* image = vtkImageData::GetData(info);
  image->SetOrigin(info->Get(vtkDataObject::ORIGIN()));
  image->SetSpacing(info->Get(vtkDataObject::SPACING()));
  bigus::AllocatePixels(image, extent, this->OutputScalarType,
                        this->OutputMode == ScatteringField ? "ScatteringField" : "Intensity");
}

void vtkBigusFieldToImage::StoreBand(const bigus::PixelBand& band, vtkInformationVector* outputs)
{
  bigus::StorePixels(band.image, band.first, band.count, vtkImageData::GetData(outputs, 0));
}
