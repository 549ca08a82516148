// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldSlice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "Data/FieldData.h"
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
#include "vtkMatrix3x3.h"
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

using Vector = std::array<double, 3>;

// The picture's axes, unit vectors: along its columns, along its rows, and the normal.
struct Axes
{
  Vector x, y, z;
};

// Right-handed unit axes: z along the normal, y along `down` brought into the plane.
bool AxesOf(const double normal[3], const double down[3], Axes& axes)
{
  std::copy_n(normal, 3, axes.z.begin());
  if (!(vtkMath::Normalize(axes.z.data()) > 0) || !std::isfinite(axes.z[0] + axes.z[1] + axes.z[2]))
  {
    return false;
  }
  for (const Vector& direction : {Vector{down[0], down[1], down[2]}, Vector{0, 0, 1}, Vector{1, 0, 0}})
  {
    const double length = vtkMath::Norm(direction.data());
    vtkMath::Cross(direction.data(), axes.z.data(), axes.x.data());
    // Nearer to the normal than about a thousandth of a degree rounding errors would turn the picture.
    if (vtkMath::Normalize(axes.x.data()) > 1e-5 * length)
    {
      vtkMath::Cross(axes.z.data(), axes.x.data(), axes.y.data());
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
vtkBigusForwardMacro(CoverageThreshold, double);
vtkBigusForwardMacro(OutputMode, int);
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
  Axes axes;
  if (!AxesOf(this->Normal, this->Down, axes))
  {
    return this->Fail("Normal is (" + std::to_string(this->Normal[0]) + ", " + std::to_string(this->Normal[1]) + ", " +
                      std::to_string(this->Normal[2]) + "); give a vector that is finite and not 0.");
  }
  if (!(this->PixelSize >= 0 && std::isfinite(this->PixelSize)))
  {
    return this->Fail("PixelSize is " + std::to_string(this->PixelSize) + " mm; give 0 (automatic) or more.");
  }
  const double middle[2] = {0.5 * (this->Size[0] - 1), 0.5 * (this->Size[1] - 1)};
  double pixel = this->PixelSize;
  double centre[2] = {0, 0};  // of the picture, mm from Origin along the axes
  if (pixel == 0)
  {
    const double* bounds = this->FieldBounds;
    const bool empty = bounds[0] > bounds[1];
    const Vector* along[2] = {&axes.x, &axes.y};
    for (int axis = 0; axis < 2 && !empty; ++axis)
    {
      double low = VTK_DOUBLE_MAX, high = -VTK_DOUBLE_MAX;
      for (int corner = 0; corner < 8; ++corner)
      {
        double place = 0;
        for (int i = 0; i < 3; ++i)
        {
          place += (bounds[2 * i + (corner >> i & 1)] - this->Origin[i]) * (*along[axis])[i];
        }
        low = std::min(low, place);
        high = std::max(high, place);
      }
      centre[axis] = 0.5 * (low + high);
      pixel = std::max(pixel, (high - low) / std::max(1, this->Size[axis] - 1));
    }
    pixel = pixel > 0 ? pixel : 1;  // a field of one point, or none
  }
  this->Reslice->SetResliceAxesDirectionCosines(axes.x.data(), axes.y.data(), axes.z.data());
  this->Reslice->SetResliceAxesOrigin(this->Origin);
  this->Reslice->SetOutputSpacing(pixel, pixel, 1);
  this->Reslice->SetOutputOrigin(centre[0] - middle[0] * pixel, centre[1] - middle[1] * pixel, 0);
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
  vtkMatrix4x4* axes = this->Reslice->GetResliceAxes();
  double spacing[3], place[4] = {0, 0, 0, 1};
  image->GetSpacing(spacing);
  image->GetOrigin(place);
  vtkNew<vtkMatrix3x3> direction;
  Vector columns[3];
  for (int axis = 0; axis < 2; ++axis)
  {
    for (int i = 0; i < 3; ++i)
    {
      columns[axis][i] = axes->GetElement(i, axis);
    }
    spacing[axis] *= vtkMath::Normalize(columns[axis].data());
  }
  vtkMath::Cross(columns[0].data(), columns[1].data(), columns[2].data());
  spacing[2] = 1;
  for (int axis = 0; axis < 3; ++axis)
  {
    for (int i = 0; i < 3; ++i)
    {
      direction->SetElement(i, axis, columns[axis][i]);
    }
  }
  axes->MultiplyPoint(place, place);
  output->SetExtent(image->GetExtent());
  output->SetOrigin(place);
  output->SetSpacing(spacing);
  output->SetDirectionMatrix(direction);

  vtkPointData* arrays = output->GetPointData();
  const auto add = [arrays](vtkDataArray* array, const char* name)
  {
    vtkSmartPointer<vtkDataArray> named = vtkSmartPointer<vtkDataArray>::Take(array->NewInstance());
    named->ShallowCopy(array);
    named->SetName(name);
    arrays->AddArray(named);
  };
  const char* shown = this->GetOutputMode() == vtkBigusFieldToImage::Intensity ? "Intensity" : "Scattering";
  add(pixels, shown);
  arrays->SetActiveScalars(shown);
  vtkDataArray* coverage = this->Reslice->GetCoverageOutput()->GetPointData()->GetScalars();
  add(coverage, "Coverage");
  if (sweep)
  {
    add(this->Reslice->GetDistanceOutput()->GetPointData()->GetScalars(), "Distance");
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
    for (vtkIdType pixel = 0; pixel < count; ++pixel)
    {
      const bool seen = coverage->GetComponent(pixel, 0) > this->GetCoverageThreshold();
      hidden->SetValue(pixel, seen ? 0 : vtkDataSetAttributes::HIDDENPOINT);
    }
    arrays->AddArray(hidden);
  }
  return 1;
}
