// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusTrainer.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstring>
#include <limits>
#include <optional>

#include "CollectiveExecutive.h"
#include "Core/Model/Error.h"
#include "Core/Trainer/Provenance.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/OptionList.h"
#include "Data/FieldData.h"
#include "Data/Processes.h"
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
#include "vtkMultiProcessController.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkStringArray.h"
#include "vtkTable.h"

vtkStandardNewMacro(vtkBigusTrainer);

namespace
{

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

void FillLog(const std::vector<bigus::TrainingRecord>& log, vtkTable* table)
{
  using Record = bigus::TrainingRecord;
  const auto validation = [](const Record& record)
  { return record.validationPsnr.value_or(std::numeric_limits<double>::quiet_NaN()); };
  table->Initialize();
  bigus::AddColumn<vtkIntArray>(table, "Iteration", log, &Record::iteration);
  bigus::AddColumn<vtkDoubleArray>(table, "Seconds", log, &Record::seconds);
  bigus::AddColumn<vtkDoubleArray>(table, "Loss", log, &Record::loss);
  bigus::AddColumn<vtkDoubleArray>(table, "ValidationPSNR", log, validation);
  bigus::AddColumn<vtkIdTypeArray>(table, "Gaussians", log, &Record::gaussians);
  bigus::AddColumn<vtkDoubleArray>(table, "Rate", log, &Record::rate);
}

void FillDecisions(const std::vector<bigus::Decision>& decisions, vtkTable* table)
{
  table->Initialize();
  bigus::AddColumn<vtkStringArray>(table, "Decision", decisions, &bigus::Decision::what);
  bigus::AddColumn<vtkStringArray>(table, "Choice", decisions, &bigus::Decision::choice);
  bigus::AddColumn<vtkStringArray>(table, "Evidence", decisions, &bigus::Decision::evidence);
  bigus::AddColumn<vtkDoubleArray>(table, "Seconds", decisions, &bigus::Decision::seconds);
}

const std::vector<bigus::OptionText>& Defaults()
{
  static const std::vector<bigus::OptionText> defaults = bigus::ListOptions();
  return defaults;
}

const bigus::OptionText* FindOption(const char* name)
{
  const auto found = std::find_if(Defaults().begin(), Defaults().end(),
                                  [name](const bigus::OptionText& option)
                                  { return name && std::strcmp(option.info.name, name) == 0; });
  return found == Defaults().end() ? nullptr : &*found;
}

/// The numbers of a list, separated by blanks.
std::string ToText(vtkIntArray* list)
{
  return bigus::FrameListText({list->GetPointer(0), list->GetPointer(0) + list->GetNumberOfValues()});
}

/// What an inspection found. Frames that teach nothing are an error of the training, and no warning beside it.
std::vector<bigus::Finding> FindingsToTell(const bigus::InspectedSweep& inspected)
{
  const bigus::Sweep& left = *inspected.sweep;
  const bool teaches = left.NumberOfFrames() > 1 && !bigus::LevelOf(left, bigus::AllFrames(left));
  return teaches ? inspected.findings : std::vector<bigus::Finding>();
}

/// Other lines of the sweeps stay behind, because nobody knows what they tell of a patient.
void AddProvenanceOfPoses(const std::vector<vtkImageData*>& images, std::vector<std::string>& provenance)
{
  for (std::size_t k = 0; k < images.size(); ++k)
  {
    if (const std::string poses = bigus::GetProvenance(images[k], "sweep.poses"); !poses.empty())
    {
      const std::string number = images.size() > 1 ? ".sequence" + std::to_string(k + 1) : "";
      bigus::SetProvenanceLine(provenance, "sweep.poses" + number, poses);
    }
  }
}

}  // namespace

vtkBigusTrainer::vtkBigusTrainer()
    : TrainingFrames(NewFrameList("TrainingFrames")),
      ValidationFrames(NewFrameList("ValidationFrames")),
      HeldOutFrames(NewFrameList("HeldOutFrames")),
      Decisions(vtkSmartPointer<vtkTable>::New()),
      CorrectedPoses(vtkSmartPointer<vtkDoubleArray>::New()),
      Checkpoints(std::make_unique<bigus::Checkpoints>())
{
  this->SetNumberOfInputPorts(2);
  this->SetNumberOfOutputPorts(2);
  for (const bigus::OptionText& option : Defaults())
  {
    this->Options[option.info.name] = option.value;
  }
}

vtkBigusTrainer::~vtkBigusTrainer()
{
  this->SetController(nullptr);
}

vtkCxxSetObjectMacro(vtkBigusTrainer, Controller, vtkMultiProcessController);

vtkExecutive* vtkBigusTrainer::CreateDefaultExecutive()
{
  bigus::CollectiveExecutive* const executive = bigus::CollectiveExecutive::New();
  executive->Failed = [this](bool) { this->TellOfNoInput(); };
  return executive;
}

