// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusPhantomSource.h"

#include <algorithm>
#include <cstring>
#include <type_traits>

#include "Core/Model/Error.h"
#include "Core/Phantom/Phantom.h"
#include "Core/Phantom/PhantomOptionList.h"
#include "Data/Progress.h"
#include "Data/SweepData.h"
#include "PipelineSupport.h"
#include "vtkDoubleArray.h"
#include "vtkErrorCode.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkStreamingDemandDrivenPipeline.h"

vtkStandardNewMacro(vtkBigusPhantomSource);

namespace
{

/// Whether an option is one number.
template <class T>
constexpr bool IsOne = std::is_arithmetic_v<std::decay_t<T>>;

}  // namespace

vtkBigusPhantomSource::vtkBigusPhantomSource()
{
  this->SetOptions({});
  this->SetNumberOfInputPorts(0);
}

vtkBigusPhantomSource::~vtkBigusPhantomSource() = default;

const char* vtkBigusPhantomSource::GetProbeAsString()
{
  constexpr const char* names[] = {"Linear", "Convex", "Sector"};
  return names[this->Probe];
}

const char* vtkBigusPhantomSource::GetSceneAsString()
{
  constexpr const char* names[] = {"Organ", "Speckle", "Points"};
  return names[this->Scene];
}

void vtkBigusPhantomSource::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Probe: " << this->GetProbeAsString() << "\n";
  os << indent << "Scene: " << this->GetSceneAsString() << "\n";
  os << indent << "NumberOfFrames: " << this->NumberOfFrames << "\n";
  os << indent << "FrameSize: " << this->FrameSize[0] << " " << this->FrameSize[1] << "\n";
  bigus::ForEachPhantomNumber(*this->Options,
                              [&](const bigus::PhantomNumber& number, const auto& value)
                              {
                                if constexpr (IsOne<decltype(value)>)
                                {
                                  os << indent << number.name << ": " << value << "\n";
                                }
                              });
  const double *shift = this->CalibrationShift, *rotation = this->CalibrationRotation;
  os << indent << "CalibrationShift: " << shift[0] << " " << shift[1] << " " << shift[2] << "\n";
  os << indent << "CalibrationRotation: " << rotation[0] << " " << rotation[1] << " " << rotation[2] << "\n";
}

void vtkBigusPhantomSource::SetNumber(const char* name, double value)
{
  bigus::ForEachPhantomNumber(*this->Options,
                              [&](const bigus::PhantomNumber& number, auto& held)
                              {
                                using T = std::decay_t<decltype(held)>;
                                if constexpr (IsOne<T>)
                                {
                                  if (std::strcmp(number.name, name) == 0 && static_cast<double>(held) != value)
                                  {
                                    held = static_cast<T>(value);
                                    this->Modified();
                                  }
                                }
                              });
}

double vtkBigusPhantomSource::GetNumber(const char* name)
{
  double found = 0;
  bigus::ForEachPhantomNumber(*this->Options,
                              [&](const bigus::PhantomNumber& number, const auto& held)
                              {
                                if constexpr (IsOne<decltype(held)>)
                                {
                                  found = std::strcmp(number.name, name) == 0 ? static_cast<double>(held) : found;
                                }
                              });
  return found;
}

void vtkBigusPhantomSource::SetOptions(const bigus::PhantomOptions& options)
{
  this->Options = std::make_unique<bigus::PhantomOptions>(options);
  this->Probe = static_cast<int>(options.probe);
  this->Scene = static_cast<int>(options.scene);
  this->NumberOfFrames = options.frames;
  this->FrameSize[0] = options.width;
  this->FrameSize[1] = options.height;
  std::copy_n(options.calibrationShift.data(), 3, this->CalibrationShift);
  std::copy_n(options.calibrationRotation.data(), 3, this->CalibrationRotation);
  this->Modified();
}

bigus::PhantomOptions vtkBigusPhantomSource::GetOptions()
{
  bigus::PhantomOptions options = *this->Options;
  options.probe = static_cast<bigus::ProbeKind>(this->Probe);
  options.scene = static_cast<bigus::PhantomScene>(this->Scene);
  options.frames = this->NumberOfFrames;
  options.width = this->FrameSize[0];
  options.height = this->FrameSize[1];
  std::copy_n(this->CalibrationShift, 3, options.calibrationShift.data());
  std::copy_n(this->CalibrationRotation, 3, options.calibrationRotation.data());
  return options;
}

