// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusTrainer.h"

#include <cmath>
#include <limits>
#include <optional>
#include <sstream>

#include "Core/Deciding/Trainer.h"
#include "Core/Model/Error.h"
#include "Data/FieldData.h"
#include "Data/Progress.h"
#include "Data/Provenance.h"
#include "Data/SweepData.h"
#include "PipelineSupport.h"
#include "vtkDoubleArray.h"
#include "vtkErrorCode.h"
#include "vtkFieldData.h"
#include "vtkIdTypeArray.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkStringArray.h"
#include "vtkTable.h"

vtkStandardNewMacro(vtkBigusTrainer);

namespace
{

template <class Number>
std::optional<Number> UnlessNegative(Number value)
{
  return value < 0 ? std::nullopt : std::optional<Number>(value);
}

// -1 leaves a choice open.
std::string Text(const char* text)
{
  return text ? text : "";
}

// Core counts in std::size_t: a negative number must not become a huge one.
std::size_t Count(vtkIdType value, const char* name)
{
  if (value < 0)
  {
    throw bigus::Error(std::string(name) + " is " + std::to_string(value) + "; it must not be negative.");
  }
  return static_cast<std::size_t>(value);
}

const char* SeedingName(int seeding)
{
  return seeding == vtkBigusTrainer::Harris   ? "Harris"
         : seeding == vtkBigusTrainer::Random ? "Random"
                                              : "IntensityBased";
}

bigus::SeedPlacement ToPlacement(int seeding)
{
  return seeding == vtkBigusTrainer::Harris   ? bigus::SeedPlacement::Harris
         : seeding == vtkBigusTrainer::Random ? bigus::SeedPlacement::Random
                                              : bigus::SeedPlacement::Intensity;
}

vtkSmartPointer<vtkIntArray> NewFrameList(const char* name)
{
  auto list = vtkSmartPointer<vtkIntArray>::New();
  list->SetName(name);
  return list;
}

// Frames are numbered by the trainer as it got them; the caller knows them by index in the image.
void FillFrameList(vtkIntArray* list, const std::vector<int>& frames, const std::vector<int>& imageIndices)
{
  list->SetNumberOfValues(static_cast<vtkIdType>(frames.size()));
  for (std::size_t i = 0; i < frames.size(); ++i)
  {
    list->SetValue(static_cast<vtkIdType>(i), imageIndices[frames[i]]);
  }
}

std::string ProgressLine(const bigus::TrainingProgress& progress)
{
  using Phase = bigus::TrainingProgress::Phase;
  switch (progress.phase)
  {
    case Phase::Deciding:
      return "deciding what the sweep needs";
    case Phase::Seeding:
      return "seeding";
    case Phase::Solving:
      return "solving for reflectivities";
    case Phase::Training:
      break;
  }
  std::ostringstream line;
  line.imbue(std::locale::classic());
  line << "iteration " << progress.record.iteration << ", loss " << progress.record.loss;
  if (progress.record.validationPsnr)
  {
    line << ", validation " << *progress.record.validationPsnr << " dB";
  }
  if (progress.secondsLeft > 0)
  {
    line << ", " << std::lround(progress.secondsLeft) << " s left";
  }
  return line.str();
}

template <class Array>
Array* AddColumn(vtkTable* table, const char* name, std::size_t rows)
{
  vtkNew<Array> column;
  column->SetName(name);
  column->SetNumberOfValues(static_cast<vtkIdType>(rows));
  table->AddColumn(column);
  return column;
}

void FillLog(const std::vector<bigus::TrainingRecord>& log, vtkTable* table)
{
  table->Initialize();
  auto* iterations = AddColumn<vtkIntArray>(table, "Iteration", log.size());
  auto* seconds = AddColumn<vtkDoubleArray>(table, "Seconds", log.size());
  auto* losses = AddColumn<vtkDoubleArray>(table, "Loss", log.size());
  auto* validations = AddColumn<vtkDoubleArray>(table, "ValidationPSNR", log.size());
  auto* gaussians = AddColumn<vtkIdTypeArray>(table, "Gaussians", log.size());
  auto* rates = AddColumn<vtkDoubleArray>(table, "Rate", log.size());
  for (std::size_t i = 0; i < log.size(); ++i)
  {
    const vtkIdType row = static_cast<vtkIdType>(i);
    iterations->SetValue(row, log[i].iteration);
    seconds->SetValue(row, log[i].seconds);
    losses->SetValue(row, log[i].loss);
    validations->SetValue(row, log[i].validationPsnr.value_or(std::numeric_limits<double>::quiet_NaN()));
    gaussians->SetValue(row, static_cast<vtkIdType>(log[i].gaussians));
    rates->SetValue(row, log[i].rate);
  }
}

void FillDecisions(const std::vector<bigus::Decision>& decisions, vtkTable* table)
{
  table->Initialize();
  auto* whats = AddColumn<vtkStringArray>(table, "Decision", decisions.size());
  auto* choices = AddColumn<vtkStringArray>(table, "Choice", decisions.size());
  auto* evidences = AddColumn<vtkStringArray>(table, "Evidence", decisions.size());
  auto* seconds = AddColumn<vtkDoubleArray>(table, "Seconds", decisions.size());
  for (std::size_t i = 0; i < decisions.size(); ++i)
  {
    const vtkIdType row = static_cast<vtkIdType>(i);
    whats->SetValue(row, decisions[i].what);
    choices->SetValue(row, decisions[i].choice);
    evidences->SetValue(row, decisions[i].evidence);
    seconds->SetValue(row, decisions[i].seconds);
  }
}

std::string ToText(vtkIntArray* list)
{
  std::string text;
  for (vtkIdType i = 0; i < list->GetNumberOfValues(); ++i)
  {
    text += (i ? " " : "") + std::to_string(list->GetValue(i));
  }
  return text;
}

}  // namespace