void vtkBigusTrainer::TellOfNoInput()
{
  const std::unique_ptr<bigus::Exchange> exchange = bigus::ExchangeOf(this->Controller);
  if (!this->WasAsked && !exchange->IsAlone())
  {
    try
    {
      exchange->Together([] { throw bigus::Error("its sequence could not be read"); });
    }
    catch (const bigus::Error& error)
    {
      vtkErrorMacro(<< error.what());
      this->SetErrorCode(vtkErrorCode::UserError);
    }
  }
  this->WasAsked = false;
}

void vtkBigusTrainer::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  for (const bigus::OptionText& option : Defaults())
  {
    os << indent << option.info.name << ": " << this->Options[option.info.name] << "\n";
  }
  os << indent << "IterationsDone: " << this->IterationsDone << "\n";
  os << indent << "Seconds: " << this->Seconds << "\n";
  os << indent << "Device: " << this->Device << "\n";
  os << indent << "Aborted: " << (this->Aborted ? "yes\n" : "no\n");
  os << indent << "KeepStandardError: " << (this->KeepStandardError ? "On\n" : "Off\n");
  os << indent << "StandardErrorSeconds: " << this->StandardErrorSeconds << "\n";
  os << indent << "Finished: " << (this->Finished ? "yes\n" : "no\n");
  os << indent << "TrainingFrames: " << ToText(this->TrainingFrames) << "\n";
  os << indent << "ValidationFrames: " << ToText(this->ValidationFrames) << "\n";
  os << indent << "HeldOutFrames: " << ToText(this->HeldOutFrames) << "\n";
  os << indent << "CorrectedPoses: " << this->CorrectedPoses->GetNumberOfTuples() << "\n";
  os << indent << "Decisions: " << this->Decisions->GetNumberOfRows() << "\n";
  os << indent << "Controller: " << this->Controller << "\n";
  os << indent << "SentBytes: " << this->SentBytes << "\n";
  os << indent << "WaitingSeconds: " << this->WaitingSeconds << "\n";
  os << indent << "SendingSeconds: " << this->SendingSeconds << "\n";
}

void vtkBigusTrainer::SetOption(const char* name, const char* value)
{
  const bigus::OptionText* option = FindOption(name);
  if (!option)
  {
    vtkErrorMacro(<< "There is no option '" << (name ? name : "") << "'.");
    return;
  }
  const std::string text = value && *value ? value : option->value;
  if (std::string& held = this->Options[option->info.name]; held != text)
  {
    held = text;
    this->Modified();
  }
}

const char* vtkBigusTrainer::GetOption(const char* name)
{
  const auto found = this->Options.find(name ? name : "");
  return found == this->Options.end() ? nullptr : found->second.c_str();
}

const char* vtkBigusTrainer::GetSettledOption(const char* name)
{
  const auto found = this->SettledOptions.find(name ? name : "");
  return found == this->SettledOptions.end() ? "" : found->second.c_str();
}

int vtkBigusTrainer::GetNumberOfOptions()
{
  return static_cast<int>(Defaults().size());
}

const char* vtkBigusTrainer::GetOptionName(int index)
{
  return index >= 0 && index < this->GetNumberOfOptions() ? Defaults()[index].info.name : nullptr;
}

void vtkBigusTrainer::SetNumber(const char* name, double value)
{
  const bigus::OptionText* option = FindOption(name);
  const bool isSwitch = option && option->kind == bigus::OptionText::Kind::Switch;
  this->SetOption(name, option && option->mayBeOpen && value < 0 ? "auto"
                        : isSwitch && (value == 0 || value == 1) ? (value == 1 ? "on" : "off")
                                                                 : bigus::NumberText(value).c_str());
}

