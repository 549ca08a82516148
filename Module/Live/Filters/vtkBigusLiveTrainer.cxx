// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusLiveTrainer.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <future>
#include <limits>

#include "Core/Model/Error.h"
#include "Core/Trainer/Provenance.h"
#include "Data/FieldData.h"
#include "Data/Progress.h"
#include "Data/Provenance.h"
#include "Data/SweepData.h"
#include "Live/LiveSession.h"
#include "PipelineSupport.h"
#include "vtkErrorCode.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkMatrix3x3.h"
#include "vtkMatrix4x4.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"
#include "vtkStreamingDemandDrivenPipeline.h"

vtkStandardNewMacro(vtkBigusLiveTrainer);

namespace
{

/// Frames of a sweep that are handed over before the session is waited for, so that none is dropped.
constexpr int kTogether = 16;

/// How often the pipeline hears of a training that runs on another thread.
constexpr std::chrono::milliseconds kReport(50);

/// When frames were taken, s; without timestamps each a second after the one before, the first after `last`.
std::vector<double> TimesOf(const bigus::Sweep& sweep, double last)
{
  std::vector<double> times = sweep.timestamps;
  while (times.size() < static_cast<std::size_t>(sweep.NumberOfFrames()))
  {
    times.push_back(last += 1);
  }
  return times;
}

Eigen::Matrix4d ToEigen(vtkMatrix4x4* matrix)
{
  bigus::Require(matrix, "There is no matrix.");
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(matrix->GetData());
}

bigus::LiveFrame ToFrame(vtkImageData* image, const Eigen::Matrix4d& imageToReference, double seconds)
{
  bigus::Require(image && image->GetNumberOfPoints() != 0, "Live frame: there is no image.");
  int extent[6];
  image->GetExtent(extent);
  bigus::Require(image->GetScalarType() == VTK_UNSIGNED_CHAR && image->GetNumberOfScalarComponents() == 1 &&
                     extent[4] == extent[5],
                 "Live frame: the image has ", image->GetNumberOfScalarComponents(), " components of ",
                 image->GetScalarTypeAsString(), " and ", extent[5] - extent[4] + 1,
                 " slices; it must have one of unsigned char, and one slice. Use vtkImageLuminance for colours, "
                 "vtkImageShiftScale for other types.");
  bigus::LiveFrame frame;
  frame.width = extent[1] - extent[0] + 1;
  frame.height = extent[3] - extent[2] + 1;
  const auto* pixels = static_cast<const std::uint8_t*>(image->GetScalarPointer());
  frame.pixels.assign(pixels, pixels + static_cast<std::size_t>(frame.width) * frame.height);
  // A cropped image keeps its place, because the matrix acts on VTK's indices.
  frame.imageToReference = imageToReference;
  frame.imageToReference.col(3) += imageToReference.col(0) * extent[0] + imageToReference.col(1) * extent[2];
  frame.timestamp = seconds;
  return frame;
}

}  // namespace

vtkBigusLiveTrainer::vtkBigusLiveTrainer()
{
  this->SetNumberOfInputPorts(1);
  this->SetEngine("auto");
}

vtkBigusLiveTrainer::~vtkBigusLiveTrainer()
{
  this->SetEngine(nullptr);
}

void vtkBigusLiveTrainer::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "FinishTime: " << this->FinishTime << "\n";
  os << indent << "Engine: " << (this->Engine ? this->Engine : "(none)") << "\n";
  os << indent << "Seed: " << this->Seed << "\n";
  os << indent << "Window: " << this->Window << "\n";
  os << indent << "MaximumFrames: " << this->MaximumFrames << "\n";
  os << indent << "MaximumGaussians: " << this->MaximumGaussians << "\n";
  os << indent << "MemoryLimit: " << this->MemoryLimit << "\n";
  os << indent << "NumberOfFrames: " << this->GetNumberOfFrames() << "\n";
  os << indent << "NumberOfGaussians: " << this->GetNumberOfGaussians() << "\n";
}

bigus::LiveSession& vtkBigusLiveTrainer::Session()
{
  if (!this->Live)
  {
    bigus::LiveOptions options;
    options.training.engine = this->Engine ? this->Engine : "auto";
    options.training.seed = static_cast<std::uint64_t>(this->Seed);
    options.window = this->Window;
    options.maximumFrames = static_cast<std::size_t>(std::max(this->MaximumFrames, this->Window));
    options.maximumGaussians = static_cast<std::size_t>(this->MaximumGaussians);
    options.memory = 1e9 * this->MemoryLimit;
    bigus::Engine::Create(options.training.engine);  // an unknown name is said here and now
    this->Live = std::make_unique<bigus::LiveSession>(options);
  }
  return *this->Live;
}

