// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldToImage.h"

#include <algorithm>
#include <optional>
#include <string>

#include "CollectiveExecutive.h"
#include "Core/Model/Error.h"
#include "Core/Slicing/Pixels.h"
#include "Core/StandardError/StandardError.h"
#include "Data/FieldData.h"
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

struct vtkBigusFieldToImage::Errors
{
  std::unique_ptr<const bigus::StandardError> standardError;
  vtkPolyData* field = nullptr;  // what it was read from, and when
  vtkMTimeType time = 0;
};

namespace
{

bigus::ViewOutput ToViewOutput(int mode)
{
  return mode == vtkBigusFieldToImage::ScatteringField ? bigus::ViewOutput::Scattering : bigus::ViewOutput::Intensity;
}

const char* NameOf(int mode)
{
  const char* const names[] = {"Intensity", "ScatteringField", "LabelShare"};
  return names[mode];
}

bigus::Extent ToExtent(const int extent[6])
{
  bigus::Extent values;
  std::copy_n(extent, 6, values.begin());
  return values;
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
    if (vtkExecutive::CONSUMERS()->Length(other) > 0 && bigus::ExtentSize(ToExtent(wanted)) > 0)
    {
      for (int axis = 0; axis < 3; ++axis)
      {
        extent[2 * axis] = std::min(extent[2 * axis], std::max(wanted[2 * axis], whole[2 * axis]));
        extent[2 * axis + 1] = std::max(extent[2 * axis + 1], std::min(wanted[2 * axis + 1], whole[2 * axis + 1]));
      }
    }
  }
}

/// A part of an image of floats, row by row; false where the image does not hold all of it.
bool CopyPart(vtkImageData* image, const int part[6], float* to)
{
  const int* extent = image->GetExtent();
  for (int axis = 0; axis < 3; ++axis)
  {
    if (part[2 * axis] < extent[2 * axis] || part[2 * axis + 1] > extent[2 * axis + 1])
    {
      return false;
    }
  }
  for (int z = part[4]; z <= part[5]; ++z)
  {
    for (int y = part[2]; y <= part[3]; ++y)
    {
      to = std::copy_n(static_cast<const float*>(image->GetScalarPointer(part[0], y, z)), part[1] - part[0] + 1, to);
    }
  }
  return true;
}

}  // namespace

vtkBigusFieldToImage::vtkBigusFieldToImage()
    : Kept(std::make_unique<Errors>()), Renderer(std::make_unique<bigus::FieldRenderer>())
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
    this->Renderer->SetParts(bigus::FieldParts::Of(controller));
  }
}

void vtkBigusFieldToImage::Agree(const std::function<void()>& work)
{
  this->Renderer->Parts().Agree(work);
}

void vtkBigusFieldToImage::TellOfNoInput()
{
  if (!this->WaitsForInput || !this->Controller)
  {
    return;
  }
  this->WaitsForInput = false;
  try
  {
    this->Agree([] { throw bigus::Error("its part of the field could not be made"); });
  }
  catch (const bigus::Error& error)
  {
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UserError);
  }
}

void vtkBigusFieldToImage::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "OutputSpacing: " << this->OutputSpacing[0] << " " << this->OutputSpacing[1] << " "
     << this->OutputSpacing[2] << (this->ComputeOutputSpacing ? " (default)\n" : "\n");
  os << indent << "OutputOrigin: " << this->OutputOrigin[0] << " " << this->OutputOrigin[1] << " "
     << this->OutputOrigin[2] << (this->ComputeOutputOrigin ? " (default)\n" : "\n");
  os << indent << "OutputMode: " << NameOf(this->OutputMode) << "\n";
  os << indent << "LabelValue: " << this->LabelValue << "\n";
  os << indent << "OutputScalarType: " << vtkImageScalarTypeNameMacro(this->OutputScalarType) << "\n";
  os << indent << "ElevationSigma: " << this->ElevationSigma << "\n";
  os << indent << "Tolerance: " << this->Tolerance << "\n";
  os << indent << "MaximumOutputPixels: " << this->MaximumOutputPixels << "\n";
  os << indent << "GenerateStandardErrorOutput: " << (this->GenerateStandardErrorOutput ? "On\n" : "Off\n");
  os << indent << "Controller: " << this->Controller << "\n";
  os << indent << "Engine: " << (this->Engine ? this->Engine : "(none)") << "\n";
  os << indent << "Device: " << this->GetDevice() << "\n";
}

