// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusPoseCorrection.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "Core/Deciding/PoseCorrectionNumbers.h"
#include "Core/Inspection/Inspection.h"
#include "Core/Model/Sweep.h"
#include "Data/Arrays.h"
#include "Data/Progress.h"
#include "Data/Provenance.h"
#include "Data/SweepData.h"
#include "PipelineSupport.h"
#include "vtkDoubleArray.h"
#include "vtkErrorCode.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkStringArray.h"
#include "vtkTable.h"
#include "vtkUnsignedCharArray.h"

vtkStandardNewMacro(vtkBigusPoseCorrection);

namespace
{

/// Adds one number a frame of the image; `rejected` where it has no usable pose.
template <class Array, class T>
void AddFrameArray(vtkImageData* image, const char* name, const std::vector<T>& values, const std::vector<int>& frames,
                   T rejected)
{
  vtkNew<Array> array;
  array->SetName(name);
  array->SetNumberOfValues(image->GetDimensions()[2]);
  array->FillValue(rejected);
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    array->SetValue(frames[k], values[k]);
  }
  image->GetFieldData()->AddArray(array);
}

void AddNumbers(vtkImageData* image, const bigus::NamedNumbers& numbers)
{
  const auto count = static_cast<int>(numbers.components.size());
  const auto array =
      bigus::NewArray<vtkDoubleArray>(numbers.name, count, numbers.values.size() / numbers.components.size());
  std::copy(numbers.values.begin(), numbers.values.end(), array->GetPointer(0));
  for (int k = 0; k < count && count > 1; ++k)
  {
    array->SetComponentName(k, numbers.components[k]);
  }
  image->GetFieldData()->AddArray(array);
}

void FillSteps(const std::vector<bigus::PoseStep>& steps, vtkTable* table)
{
  using Step = bigus::PoseStep;
  bigus::AddColumn<vtkDoubleArray>(table, "From", steps, &Step::from);
  bigus::AddColumn<vtkDoubleArray>(table, "To", steps, &Step::to);
  bigus::AddColumn<vtkDoubleArray>(table, "Share", steps, &Step::share);
  bigus::AddColumn<vtkDoubleArray>(table, "ShareError", steps, &Step::shareError);
  bigus::AddColumn<vtkDoubleArray>(table, "Gain", steps, &Step::gain);
  bigus::AddColumn<vtkDoubleArray>(table, "GainError", steps, &Step::gainError);
  bigus::AddColumn<vtkDoubleArray>(table, "RevisitShare", steps, &Step::revisitShare);
  bigus::AddColumn<vtkDoubleArray>(table, "RevisitError", steps, &Step::revisitError);
  bigus::AddColumn<vtkIntArray>(table, "Taken", steps, &Step::isTaken);
}

void AddFindings(vtkImageData* image, const bigus::PoseCorrection& found, const std::vector<int>& frames)
{
  const bigus::Trajectory& path = found.trajectory;
  AddFrameArray<vtkDoubleArray>(image, "PoseDisplacement", path.displacement, frames, 0.0);
  AddFrameArray<vtkDoubleArray>(image, "PoseRotation", path.rotation, frames, 0.0);
  AddFrameArray<vtkUnsignedCharArray>(image, "PoseOutlier", path.isOutlier, frames, std::uint8_t(0));
  AddFrameArray<vtkIntArray>(image, "PoseStroke", path.stroke, frames, -1);

  for (const bigus::NamedNumbers& numbers : bigus::NumbersOf(found))
  {
    AddNumbers(image, numbers);
  }
  const auto applied = bigus::NewArray<vtkUnsignedCharArray>("ConstantErrorsApplied", 1, 1);
  applied->SetValue(0, found.constant.IsSignificant() ? 1 : 0);
  image->GetFieldData()->AddArray(applied);

  vtkNew<vtkStringArray> decision;
  decision->SetName("PoseDecision");
  decision->InsertNextValue(found.decision.choice);
  decision->InsertNextValue(found.decision.evidence);
  image->GetFieldData()->AddArray(decision);
  bigus::SetProvenance(image, "sweep.poses", found.decision.choice + " (" + found.decision.evidence + ")");
}

}  // namespace

vtkBigusPoseCorrection::vtkBigusPoseCorrection()
{
  this->SetNumberOfOutputPorts(2);
}

void vtkBigusPoseCorrection::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Strength: " << this->Strength << "\n";
  os << indent << "HoldOut: " << this->HoldOut << "\n";
  os << indent << "ChosenStrength: " << this->ChosenStrength << "\n";
}

vtkTable* vtkBigusPoseCorrection::GetSteps()
{
  return vtkTable::SafeDownCast(this->GetOutputDataObject(1));
}

int vtkBigusPoseCorrection::FillOutputPortInformation(int port, vtkInformation* info)
{
  info->Set(vtkDataObject::DATA_TYPE_NAME(), port == 0 ? "vtkImageData" : "vtkTable");
  return 1;
}

int vtkBigusPoseCorrection::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  return 1;
}

int vtkBigusPoseCorrection::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkImageData* output = vtkImageData::GetData(outputs);
  vtkTable* steps = vtkTable::GetData(outputs, 1);
  this->ChosenStrength = 0;
  const auto work = [&]
  {
    vtkImageData* image = vtkImageData::GetData(inputs[0]);
    const bigus::ImportedSweep imported = bigus::SweepFromImage(image);
    const bigus::Sweep& sweep = *imported.sweep;
    for (const bigus::Finding& finding : bigus::Inspect(imported.sweep, bigus::KeptKinds::Parse("all")).findings)
    {
      vtkWarningMacro(<< bigus::Describe(finding, imported.frames));
    }
    const auto [frames, heldOut] = bigus::SplitHoldOut(sweep.NumberOfFrames(), this->HoldOut);
    const bigus::PoseCorrection found =
        bigus::CorrectPoses(sweep, frames, {this->Strength < 0 ? std::nullopt : std::optional<double>(this->Strength)},
                            [this](double fraction) { return bigus::ReportProgress(this, fraction); });
    if (found.aborted)
    {
      return;  // the output stays empty, and the next update begins anew
    }
    vtkNew<vtkDoubleArray> poses, recorded;
    bigus::FillImagePoses({image}, imported, found.trajectory.imageToReference, poses);
    recorded->DeepCopy(image->GetFieldData()->GetArray("ImageToReference"));
    recorded->SetName("RecordedImageToReference");
    output->ShallowCopy(image);
    output->GetFieldData()->AddArray(poses);
    output->GetFieldData()->AddArray(recorded);
    AddFindings(output, found, imported.frames);
    FillSteps(found.steps, steps);
    this->ChosenStrength = found.strength;
  };
  return bigus::Execute(this, outputs, work);
}
