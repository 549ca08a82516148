// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldSlice.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <string>

#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "Data/Processes.h"
#include "vtkBigusReslice.h"
#include "vtkCallbackCommand.h"
#include "vtkCommunicator.h"
#include "vtkDataArray.h"
#include "vtkErrorCode.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationIntegerKey.h"
#include "vtkInformationVector.h"
#include "vtkMath.h"
#include "vtkMatrix4x4.h"
#include "vtkMultiProcessController.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkSmartPointer.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkUnsignedCharArray.h"

vtkStandardNewMacro(vtkBigusFieldSlice);

namespace
{

constexpr int kLargestSide = 16384;  // pixels; 2^28 of them are 1 GiB of float

using RowMajorMatrix = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

// The picture's axes, right-handed unit columns: along its rows' pixels, along `down` brought into the plane, and the normal.
bool AxesOf(const double normal[3], const double down[3], Eigen::Matrix3d& axes)
{
  const Eigen::Vector3d z = Eigen::Vector3d(normal).stableNormalized();
  if (!(z.norm() > 0.5))  // 0, or not a number
  {
    return false;
  }
  for (const Eigen::Vector3d& direction : {Eigen::Vector3d(down), Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 0, 0)})
  {
    const Eigen::Vector3d x = direction.cross(z);
    // Nearer to the normal than about a thousandth of a degree rounding errors would turn the picture.
    if (x.norm() > 1e-5 * direction.norm())
    {
      axes << x.normalized(), z.cross(x.normalized()), z;
      return true;
    }
  }
  return false;
}

// A reslice reports through this filter: its progress becomes ours, our abort becomes its.
void ForwardProgress(vtkObject* reslice, unsigned long, void* self, void*)
{
  auto* filter = static_cast<vtkBigusFieldSlice*>(self);
  auto* inner = static_cast<vtkBigusReslice*>(reslice);
  filter->UpdateProgress(inner->GetProgress());
  if (filter->GetAbortExecute())
  {
    inner->SetAbortExecute(1);
  }
}

// Its errors become ours.
void ForwardError(vtkObject*, unsigned long, void* self, void* message)
{
  static_cast<vtkBigusFieldSlice*>(self)->InvokeEvent(vtkCommand::ErrorEvent, message);
}

}  // namespace

vtkBigusFieldSlice::vtkBigusFieldSlice()
{
  this->SetNumberOfInputPorts(2);
  vtkNew<vtkCallbackCommand> progress;
  progress->SetCallback(ForwardProgress);
  progress->SetClientData(this);
  this->Reslice->AddObserver(vtkCommand::ProgressEvent, progress);
  this->Reslice->SetOutputDimensionality(2);
}

vtkBigusFieldSlice::~vtkBigusFieldSlice() = default;

void vtkBigusFieldSlice::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Origin: " << this->Origin[0] << " " << this->Origin[1] << " " << this->Origin[2] << "\n";
  os << indent << "Normal: " << this->Normal[0] << " " << this->Normal[1] << " " << this->Normal[2] << "\n";
  os << indent << "Down: " << this->Down[0] << " " << this->Down[1] << " " << this->Down[2] << "\n";
  os << indent << "Size: " << this->Size[0] << " " << this->Size[1] << "\n";
  os << indent << "PixelSize: " << this->PixelSize << "\n";
  os << indent << "Frame: " << this->Frame << "\n";
  os << indent << "HideUnseen: " << (this->HideUnseen ? "On\n" : "Off\n");
  os << indent << "CoverageThreshold: " << this->CoverageThreshold << "\n";
  os << indent << "StandardError: " << (this->StandardError ? "On\n" : "Off\n");
  os << indent << "Labels: " << (this->Labels ? "On\n" : "Off\n");
  os << indent << "Reslice:\n";
  this->Reslice->PrintSelf(os, indent.GetNextIndent());
}

// What the reslice holds: set there, and this filter is modified where that changed something.
#define vtkBigusForwardMacro(name, type)                   \
  void vtkBigusFieldSlice::Set##name(type value)           \
  {                                                        \
    const vtkMTimeType before = this->Reslice->GetMTime(); \
    this->Reslice->Set##name(value);                       \
    if (this->Reslice->GetMTime() != before)               \
    {                                                      \
      this->Modified();                                    \
    }                                                      \
  }                                                        \
  type vtkBigusFieldSlice::Get##name()                     \
  {                                                        \
    return this->Reslice->Get##name();                     \
  }
