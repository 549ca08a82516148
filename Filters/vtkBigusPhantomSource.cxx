// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusPhantomSource.h"

#include <algorithm>

#include "Core/Model/Error.h"
#include "Core/Phantom/Phantom.h"
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

vtkBigusPhantomSource::vtkBigusPhantomSource()
{
  const bigus::PhantomOptions defaults;
  this->Probe = static_cast<int>(defaults.probe);
  this->Scene = static_cast<int>(defaults.scene);
  this->Seed = defaults.seed;
  this->NumberOfFrames = defaults.frames;
  this->FrameSize[0] = defaults.width;
  this->FrameSize[1] = defaults.height;
  this->PixelSize = defaults.pixelSize;
  this->ProbeRadius = defaults.probeRadius;
  this->HalfAngle = defaults.halfAngle;
  this->Frequency = defaults.frequency;
  this->AxialSigma = defaults.axialSigma;
  this->LateralSigma = defaults.lateralSigma;
  this->ElevationSigma = defaults.elevationSigma;
  this->ScattererDensity = defaults.scattererDensity;
  this->Attenuation = defaults.attenuation;
  this->DynamicRange = defaults.dynamicRange;
  this->WhiteLevel = defaults.whiteLevel;
  this->FrameSpacing = defaults.frameSpacing;
  this->SpeedVariation = defaults.speedVariation;
  this->Tilt = defaults.tilt;
  this->Wander = defaults.wander;
  this->SweepAngle = defaults.sweepAngle;
  this->Shake = defaults.shake;
  this->ShakeRotation = defaults.shakeRotation;
  this->ShakeCorrelation = defaults.shakeCorrelation;
  this->FrameRate = defaults.frameRate;
  this->TrackingNoise = defaults.trackingNoise;
  this->TrackingRotationNoise = defaults.trackingRotationNoise;
  this->Passes = defaults.passes;
  this->DroppedShare = defaults.droppedShare;
  this->NoiseCorrelation = defaults.noiseCorrelation;
  this->TrackingDrift = defaults.trackingDrift;
  this->TrackingRotationDrift = defaults.trackingRotationDrift;
  this->OutlierShare = defaults.outlierShare;
  this->OutlierSize = defaults.outlierSize;
  this->TrackingDelay = defaults.trackingDelay;
  this->TrackingQuantum = defaults.trackingQuantum;
  this->TrackingRotationQuantum = defaults.trackingRotationQuantum;
  std::copy_n(defaults.calibrationShift.data(), 3, this->CalibrationShift);
  std::copy_n(defaults.calibrationRotation.data(), 3, this->CalibrationRotation);
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
  os << indent << "Seed: " << this->Seed << "\n";
  os << indent << "NumberOfFrames: " << this->NumberOfFrames << "\n";
  os << indent << "FrameSize: " << this->FrameSize[0] << " " << this->FrameSize[1] << "\n";
  os << indent << "PixelSize: " << this->PixelSize << "\n";
  os << indent << "ProbeRadius: " << this->ProbeRadius << "\n";
  os << indent << "HalfAngle: " << this->HalfAngle << "\n";
  os << indent << "Frequency: " << this->Frequency << "\n";
  os << indent << "AxialSigma: " << this->AxialSigma << "\n";
  os << indent << "LateralSigma: " << this->LateralSigma << "\n";
  os << indent << "ElevationSigma: " << this->ElevationSigma << "\n";
  os << indent << "ScattererDensity: " << this->ScattererDensity << "\n";
  os << indent << "Attenuation: " << this->Attenuation << "\n";
  os << indent << "DynamicRange: " << this->DynamicRange << "\n";
  os << indent << "WhiteLevel: " << this->WhiteLevel << "\n";
  os << indent << "FrameSpacing: " << this->FrameSpacing << "\n";
  os << indent << "SpeedVariation: " << this->SpeedVariation << "\n";
  os << indent << "Tilt: " << this->Tilt << "\n";
  os << indent << "Wander: " << this->Wander << "\n";
  os << indent << "SweepAngle: " << this->SweepAngle << "\n";
  os << indent << "Shake: " << this->Shake << "\n";
  os << indent << "ShakeRotation: " << this->ShakeRotation << "\n";
  os << indent << "ShakeCorrelation: " << this->ShakeCorrelation << "\n";
  os << indent << "FrameRate: " << this->FrameRate << "\n";
  os << indent << "TrackingNoise: " << this->TrackingNoise << "\n";
  os << indent << "TrackingRotationNoise: " << this->TrackingRotationNoise << "\n";
  os << indent << "Passes: " << this->Passes << "\n";
  os << indent << "DroppedShare: " << this->DroppedShare << "\n";
  os << indent << "NoiseCorrelation: " << this->NoiseCorrelation << "\n";
  os << indent << "TrackingDrift: " << this->TrackingDrift << "\n";
  os << indent << "TrackingRotationDrift: " << this->TrackingRotationDrift << "\n";
  os << indent << "OutlierShare: " << this->OutlierShare << "\n";
  os << indent << "OutlierSize: " << this->OutlierSize << "\n";
  os << indent << "TrackingDelay: " << this->TrackingDelay << "\n";
  os << indent << "TrackingQuantum: " << this->TrackingQuantum << "\n";
  os << indent << "TrackingRotationQuantum: " << this->TrackingRotationQuantum << "\n";
  const double* shift = this->CalibrationShift;
  os << indent << "CalibrationShift: " << shift[0] << " " << shift[1] << " " << shift[2] << "\n";
  const double* rotation = this->CalibrationRotation;
  os << indent << "CalibrationRotation: " << rotation[0] << " " << rotation[1] << " " << rotation[2] << "\n";
}