void vtkBigusFieldToImage::SetOutputSpacing(double x, double y, double z)
{
  const double spacing[3] = {x, y, z};
  this->SetOutputSpacing(spacing);
}

vtkBigusDerivedPropertyMacro(vtkBigusFieldToImage, OutputSpacing, double, 3, 1.0);

void vtkBigusFieldToImage::SetOutputOrigin(double x, double y, double z)
{
  const double origin[3] = {x, y, z};
  this->SetOutputOrigin(origin);
}

vtkBigusDerivedPropertyMacro(vtkBigusFieldToImage, OutputOrigin, double, 3, 0.0);

const char* vtkBigusFieldToImage::GetDevice() const
{
  return this->Renderer->Device().c_str();
}

bigus::OutputGrid vtkBigusFieldToImage::GridOverInput(const double axes[9], int maximumDimension)
{
  int port = 0;
  if (vtkAlgorithm* producer = this->GetInputAlgorithm(0, 0, port))
  {
    producer->Update(port);
  }
  Eigen::AlignedBox3d bounds;
  this->Agree(
      [&]
      {
        const auto& field = this->Renderer->Load(vtkPolyData::SafeDownCast(this->GetInputDataObject(0, 0)));
        bounds = bigus::BoundsAlong(field, Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(axes),
                                    this->Renderer->Parts().Others());
      });
  return bigus::GridOver(bounds, maximumDimension);
}

int vtkBigusFieldToImage::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkPolyData");
  return 1;
}

int vtkBigusFieldToImage::RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputs)
{
  this->SetErrorCode(vtkErrorCode::NoError);
  bigus::OutputGrid grid;
  try
  {
    bigus::GivenGrid given;
    if (!this->ComputeOutputSpacing)
    {
      given.spacing = Eigen::Vector3d(this->OutputSpacing);
    }
    if (!this->ComputeOutputOrigin)
    {
      given.origin = Eigen::Vector3d(this->OutputOrigin);
    }
    bigus::CheckGiven(given);
    grid = this->ComputeGrid(given);
    bigus::CheckPixelType(vtkImageScalarTypeNameMacro(this->OutputScalarType), ToViewOutput(this->OutputMode));
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
    info->Set(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), grid.extent.data(), 6);
    info->Set(vtkDataObject::SPACING(), grid.spacing.data(), 3);
    info->Set(vtkDataObject::ORIGIN(), grid.origin.data(), 3);
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
  this->WaitsForInput = false;
  const auto work = [&]
  {
    vtkInformation* info = outputs->GetInformationObject(0);
    int whole[6], extent[6];
    info->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), whole);
    this->Agree(
        [&]
        {
          CombineUpdateExtents(request, outputs, whole, extent);
          bigus::CheckOutputSize(ToExtent(extent), this->MaximumOutputPixels);
          bigus::Require(this->Engine, "No Engine is set; \"auto\" takes the fastest.");
        });
    this->Renderer->SetSeesDirections(this->SeesDirections());
    this->Renderer->SetLabel(this->OutputMode == LabelShare ? std::optional<int>(this->LabelValue) : std::nullopt);
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
    const bigus::GridPart grid{indexToWorld, ToExtent(whole), ToExtent(extent)};
    const double share = this->GenerateStandardErrorOutput ? 0.5 : 1;  // of the work
    const bool finished = this->Renderer->Render(grid, ToViewOutput(this->OutputMode), this->NeedsCoverage(), slab,
                                                 [&](const bigus::PixelBand& band)
                                                 {
                                                   this->StoreBand(band, outputs);
                                                   return bigus::ReportProgress(this, share * band.fraction);
                                                 });
    const bool isKept = this->KeepsIntensities() && slab.planes == 1;
    const auto render = [&](const int* part, float* image)
    {
      if (!isKept || !CopyPart(vtkImageData::GetData(info), part, image))
      {
        this->Renderer->Render({indexToWorld, grid.whole, ToExtent(part)}, bigus::ViewOutput::Intensity, false, {},
                               [image](const bigus::PixelBand& band)
                               {
                                 std::copy_n(band.image, band.count, image + band.first);
                                 return true;
                               });
      }
      return bigus::ReportProgress(this, share + (1 - share) * (part[4] - extent[4] + 1) / (extent[5] - extent[4] + 1));
    };
    if (!finished || !this->CompleteOutputs(grid, render, outputs))
    {
      bigus::ClearOutputs(outputs);
    }
  };
  return bigus::Execute(this, outputs, work);
}