vtkBigusTrainer::vtkBigusTrainer()
    : TrainingFrames(NewFrameList("TrainingFrames")),
      ValidationFrames(NewFrameList("ValidationFrames")),
      HeldOutFrames(NewFrameList("HeldOutFrames")),
      Decisions(vtkSmartPointer<vtkTable>::New())
{
  this->SetNumberOfInputPorts(2);
  this->SetNumberOfOutputPorts(2);
  this->SetEngine("auto");
  this->SetPreset("fidelity");
  this->SetInterpolation("auto");
}

vtkBigusTrainer::~vtkBigusTrainer()
{
  this->SetEngine(nullptr);
  this->SetPreset(nullptr);
  this->SetLoss(nullptr);
  this->SetFinalLoss(nullptr);
  this->SetInterpolation(nullptr);
}

void vtkBigusTrainer::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Engine: " << (this->Engine ? this->Engine : "(none)") << "\n";
  os << indent << "Seeding: " << SeedingName(this->Seeding) << "\n";
  os << indent << "Automatic: " << (this->Automatic ? "On\n" : "Off\n");
  os << indent << "NumberOfGaussians: " << this->NumberOfGaussians << "\n";
  os << indent << "MaximumNumberOfGaussians: " << this->MaximumNumberOfGaussians << "\n";
  os << indent << "Price: " << this->Price << "\n";
  os << indent << "ElevationSigma: " << this->ElevationSigma << "\n";
  os << indent << "HoldOut: " << this->HoldOut << "\n";
  os << indent << "Validation: " << this->Validation << "\n";
  os << indent << "Patience: " << this->Patience << "\n";
  os << indent << "Iterations: " << this->Iterations << "\n";
  os << indent << "TimeLimit: " << this->TimeLimit << "\n";
  os << indent << "Batch: " << this->Batch << "\n";
  os << indent << "Seed: " << this->Seed << "\n";
  os << indent << "Preset: " << (this->Preset ? this->Preset : "(none)") << "\n";
  os << indent << "Loss: " << (this->Loss ? this->Loss : "(the preset's)") << "\n";
  os << indent << "FinalLoss: " << (this->FinalLoss ? this->FinalLoss : "(none)") << "\n";
  os << indent << "SignedReflectivity: " << this->SignedReflectivity << "\n";
  os << indent << "FrameGains: " << this->FrameGains << "\n";
  os << indent << "PoseRefinement: " << this->PoseRefinement << "\n";
  os << indent << "TrackerTranslation: " << this->TrackerTranslation << "\n";
  os << indent << "TrackerRotation: " << this->TrackerRotation << "\n";
  os << indent << "IgnoreMasked: " << (this->IgnoreMasked ? "On\n" : "Off\n");
  os << indent << "Tolerance: " << this->Tolerance << "\n";
  os << indent << "MeanRate: " << this->MeanRate << "\n";
  os << indent << "ShapeRate: " << this->ShapeRate << "\n";
  os << indent << "ReflectivityRate: " << this->ReflectivityRate << "\n";
  os << indent << "FinalRate: " << this->FinalRate << "\n";
  os << indent << "SolveIterations: " << this->SolveIterations << "\n";
  os << indent << "VirtualPlanes: " << this->VirtualPlanes << "\n";
  os << indent << "Interpolation: " << (this->Interpolation ? this->Interpolation : "(open)") << "\n";
  os << indent << "MinimumScale: " << this->MinimumScale << "\n";
  os << indent << "MaximumScale: " << this->MaximumScale << "\n";
  os << indent << "DensificationInterval: " << this->DensificationInterval << "\n";
  os << indent << "DensificationPercentile: " << this->DensificationPercentile << "\n";
  os << indent << "DensificationCap: " << this->DensificationCap << "\n";
  os << indent << "IterationsDone: " << this->IterationsDone << "\n";
  os << indent << "Seconds: " << this->Seconds << "\n";
  os << indent << "Device: " << this->Device << "\n";
  os << indent << "Aborted: " << (this->Aborted ? "yes\n" : "no\n");
  os << indent << "TrainingFrames: " << ToText(this->TrainingFrames) << "\n";
  os << indent << "ValidationFrames: " << ToText(this->ValidationFrames) << "\n";
  os << indent << "HeldOutFrames: " << ToText(this->HeldOutFrames) << "\n";
  os << indent << "Decisions: " << this->Decisions->GetNumberOfRows() << "\n";
}