double vtkBigusTrainer::GetNumber(const char* name)
{
  const std::string text = this->Options.at(name);
  double number = text == "on" ? 1 : text == "off" ? 0 : -1;  // -1: open
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

void vtkBigusTrainer::SetCheckpoints(const bigus::Checkpoints& checkpoints)
{
  *this->Checkpoints = checkpoints;
  this->Modified();
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

vtkDoubleArray* vtkBigusTrainer::GetCorrectedPoses()
{
  return this->CorrectedPoses;
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
  info->Set(port == 0 ? vtkAlgorithm::INPUT_IS_REPEATABLE() : vtkAlgorithm::INPUT_IS_OPTIONAL(), 1);
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
  this->SettledOptions.clear();
  this->IterationsDone = 0;
  this->Seconds = 0;
  this->Device.clear();
  this->Aborted = false;
  this->Finished = false;
  this->StandardErrorSeconds = 0;
  this->TrainingFrames->Initialize();
  this->ValidationFrames->Initialize();
  this->HeldOutFrames->Initialize();
  this->CorrectedPoses->Initialize();
  FillDecisions({}, this->Decisions);
  this->SentBytes = 0;
  this->WaitingSeconds = 0;
  this->SendingSeconds = 0;
  this->WasAsked = true;
  const auto work = [&]
  {
    const std::unique_ptr<bigus::Exchange> exchange = bigus::ExchangeOf(this->Controller);
    exchange->Together([&] { this->Train(inputs, outputs, *exchange); });
    const bigus::Exchange::Traffic sent = exchange->Sent();
    this->SentBytes = static_cast<vtkTypeInt64>(sent.bytes);
    this->WaitingSeconds = sent.waiting;
    this->SendingSeconds = sent.sending;
    this->WasAsked = false;
  };
  return bigus::Execute(this, outputs, work);
}

void vtkBigusTrainer::Train(vtkInformationVector** inputs, vtkInformationVector* outputs, bigus::Exchange& exchange)
{
  vtkPolyData* output = vtkPolyData::GetData(outputs, 0);
  vtkTable* log = vtkTable::GetData(outputs, 1);
  bigus::TrainerOptions options;
  for (const auto& [name, value] : this->Options)
  {
    bigus::SetOption(options, name, value);
  }

  std::vector<vtkImageData*> images;
  for (int k = 0; k < inputs[0]->GetNumberOfInformationObjects(); ++k)
  {
    images.push_back(vtkImageData::GetData(inputs[0], k));
  }
  const bigus::ImportedSweep imported = bigus::SweepFromImages(images);
  bigus::InspectedSweep inspected = bigus::Inspect(imported.sweep, options.keep, options.holdOut);
  for (const bigus::Finding& finding : FindingsToTell(inspected))
  {
    vtkWarningMacro(<< bigus::Describe(finding, imported.frames));
  }
  std::optional<bigus::GaussianField> start;
  if (vtkPolyData* initial = vtkPolyData::GetData(inputs[1]))
  {
    start = bigus::FieldFromPolyData(initial);
    if (bigus::ViewFromPolyData(initial))
    {
      vtkWarningMacro(<< "What the field to continue from knows of directions is left out.");
    }
  }

  const auto progress = [this](const bigus::TrainingProgress& now)
  {
    this->SetProgressText(bigus::ProgressText(now).c_str());
    return bigus::ReportProgress(this, now.fraction);
  };
  const bigus::TrainingResult result =
      bigus::Train(std::move(inspected), options, start ? &*start : nullptr, progress, *this->Checkpoints, exchange);

  for (const bigus::OptionText& option : bigus::ListOptions(result.settled))
  {
    this->SettledOptions[option.info.name] = option.value;
  }
  this->IterationsDone = result.iterations;
  this->Seconds = result.seconds;
  this->Device = result.device;
  this->Aborted = result.aborted;
  this->Finished = result.finished;
  FillFrameList(this->TrainingFrames, result.trainingFrames, imported.frames);
  FillFrameList(this->ValidationFrames, result.validationFrames, imported.frames);
  FillFrameList(this->HeldOutFrames, result.heldOutFrames, imported.frames);
  bigus::FillImagePoses(images, imported, result.imageToReference, this->CorrectedPoses);
  FillLog(result.log, log);
  FillDecisions(result.decisions, this->Decisions);

  // Nothing that differs between two equal runs, such as the time, goes in here: equal runs write equal
  // files.
  bigus::FieldToPolyData(result.field, output);
  if (result.view)
  {
    bigus::ViewToPolyData(*result.view, output);
  }
  std::vector<std::string> provenance = {"filter=vtkBigusTrainer"};
  AddProvenanceOfPoses(images, provenance);
  bigus::AddTrainingProvenance(provenance, result, *imported.sweep, start.has_value());
  bigus::SetProvenanceLine(provenance, "trainingFrames", ToText(this->TrainingFrames));
  bigus::SetProvenanceLine(provenance, "validationFrames", ToText(this->ValidationFrames));
  bigus::SetProvenanceLine(provenance, "heldOutFrames", ToText(this->HeldOutFrames));
  bigus::ReplaceProvenance(output, provenance);
  if (this->KeepStandardError)
  {
    this->MeasureStandardError(result, *imported.sweep, options.timeLimit, output);
  }
  bigus::KeepOutput(this);
}

void vtkBigusTrainer::MeasureStandardError(const bigus::TrainingResult& result, const bigus::Sweep& recorded,
                                           double timeLimit, vtkPolyData* output)
{
  try
  {
    const auto start = std::chrono::steady_clock::now();
    const std::string kept = bigus::MeasureStandardError(result, recorded, timeLimit);
    if (!kept.empty())
    {
      bigus::ReplaceStandardError(output, kept);
      this->StandardErrorSeconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    }
  }
  catch (const std::exception& error)  // the field comes first
  {
    vtkWarningMacro(<< "The field keeps no standard error: " << error.what());
  }
}