bool vtkBigusFieldToImage::CompleteOutputs(const bigus::GridPart& grid,
                                           const std::function<bool(const int*, float*)>& render,
                                           vtkInformationVector* outputs)
{
  if (!this->GenerateStandardErrorOutput || bigus::ExtentSize(grid.extent) <= 0)
  {
    return true;
  }
  auto* sigma = static_cast<float*>(vtkImageData::GetData(outputs, this->StandardErrorPort)->GetScalarPointer());
  return this->Kept->standardError->Evaluate(
      grid, [&](const bigus::Extent& part, float* image) { return render(part.data(), image); }, sigma,
      !this->Renderer->SeesDirections());
}

vtkPolyData* vtkBigusFieldToImage::WholeField(const char* output)
{
  bigus::Require(!this->Controller || this->Controller->GetNumberOfProcesses() <= 1, output,
                 ": it is of whole fields, and several processes have parts of one.");
  return vtkPolyData::SafeDownCast(this->GetInputDataObject(0, 0));
}

bigus::LabelledField& vtkBigusFieldToImage::Labelled()
{
  this->WholeField("GenerateLabelOutput");
  return this->Renderer->Labelled();
}

void vtkBigusFieldToImage::LoadStandardError()
{
  vtkPolyData* const field = this->WholeField("GenerateStandardErrorOutput");
  bigus::Require(this->OutputMode != LabelShare,
                 "GenerateStandardErrorOutput: it is that of an intensity; set OutputMode to Intensity.");
  if (this->Kept->field == field && this->Kept->time == field->GetMTime())
  {
    return;
  }
  *this->Kept = {};
  const std::string bytes = bigus::StandardErrorOf(field);
  bigus::Require(!bytes.empty(),
                 "GenerateStandardErrorOutput: the field has no array StandardError; bigus train keeps it in a .vtp.");
  *this->Kept = {std::make_unique<bigus::StandardError>(bytes), field, field->GetMTime()};
}

const bigus::StandardError* vtkBigusFieldToImage::KeptStandardError() const
{
  return this->Kept->standardError.get();
}

vtkImageData* vtkBigusFieldToImage::GetStandardErrorOutput()
{
  return vtkImageData::SafeDownCast(this->GetOutputDataObject(this->StandardErrorPort));
}

double vtkBigusFieldToImage::NearnessOfView() const
{
  return this->Renderer->ViewNearness();
}

double vtkBigusFieldToImage::MeanOfCoverage() const
{
  return this->Renderer->MeanCoverage();
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
  bigus::AllocatePixels(image, extent, this->OutputScalarType, NameOf(this->OutputMode));
  if (this->GenerateStandardErrorOutput)
  {
    this->LoadStandardError();
    vtkImageData* sigma = vtkImageData::GetData(outputs, this->StandardErrorPort);
    sigma->SetOrigin(image->GetOrigin());
    sigma->SetSpacing(image->GetSpacing());
    bigus::AllocatePixels(sigma, extent, VTK_FLOAT, "StandardError");
  }
}

void vtkBigusFieldToImage::StoreBand(const bigus::PixelBand& band, vtkInformationVector* outputs)
{
  bigus::StorePixels(band.image, band.first, band.count, vtkImageData::GetData(outputs, 0));
}