bool vtkBigusLiveTrainer::AddFrame(vtkImageData* image, vtkMatrix4x4* imageToReference, double seconds)
{
  try
  {
    this->Session().Add(ToFrame(image, ToEigen(imageToReference), seconds));
    this->LastTime = seconds;
    return true;
  }
  catch (const std::exception& error)
  {
    vtkErrorMacro(<< error.what());
    return false;
  }
}

/// Frames `first` to `last - 1`, when none of them waits any more, or as many as `goOn`, told how far it is, agrees to.
/// Returns how many.
int vtkBigusLiveTrainer::HandOver(const bigus::Sweep& sweep, const std::vector<double>& times, int first, int last,
                                  const std::function<bool(double)>& goOn)
{
  bigus::LiveSession& session = this->Session();
  std::vector<float> intensities(sweep.PixelsPerFrame());
  for (int begin = first; begin < last; begin += kTogether)
  {
    if (goOn && !goOn(static_cast<double>(begin - first) / (last - first)))
    {
      return begin - first;
    }
    for (int k = begin; k < std::min(begin + kTogether, last); ++k)
    {
      bigus::LiveFrame frame;
      frame.width = sweep.width;
      frame.height = sweep.height;
      frame.imageToReference = sweep.imageToReference[k];
      frame.timestamp = this->LastTime = times[k];
      sweep.CopyFrame(k, intensities.data());
      frame.pixels.resize(intensities.size());
      std::transform(intensities.begin(), intensities.end(), frame.pixels.begin(),
                     [](float value) { return static_cast<std::uint8_t>(std::lround(255 * value)); });
      session.Add(std::move(frame));
    }
    session.Wait();
  }
  return last - first;
}

bool vtkBigusLiveTrainer::AddSweep(vtkImageData* image)
{
  try
  {
    const std::shared_ptr<const bigus::Sweep> sweep = bigus::SweepFromImage(image).sweep;
    this->HandOver(*sweep, TimesOf(*sweep, this->LastTime), 0, sweep->NumberOfFrames());
    return true;
  }
  catch (const std::exception& error)
  {
    vtkErrorMacro(<< error.what());
    return false;
  }
}

bool vtkBigusLiveTrainer::RenderSlice(vtkMatrix4x4* imageToReference, int width, int height, vtkImageData* slice)
{
  try
  {
    const Eigen::Matrix4d matrix = ToEigen(imageToReference);
    const bigus::SlicePlane plane = bigus::SlicePlane::FromImageToReference(matrix, width, height);
    plane.Validate("slice plane");
    bigus::Require(slice, "There is no image to render into.");
    slice->Initialize();
    slice->SetDimensions(width, height, 1);
    slice->SetSpacing(plane.columnStep.norm(), plane.rowStep.norm(), 1);
    slice->SetOrigin(plane.origin.data());
    const Eigen::Vector3d x = plane.columnStep.normalized(), y = plane.rowStep.normalized(), z = plane.Normal();
    slice->SetDirectionMatrix(x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]);
    slice->AllocateScalars(VTK_FLOAT, 1);
    this->Session().Render(plane, bigus::ViewOutput::Intensity, static_cast<float*>(slice->GetScalarPointer()));
    return true;
  }
  catch (const std::exception& error)
  {
    vtkErrorMacro(<< error.what());
    return false;
  }
}

void vtkBigusLiveTrainer::EndSession()
{
  this->Live.reset();
  this->LastTime = 0;
  this->HandedFrames = 0;
}

void vtkBigusLiveTrainer::Reset()
{
  this->EndSession();
  this->Modified();
}

//------------------------------------------------------------------------------
// The pipeline

int vtkBigusLiveTrainer::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkImageData");
  info->Set(vtkAlgorithm::INPUT_IS_OPTIONAL(), 1);
  return 1;
}

int vtkBigusLiveTrainer::RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputs)
{
  vtkInformation* info = outputs->GetInformationObject(0);
  info->Remove(vtkStreamingDemandDrivenPipeline::TIME_STEPS());
  info->Remove(vtkStreamingDemandDrivenPipeline::TIME_RANGE());
  if (this->GetNumberOfInputConnections(0) == 0)
  {
    return 1;
  }
  try
  {
    // Times are data of the sweep, so they are known once it is there.
    int port = 0;
    this->GetInputAlgorithm(0, 0, port)->Update(port);
    vtkImageData* input = vtkImageData::SafeDownCast(this->GetInputDataObject(0, 0));
    std::vector<double> times = TimesOf(*bigus::SweepFromImage(input).sweep, -1);
    std::sort(times.begin(), times.end());
    times.erase(std::unique(times.begin(), times.end()), times.end());
    const double range[2] = {times.front(), times.back()};
    info->Set(vtkStreamingDemandDrivenPipeline::TIME_STEPS(), times.data(), static_cast<int>(times.size()));
    info->Set(vtkStreamingDemandDrivenPipeline::TIME_RANGE(), range, 2);
  }
  catch (const bigus::Error&)
  {
    // What is no sweep has no times. RequestData says what is wrong.
  }
  return 1;
}