vtkIntArray* vtkBigusTrainer::GetTrainingFrames()
{
  return this->TrainingFrames;
}
vtkIntArray* vtkBigusTrainer::GetValidationFrames()
{
  return this->ValidationFrames;
}
vtkIntArray* vtkBigusTrainer::GetHeldOutFrames()
{
  return this->HeldOutFrames;
}

vtkTable* vtkBigusTrainer::GetDecisions()
{
  return this->Decisions;
}

vtkTable* vtkBigusTrainer::GetLog()
{
  return vtkTable::SafeDownCast(this->GetOutputDataObject(1));
}

int vtkBigusTrainer::FillInputPortInformation(int port, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), port == 0 ? "vtkImageData" : "vtkPolyData");
  if (port == 1)
  {
    info->Set(vtkAlgorithm::INPUT_IS_OPTIONAL(), 1);
  }
  return 1;
}

int vtkBigusTrainer::FillOutputPortInformation(int port, vtkInformation* info)
{
  info->Set(vtkDataObject::DATA_TYPE_NAME(), port == 0 ? "vtkPolyData" : "vtkTable");
  return 1;
}

int vtkBigusTrainer::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  bigus::RequestWholeInput(inputs[1]);
  return 1;
}

int vtkBigusTrainer::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkPolyData* output = vtkPolyData::GetData(outputs, 0);
  vtkTable* log = vtkTable::GetData(outputs, 1);
  output->Initialize();
  log->Initialize();
  this->IterationsDone = 0;
  this->Seconds = 0;
  this->Device.clear();
  this->Aborted = false;
  this->TrainingFrames->Initialize();
  this->ValidationFrames->Initialize();
  this->HeldOutFrames->Initialize();
  FillDecisions({}, this->Decisions);
  this->SetErrorCode(vtkErrorCode::NoError);
  try
  {
    if (!this->Engine)
    {
      throw bigus::Error("No Engine is set; \"auto\" takes the fastest.");
    }
    bigus::TrainerOptions options;
    options.engine = this->Engine;
    options.seeding = ToPlacement(this->Seeding);
    options.automatic = this->Automatic != 0;
    if (const std::size_t count = Count(this->NumberOfGaussians, "NumberOfGaussians"))
    {
      options.gaussians = count;
    }
    options.maximumGaussians = Count(this->MaximumNumberOfGaussians, "MaximumNumberOfGaussians");
    options.price = this->Price;
    options.elevationSigma = UnlessNegative(this->ElevationSigma);
    options.holdOut = this->HoldOut;
    options.validation = this->Validation;
    options.patience = this->Patience;
    options.iterations = UnlessNegative(this->Iterations);
    options.timeLimit = this->TimeLimit;
    options.batch = this->Batch;
    options.seed = this->Seed;
    bigus::ApplyPreset(Text(this->Preset), options);
    if (!Text(this->Loss).empty())
    {
      options.loss = bigus::Loss::Parse(this->Loss);
      options.finalLoss.reset();  // the preset's would lead away from what was asked for
    }
    if (!Text(this->FinalLoss).empty())
    {
      options.finalLoss = bigus::Loss::Parse(this->FinalLoss);
    }
    options.signedReflectivity = this->SignedReflectivity != 0;  // -1, automatic, is the default
    options.frameGains = this->FrameGains > 0;
    options.poseRefinement = this->PoseRefinement > 0;
    options.trackerTranslation = this->TrackerTranslation;
    options.trackerRotation = this->TrackerRotation;
    options.ignoreMasked = this->IgnoreMasked != 0;
    options.tolerance = this->Tolerance;
    options.meanRate = this->MeanRate;
    options.shapeRate = this->ShapeRate;
    options.reflectivityRate = this->ReflectivityRate;
    options.finalRate = this->FinalRate;
    options.solveIterations = UnlessNegative(this->SolveIterations);
    options.virtualPlanes = UnlessNegative(this->VirtualPlanes);
    if (const std::string name = Text(this->Interpolation); !name.empty() && name != "auto")
    {
      options.interpolation = bigus::FrameInterpolation::Parse(name);
      options.interpolation->keepContrast = options.keepContrast;
    }
    options.minimumScale = UnlessNegative(this->MinimumScale);
    options.maximumScale = UnlessNegative(this->MaximumScale);
    options.densification.interval = this->DensificationInterval;
    options.densification.percentile = this->DensificationPercentile;
    options.densification.cap = Count(this->DensificationCap, "DensificationCap");
    options.Validate();

    vtkImageData* image = vtkImageData::GetData(inputs[0]);
    const bigus::ImportedSweep imported = bigus::SweepFromImage(image);
    std::optional<bigus::GaussianField> start;
    if (vtkPolyData* initial = vtkPolyData::GetData(inputs[1]))
    {
      start = bigus::FieldFromPolyData(initial);
    }

    const auto progress = [this](const bigus::TrainingProgress& now)
    {
      this->SetProgressText(ProgressLine(now).c_str());
      return bigus::ReportProgress(this, now.fraction);
    };
    const bigus::TrainingResult result = bigus::Train(imported.sweep, options, start ? &*start : nullptr, progress);

    this->IterationsDone = result.iterations;
    this->Seconds = result.seconds;
    this->Device = result.device;
    this->Aborted = result.aborted;
    FillFrameList(this->TrainingFrames, result.trainingFrames, imported.frames);
    FillFrameList(this->ValidationFrames, result.validationFrames, imported.frames);
    FillFrameList(this->HeldOutFrames, result.heldOutFrames, imported.frames);
    FillLog(result.log, log);
    FillDecisions(result.decisions, this->Decisions);

    // Nothing that differs between two equal runs, such as the time, goes in here: equal runs write equal
    // files.
    bigus::FieldToPolyData(result.field, output);
    if (auto* history = vtkStringArray::SafeDownCast(image->GetFieldData()->GetAbstractArray("Provenance")))
    {
      output->GetFieldData()->AddArray(history);  // where the sweep came from
    }
    bigus::SetProvenance(output, "filter", "vtkBigusTrainer");
    bigus::SetProvenance(output, "device", result.device);
    bigus::SetProvenance(output, "seeding", start ? "continued" : SeedingName(this->Seeding));
    bigus::SetTrainingProvenance(output, result);
    bigus::SetProvenance(output, "trainingFrames", ToText(this->TrainingFrames));
    bigus::SetProvenance(output, "validationFrames", ToText(this->ValidationFrames));
    bigus::SetProvenance(output, "heldOutFrames", ToText(this->HeldOutFrames));
    return 1;
  }
  catch (const std::exception& error)
  {
    output->Initialize();
    log->Initialize();
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UserError);
    return 0;
  }
}