vtkBigusForwardMacro(OutputMode, int);
vtkBigusForwardMacro(LabelValue, int);
vtkBigusForwardMacro(ElevationSigma, double);
vtkBigusForwardMacro(Tolerance, double);
vtkBigusForwardMacro(Engine, const char*);
#undef vtkBigusForwardMacro

int vtkBigusFieldSlice::FillInputPortInformation(int port, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), port == 0 ? "vtkPolyData" : "vtkImageData");
  info->Set(vtkAlgorithm::INPUT_IS_OPTIONAL(), port == 1);
  return 1;
}

bool vtkBigusFieldSlice::Fail(const std::string& message)
{
  this->SetErrorCode(vtkErrorCode::UserError);
  vtkErrorMacro(<< message);
  return false;
}

int vtkBigusFieldSlice::RequestInformation(vtkInformation*, vtkInformationVector** inputs,
                                           vtkInformationVector* outputs)
{
  int extent[6] = {0, this->Size[0] - 1, 0, this->Size[1] - 1, 0, 0};
  if (std::min(this->Size[0], this->Size[1]) < 1 || std::max(this->Size[0], this->Size[1]) > kLargestSide)
  {
    return this->Fail("Size is " + std::to_string(this->Size[0]) + " x " + std::to_string(this->Size[1]) +
                      "; give 1 to " + std::to_string(kLargestSide) + " columns and rows.");
  }
  if (this->Frame >= 0)
  {
    vtkInformation* sweep = inputs[1]->GetInformationObject(0);
    if (!sweep)
    {
      return this->Fail("Frame is " + std::to_string(this->Frame) +
                        " but there is no sweep; connect the sweep, or set Frame to -1 to use the plane.");
    }
    int frames[6];
    sweep->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), frames);
    extent[1] = frames[1] - frames[0];
    extent[3] = frames[3] - frames[2];
  }
  // Place and spacing follow from the field, which is known when it is there.
  vtkInformation* out = outputs->GetInformationObject(0);
  out->Set(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), extent, 6);
  vtkDataObject::SetPointDataActiveScalarInfo(out, VTK_FLOAT, 1);
  return 1;
}

int vtkBigusFieldSlice::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  // A slice sums all Gaussians and belongs to all frames, whatever part of it is asked for. Where a server has several
  // processes and the field can be had in parts, each has one, and they render it together.
  for (int port = 0; port < 2; ++port)
  {
    if (vtkInformation* in = inputs[port]->GetInformationObject(0))
    {
      if (in->Has(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT()))
      {
        int whole[6];
        in->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), whole);
        in->Set(vtkStreamingDemandDrivenPipeline::UPDATE_EXTENT(), whole, 6);
      }
      in->Set(vtkStreamingDemandDrivenPipeline::UPDATE_PIECE_NUMBER(), 0);
      in->Set(vtkStreamingDemandDrivenPipeline::UPDATE_NUMBER_OF_PIECES(), 1);
    }
  }
  vtkInformation* in = inputs[0]->GetInformationObject(0);
  vtkMultiProcessController* server = vtkMultiProcessController::GetGlobalController();
  this->IsInParts =
      server && server->GetNumberOfProcesses() > 1 && bigus::HasExchange() && in->Get(bigus::ChunksOfPiecesKey()) > 0;
  if (this->IsInParts)
  {
    in->Set(vtkStreamingDemandDrivenPipeline::UPDATE_PIECE_NUMBER(), server->GetLocalProcessId());
    in->Set(vtkStreamingDemandDrivenPipeline::UPDATE_NUMBER_OF_PIECES(), server->GetNumberOfProcesses());
  }
  this->Reslice->SetController(this->IsInParts ? server : nullptr);
  return 1;
}

bool vtkBigusFieldSlice::MeasureField(vtkPolyData* field)
{
  vtkMath::UninitializeBounds(this->FieldBounds);
  if (field->GetNumberOfPoints() > 0)
  {
    field->GetBounds(this->FieldBounds);
  }
  if (!this->IsInParts)
  {
    return true;
  }
  vtkMultiProcessController* server = vtkMultiProcessController::GetGlobalController();
  const int isHere = field->GetFieldData()->GetArray(bigus::kChunksArray) ? 1 : 0;
  int isThere = 0;
  server->AllReduce(&isHere, &isThere, 1, vtkCommunicator::MIN_OP);
  if (!isThere)
  {
    return this->Fail(isHere ? "Another process of the server could not read its part of the field."
                             : "This process of the server could not read its part of the field.");
  }
  for (int k = 0; k < 6; ++k)
  {
    const double none = k % 2 ? -VTK_DOUBLE_MAX : VTK_DOUBLE_MAX;
    const double own = field->GetNumberOfPoints() > 0 ? this->FieldBounds[k] : none;
    server->AllReduce(&own, &this->FieldBounds[k], 1, k % 2 ? vtkCommunicator::MAX_OP : vtkCommunicator::MIN_OP);
  }
  return true;
}