bigus::PhantomOptions vtkBigusPhantomSource::GetOptions()
{
  bigus::PhantomOptions options;
  options.probe = static_cast<bigus::ProbeKind>(this->Probe);
  options.scene = static_cast<bigus::PhantomScene>(this->Scene);
  options.seed = this->Seed;
  options.frames = this->NumberOfFrames;
  options.width = this->FrameSize[0];
  options.height = this->FrameSize[1];
  options.pixelSize = this->PixelSize;
  options.probeRadius = this->ProbeRadius;
  options.halfAngle = this->HalfAngle;
  options.frequency = this->Frequency;
  options.axialSigma = this->AxialSigma;
  options.lateralSigma = this->LateralSigma;
  options.elevationSigma = this->ElevationSigma;
  options.scattererDensity = this->ScattererDensity;
  options.attenuation = this->Attenuation;
  options.dynamicRange = this->DynamicRange;
  options.whiteLevel = this->WhiteLevel;
  options.frameSpacing = this->FrameSpacing;
  options.speedVariation = this->SpeedVariation;
  options.tilt = this->Tilt;
  options.wander = this->Wander;
  options.sweepAngle = this->SweepAngle;
  options.shake = this->Shake;
  options.shakeRotation = this->ShakeRotation;
  options.shakeCorrelation = this->ShakeCorrelation;
  options.frameRate = this->FrameRate;
  options.trackingNoise = this->TrackingNoise;
  options.trackingRotationNoise = this->TrackingRotationNoise;
  options.passes = this->Passes;
  options.droppedShare = this->DroppedShare;
  options.noiseCorrelation = this->NoiseCorrelation;
  options.trackingDrift = this->TrackingDrift;
  options.trackingRotationDrift = this->TrackingRotationDrift;
  options.outlierShare = this->OutlierShare;
  options.outlierSize = this->OutlierSize;
  options.trackingDelay = this->TrackingDelay;
  options.trackingQuantum = this->TrackingQuantum;
  options.trackingRotationQuantum = this->TrackingRotationQuantum;
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