int vtkBigusPhantomSource::RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputs)
{
  vtkInformation* info = outputs->GetInformationObject(0);
  this->SetErrorCode(vtkErrorCode::NoError);
  try
  {
    const bigus::PhantomOptions options = bigus::Phantom(this->GetOptions()).Options();
    const int extent[6] = {0, options.width - 1, 0, options.height - 1, 0, options.frames - 1};
    const double origin[3] = {0, 0, 0};
    const double spacing[3] = {1, 1, 1};
    info->Set(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), extent, 6);
    info->Set(vtkDataObject::ORIGIN(), origin, 3);
    info->Set(vtkDataObject::SPACING(), spacing, 3);
    vtkDataObject::SetPointDataActiveScalarInfo(info, VTK_UNSIGNED_CHAR, 1);
    return 1;
  }
  catch (const bigus::Error& error)
  {
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UnknownError);
    if (vtkImageData* output = vtkImageData::GetData(info))
    {
      output->Initialize();  // an earlier result is not the answer to these options
    }
    return 0;
  }
}

int vtkBigusPhantomSource::RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputs)
{
  vtkImageData* output = vtkImageData::GetData(outputs);
  try
  {
    const bigus::Phantom phantom(this->GetOptions());
    const bigus::Sweep sweep = phantom.MakeSweep([this](double share) { return bigus::ReportProgress(this, share); });
    output->Initialize();
    if (sweep.NumberOfFrames() == 0)
    {
      return 1;  // aborted: an empty output is not an error
    }
    bigus::SweepToImage(sweep, output);

    vtkNew<vtkDoubleArray> truth;
    truth->SetName("TrueImageToReference");
    truth->SetNumberOfComponents(16);
    truth->SetNumberOfTuples(sweep.NumberOfFrames());
    for (int k = 0; k < sweep.NumberOfFrames(); ++k)
    {
      const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = phantom.TruePlane(k).ImageToReference();
      truth->SetTypedTuple(k, pose.data());
    }
    output->GetFieldData()->AddArray(truth);
    return 1;
  }
  catch (const bigus::Error& error)
  {
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UnknownError);
    output->Initialize();
    return 0;
  }
}

double vtkBigusPhantomSource::GetScatterersPerResolutionCell()
{
  try
  {
    return bigus::Phantom(this->GetOptions()).ScatterersPerResolutionCell();
  }
  catch (const bigus::Error& error)
  {
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UnknownError);
    return 0;
  }
}

template <class Make>
bool vtkBigusPhantomSource::Compute(vtkMatrix4x4* imageToReference, int width, int height, vtkImageData* image,
                                    const Make& make)
{
  if (!imageToReference || !image)
  {
    vtkErrorMacro("The matrix and the image to write must both be given.");
    this->SetErrorCode(vtkErrorCode::UnknownError);
    return false;
  }
  image->Initialize();
  this->SetErrorCode(vtkErrorCode::NoError);
  try
  {
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> pose(imageToReference->GetData());
    make(bigus::Phantom(this->GetOptions()), bigus::SlicePlane::FromImageToReference(pose, width, height));
    return true;
  }
  catch (const bigus::Error& error)
  {
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UnknownError);
    return false;
  }
}

bool vtkBigusPhantomSource::ComputeTruth(vtkMatrix4x4* imageToReference, int width, int height, vtkImageData* truth)
{
  return this->Compute(imageToReference, width, height, truth,
                       [truth](const bigus::Phantom& phantom, const bigus::SlicePlane& plane)
                       { bigus::SweepToImage(phantom.MakeTruth(plane), truth); });
}

bool vtkBigusPhantomSource::ComputeLabels(vtkMatrix4x4* imageToReference, int width, int height, vtkImageData* labels)
{
  return this->Compute(imageToReference, width, height, labels,
                       [labels](const bigus::Phantom& phantom, const bigus::SlicePlane& plane)
                       {
                         const std::vector<std::uint8_t> values = phantom.Labels(plane);
                         labels->SetDimensions(plane.width, plane.height, 1);
                         labels->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
                         std::copy(values.begin(), values.end(),
                                   static_cast<std::uint8_t*>(labels->GetScalarPointer()));
                       });
}