bool vtkBigusFieldSlice::PlaceAtPlane()
{
  Eigen::Matrix3d axes;
  if (!AxesOf(this->Normal, this->Down, axes))
  {
    return this->Fail("Normal is (" + std::to_string(this->Normal[0]) + ", " + std::to_string(this->Normal[1]) + ", " +
                      std::to_string(this->Normal[2]) + "); give a vector that is finite and not 0.");
  }
  if (!(this->PixelSize >= 0 && std::isfinite(this->PixelSize)))
  {
    return this->Fail("PixelSize is " + std::to_string(this->PixelSize) + " mm; give 0 (automatic) or more.");
  }
  double pixel = this->PixelSize;
  double centre[2] = {0, 0};  // of the picture, mm from Origin along the axes
  const Eigen::Map<const Eigen::Matrix<double, 3, 2, Eigen::RowMajor>> ends(this->FieldBounds);
  for (int axis = 0; axis < 2 && this->PixelSize == 0 && ends(0, 0) <= ends(0, 1); ++axis)
  {
    const Eigen::Vector3d direction = axes.col(axis), middle = ends.rowwise().mean();
    const Eigen::Vector3d sizes = ends.col(1) - ends.col(0);
    centre[axis] = direction.dot(middle - Eigen::Vector3d(this->Origin));
    pixel = std::max(pixel, direction.cwiseAbs().dot(sizes) / std::max(1, this->Size[axis] - 1));
  }
  pixel = pixel > 0 ? pixel : 1;  // a field of one point, or none
  this->Reslice->SetResliceAxesDirectionCosines(axes.data());
  this->Reslice->SetResliceAxesOrigin(this->Origin);
  this->Reslice->SetOutputSpacing(pixel, pixel, 1);
  this->Reslice->SetOutputOrigin(centre[0] - 0.5 * (this->Size[0] - 1) * pixel,
                                 centre[1] - 0.5 * (this->Size[1] - 1) * pixel, 0);
  this->Reslice->SetOutputExtent(0, this->Size[0] - 1, 0, this->Size[1] - 1, 0, 0);
  return true;
}

bool vtkBigusFieldSlice::PlaceAtFrame(vtkImageData* sweep)
{
  int extent[6];
  sweep->GetExtent(extent);
  vtkDataArray* poses = sweep->GetFieldData()->GetArray("ImageToReference");
  if (!poses || poses->GetNumberOfComponents() != 16 || poses->GetNumberOfTuples() <= this->Frame)
  {
    return this->Fail("Frame is " + std::to_string(this->Frame) + " and the sweep has " +
                      std::to_string(poses ? poses->GetNumberOfTuples() : 0) +
                      " poses in its field data ImageToReference [16]; give a frame that is there, counted from 0.");
  }
  vtkNew<vtkMatrix4x4> pose;
  poses->GetTuple(this->Frame, pose->GetData());
  vtkNew<vtkMatrix4x4> first;  // poses act on indices, which need not begin at 0
  first->SetElement(0, 3, extent[0]);
  first->SetElement(1, 3, extent[2]);
  vtkMatrix4x4::Multiply4x4(pose, first, pose);
  this->Reslice->SetOutputToFrame(pose, extent[1] - extent[0] + 1, extent[3] - extent[2] + 1);
  return true;
}

