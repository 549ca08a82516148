// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusTrackedReader.h"

#include "IO/ErrorCode.h"
#include "IO/Poses.h"
#include "vtkDemandDrivenPipeline.h"
#include "vtkInformation.h"

vtkBigusTrackedReader::vtkBigusTrackedReader()
{
  this->SetFromFrame("Image");
  this->SetToFrame("Reference");
  this->SetNumberOfInputPorts(0);
  this->SetNumberOfOutputPorts(1);
}

vtkBigusTrackedReader::~vtkBigusTrackedReader()
{
  this->SetFileName(nullptr);
  this->SetConfigFileName(nullptr);
  this->SetFromFrame(nullptr);
  this->SetToFrame(nullptr);
}

vtkTypeBool vtkBigusTrackedReader::ProcessRequest(vtkInformation* request, vtkInformationVector** inputs,
                                                  vtkInformationVector* outputs)
{
  if (request->Has(vtkDemandDrivenPipeline::REQUEST_INFORMATION()))
  {
    return this->RequestInformation(request, inputs, outputs);
  }
  if (request->Has(vtkDemandDrivenPipeline::REQUEST_DATA()))
  {
    return this->RequestData(request, inputs, outputs);
  }
  return this->Superclass::ProcessRequest(request, inputs, outputs);
}

std::string vtkBigusTrackedReader::RequireFileName() const
{
  bigus::Require(bigus::FileFault::NoName, this->FileName && *this->FileName, "FileName is not set");
  return this->FileName;
}

bigus::PoseOptions vtkBigusTrackedReader::GetPoseOptions() const
{
  bigus::PoseOptions options;
  options.fromFrame = this->FromFrame ? this->FromFrame : "";
  options.toFrame = this->ToFrame ? this->ToFrame : "";
  options.configFileName = this->ConfigFileName ? this->ConfigFileName : "";
  options.imageSpacing = {this->ImageSpacing[0], this->ImageSpacing[1]};
  options.assumeMissingStatusOK = this->AssumeMissingStatusOK != 0;
  options.allowReflectedPoses = this->AllowReflectedPoses != 0;
  return options;
}

int vtkBigusTrackedReader::Fail(const std::exception& error)
{
  vtkErrorMacro(<< bigus::MessageOf(error));
  this->SetErrorCode(bigus::ErrorCodeOf(error));
  return 0;
}

void vtkBigusTrackedReader::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  const auto name = [](const char* text) { return text ? text : "(none)"; };
  os << indent << "FileName: " << name(this->FileName) << "\n";
  os << indent << "ConfigFileName: " << name(this->ConfigFileName) << "\n";
  os << indent << "FromFrame: " << name(this->FromFrame) << "\n";
  os << indent << "ToFrame: " << name(this->ToFrame) << "\n";
  os << indent << "ImageSpacing: " << this->ImageSpacing[0] << " " << this->ImageSpacing[1] << "\n";
  os << indent << "AssumeMissingStatusOK: " << this->AssumeMissingStatusOK << "\n";
  os << indent << "AllowReflectedPoses: " << this->AllowReflectedPoses << "\n";
}