int vtkBigusLiveTrainer::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  return 1;
}

/// Hands over what the input has up to a time and the session has not had. True when that is all of it.
bool vtkBigusLiveTrainer::FollowInput(vtkImageData* input, double until)
{
  const std::shared_ptr<const bigus::Sweep> sweep = bigus::SweepFromImage(input).sweep;
  const std::vector<double> times = TimesOf(*sweep, -1);
  const auto end = std::find_if(times.begin(), times.end(), [until](double time) { return time > until; });
  const int last = static_cast<int>(end - times.begin());
  const Options options = {this->Engine ? this->Engine : "", this->Seed,       this->Window, this->MaximumFrames,
                           this->MaximumGaussians,           this->MemoryLimit};
  if (last < this->HandedFrames || input->GetMTime() != this->InputTime || options != this->UsedOptions)
  {
    this->EndSession();
    this->InputTime = input->GetMTime();
    this->UsedOptions = options;
  }
  this->HandedFrames += this->HandOver(*sweep, times, this->HandedFrames, last,
                                       [this](double share) { return bigus::ReportProgress(this, share); });
  return this->HandedFrames == static_cast<int>(times.size());
}

int vtkBigusLiveTrainer::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkInformation* info = outputs->GetInformationObject(0);
  vtkPolyData* output = vtkPolyData::GetData(info);
  vtkImageData* input = vtkImageData::GetData(inputs[0], 0);
  output->Initialize();
  this->SetErrorCode(vtkErrorCode::NoError);
  try
  {
    bool isComplete = true;
    if (input)
    {
      double time = std::numeric_limits<double>::infinity();
      if (info->Has(vtkStreamingDemandDrivenPipeline::UPDATE_TIME_STEP()))
      {
        time = info->Get(vtkStreamingDemandDrivenPipeline::UPDATE_TIME_STEP());
        output->GetInformation()->Set(vtkDataObject::DATA_TIME_STEP(), time);
      }
      isComplete = this->FollowInput(input, time);
    }
    bigus::LiveSession& session = this->Session();
    if (this->FinishTime <= 0 || !isComplete)
    {
      bigus::FieldToPolyData(session.Field(), output);
      bigus::KeepOutput(this);
      return 1;
    }
    // Observers are told on the caller's thread, which waits for the session's.
    std::atomic<double> fraction{0};
    std::atomic<bool> stop{false};
    auto finished = std::async(std::launch::async,
                               [&]
                               {
                                 return session.Finish(this->FinishTime,
                                                       [&](const bigus::TrainingProgress& now)
                                                       {
                                                         fraction = now.fraction;
                                                         return !stop;
                                                       });
                               });
    while (finished.wait_for(kReport) == std::future_status::timeout)
    {
      stop = !bigus::ReportProgress(this, fraction) || stop;
    }
    const bigus::LiveResult result = finished.get();
    for (const bigus::Finding& finding : result.training.findings)
    {
      vtkWarningMacro(<< bigus::Describe(finding, bigus::AllFrames(*result.sweep)));
    }
    bigus::FieldToPolyData(result.training.field, output);
    std::vector<std::string> provenance;
    bigus::SetProvenanceLine(provenance, "filter", "vtkBigusLiveTrainer");
    bigus::AddTrainingProvenance(provenance, result.training, *result.sweep, false);
    bigus::ReplaceProvenance(output, provenance);
    bigus::KeepOutput(this);
    return 1;
  }
  catch (const std::exception& error)
  {
    output->Initialize();
    if (input)
    {
      this->EndSession();  // so that the next update begins anew
    }
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UserError);
    return 0;
  }
}

#define vtkBigusStateMacro(method, member)                                         \
  vtkIdType vtkBigusLiveTrainer::method()                                          \
  {                                                                                \
    return this->Live ? static_cast<vtkIdType>(this->Live->GetState().member) : 0; \
  }
vtkBigusStateMacro(GetNumberOfFrames, frames);
vtkBigusStateMacro(GetNumberOfPassedOverFrames, passedOver);
vtkBigusStateMacro(GetNumberOfDroppedFrames, dropped);
vtkBigusStateMacro(GetNumberOfRefusedFrames, refused);
vtkBigusStateMacro(GetNumberOfWaitingFrames, waiting);
vtkBigusStateMacro(GetNumberOfGaussians, gaussians);
vtkBigusStateMacro(GetNumberOfSteps, steps);

const char* vtkBigusLiveTrainer::GetLastRefusal()
{
  this->LastRefusal = this->Live ? this->Live->GetState().lastError : "";
  return this->LastRefusal.c_str();
}