int vtkBigusFieldSlice::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkPolyData* field = vtkPolyData::GetData(inputs[0]);
  vtkImageData* sweep = vtkImageData::GetData(inputs[1]);
  vtkImageData* output = vtkImageData::GetData(outputs);
  output->Initialize();
  this->SetErrorCode(vtkErrorCode::NoError);
  if (!this->MeasureField(field) || !(this->Frame >= 0 ? this->PlaceAtFrame(sweep) : this->PlaceAtPlane()))
  {
    return 0;
  }

  // The same data object at every update, so that the reslice keeps the field on its engine while the plane moves.
  this->Reslice->SetInputDataObject(field);
  this->Reslice->SetRecordedFrames(sweep);
  this->Reslice->SetGenerateStandardErrorOutput(this->StandardError);
  this->Reslice->SetGenerateLabelOutput(this->Labels);
  this->Reslice->SetAbortExecute(0);
  vtkNew<vtkCallbackCommand> error;
  error->SetCallback(ForwardError);
  error->SetClientData(this);
  const unsigned long observer = this->Reslice->AddObserver(vtkCommand::ErrorEvent, error);
  this->Reslice->Update();
  this->Reslice->RemoveObserver(observer);
  if (this->Reslice->GetErrorCode() != vtkErrorCode::NoError)
  {
    this->SetErrorCode(this->Reslice->GetErrorCode());
    return 0;
  }
  vtkImageData* image = this->Reslice->GetOutput();
  vtkDataArray* pixels = image->GetPointData()->GetScalars();
  if (!pixels)  // aborted
  {
    return 1;
  }

  // Index (i, j) lies at axes (origin + spacing (i, j, 0)); the axes of a frame are as long as its pixels.
  const RowMajorMatrix axes = Eigen::Map<const RowMajorMatrix>(this->Reslice->GetResliceAxes()->GetData());
  const Eigen::Vector3d place =
      axes.leftCols<3>().topRows<3>() * Eigen::Vector3d(image->GetOrigin()) + axes.topRightCorner<3, 1>();
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> direction = axes.topLeftCorner<3, 3>();
  Eigen::Vector3d spacing(image->GetSpacing());
  spacing.array() *= direction.colwise().norm().transpose().array();
  spacing[2] = 1;
  direction.colwise().normalize();
  direction.col(2) = direction.col(0).cross(direction.col(1));
  output->SetExtent(image->GetExtent());
  output->SetOrigin(place.data());
  output->SetSpacing(spacing.data());
  output->SetDirectionMatrix(direction.data());

  vtkPointData* arrays = output->GetPointData();
  const auto add = [arrays](vtkDataArray* array, const char* name)
  {
    vtkSmartPointer<vtkDataArray> named = vtkSmartPointer<vtkDataArray>::Take(array->NewInstance());
    named->ShallowCopy(array);
    named->SetName(name);
    arrays->AddArray(named);
  };
  const char* const names[] = {"Intensity", "Scattering", "LabelShare"};
  const char* shown = names[this->GetOutputMode()];
  add(pixels, shown);
  arrays->SetActiveScalars(shown);
  vtkDataArray* coverage = this->Reslice->GetCoverageOutput()->GetPointData()->GetScalars();
  add(coverage, "Coverage");
  if (sweep)
  {
    add(this->Reslice->GetDistanceOutput()->GetPointData()->GetScalars(), "Distance");
  }
  if (this->StandardError)
  {
    add(this->Reslice->GetStandardErrorOutput()->GetPointData()->GetScalars(), "StandardError");
  }
  if (this->Labels)
  {
    vtkImageData* labels = this->Reslice->GetLabelOutput();
    add(labels->GetPointData()->GetScalars(), "Labels");
    bigus::ReplaceLabelNames(output, bigus::LabelNamesOf(labels));
  }
  const vtkIdType count = pixels->GetNumberOfTuples();
  if (this->Frame >= 0 && sweep->GetPointData()->GetScalars())
  {
    vtkDataArray* frames = sweep->GetPointData()->GetScalars();
    vtkSmartPointer<vtkDataArray> recorded = vtkSmartPointer<vtkDataArray>::Take(frames->NewInstance());
    recorded->SetName("Recorded");
    recorded->SetNumberOfTuples(count);
    recorded->InsertTuples(0, count, this->Frame * count, frames);
    arrays->AddArray(recorded);
  }
  if (this->HideUnseen)
  {
    vtkNew<vtkUnsignedCharArray> hidden;
    hidden->SetName(vtkDataSetAttributes::GhostArrayName());
    hidden->SetNumberOfValues(count);
    const double least = this->CoverageThreshold * this->Reslice->GetMeanCoverage();
    for (vtkIdType pixel = 0; pixel < count; ++pixel)
    {
      const bool seen = coverage->GetComponent(pixel, 0) > least;
      hidden->SetValue(pixel, seen ? 0 : vtkDataSetAttributes::HIDDENPOINT);
    }
    arrays->AddArray(hidden);
  }
  return 1;
}
