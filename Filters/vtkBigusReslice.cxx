// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusReslice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "Core/Model/Error.h"
#include "Core/Model/FrameDistance.h"
#include "Data/SweepData.h"
#include "FieldRenderer.h"
#include "PipelineSupport.h"
#include "vtkExecutive.h"
#include "vtkHomogeneousTransform.h"
#include "vtkImageData.h"
#include "vtkImageStencilData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkMath.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"

vtkStandardNewMacro(vtkBigusReslice);
vtkCxxSetObjectMacro(vtkBigusReslice, ResliceAxes, vtkMatrix4x4);
vtkCxxSetObjectMacro(vtkBigusReslice, ResliceTransform, vtkAbstractTransform);
vtkCxxSetObjectMacro(vtkBigusReslice, InformationInput, vtkImageData);
vtkCxxSetObjectMacro(vtkBigusReslice, RecordedFrames, vtkImageData);

struct vtkBigusReslice::Recorded
{
  std::shared_ptr<const bigus::Sweep> sweep;
  vtkImageData* image = nullptr;  // what it was read from, and when
  vtkMTimeType time = 0;
};

namespace
{

using RowMajorMatrix = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

Eigen::Matrix4d ToEigen(vtkMatrix4x4* matrix)
{
  return Eigen::Map<const RowMajorMatrix>(matrix->GetData());
}

// Resliced coordinates to the field's frame: affine, or Error.
Eigen::Matrix4d OutputToWorld(vtkMatrix4x4* axes, vtkAbstractTransform* transform)
{
  Eigen::Matrix4d matrix = axes ? ToEigen(axes) : Eigen::Matrix4d::Identity();
  if (transform)
  {
    auto* homogeneous = vtkHomogeneousTransform::SafeDownCast(transform);
    if (!homogeneous)
    {
      throw bigus::Error(std::string("ResliceTransform is a ") + transform->GetClassName() +
                         ", which may bend planes; give a linear transform, for example a vtkTransform.");
    }
    homogeneous->Update();
    matrix = ToEigen(homogeneous->GetMatrix()) * matrix;
  }
  if (!matrix.allFinite())
  {
    throw bigus::Error("ResliceAxes or ResliceTransform holds a value that is not finite.");
  }
  const Eigen::RowVector4d last = matrix.row(3);
  if (last[3] == 0 || last.head<3>().cwiseAbs().maxCoeff() > 1e-12 * std::abs(last[3]))
  {
    throw bigus::Error(
        "ResliceAxes and ResliceTransform together are perspective (their last row is not 0 0 0 1); "
        "a slice must stay evenly spaced.");
  }
  return matrix / last[3];
}

// Adds the runs of seen pixels in a band's rows to the stencil.
void InsertRuns(const bigus::PixelBand& band, float threshold, vtkImageStencilData* stencil)
{
  int extent[6];
  stencil->GetExtent(extent);
  const vtkIdType columns = extent[1] - extent[0] + 1;
  const vtkIdType rows = extent[3] - extent[2] + 1;
  for (vtkIdType start = 0; start < band.count; start += columns)
  {
    const vtkIdType line = (band.first + start) / columns;
    const int y = extent[2] + static_cast<int>(line % rows);
    const int z = extent[4] + static_cast<int>(line / rows);
    const float* coverage = band.coverage + start;
    for (int x = 0; x < columns; ++x)
    {
      const int begin = x;
      while (x < columns && coverage[x] > threshold)
      {
        ++x;
      }
      if (x > begin)
      {
        stencil->InsertNextExtent(extent[0] + begin, extent[0] + x - 1, y, z);
      }
    }
  }
}

constexpr int kDefaultDimension = 256;  // pixels along the longest side of a field, where no geometry is given
constexpr double kLargestIndex = 1e9;   // fits an int; so large an output is refused later

// The grid that default geometry is derived from, mm along the axes of the field's frame.
struct InputGrid
{
  Eigen::Vector3d spacing, origin;
  int extent[6];

  Eigen::Vector3d Centre() const
  {
    Eigen::Vector3d centre;
    for (int j = 0; j < 3; ++j)
    {
      centre[j] = origin[j] + 0.5 * (static_cast<double>(extent[2 * j]) + extent[2 * j + 1]) * spacing[j];
    }
    return centre;
  }

  // The box around the grid's corners after a transform.
  Eigen::AlignedBox3d BoundsFrom(const Eigen::Matrix4d& transform) const
  {
    Eigen::AlignedBox3d box;
    for (int corner = 0; corner < 8; ++corner)
    {
      Eigen::Vector3d point;
      for (int j = 0; j < 3; ++j)
      {
        point[j] = origin[j] + extent[2 * j + (corner >> j & 1)] * spacing[j];
      }
      box.extend((transform * point.homogeneous()).hnormalized());
    }
    return box;
  }
};

InputGrid GridOf(vtkImageData* image)
{
  InputGrid grid;
  image->GetSpacing(grid.spacing.data());
  image->GetOrigin(grid.origin.data());
  image->GetExtent(grid.extent);
  return grid;
}

InputGrid GridOf(const bigus::FieldGrid& field)
{
  const Eigen::Vector3i last = field.dimensions - Eigen::Vector3i::Ones();
  return {Eigen::Vector3d::Constant(field.spacing), field.origin, {0, last[0], 0, last[1], 0, last[2]}};
}

vtkImageStencilData* StencilOf(vtkInformationVector* outputs)
{
  return vtkImageStencilData::SafeDownCast(vtkDataObject::GetData(outputs, 2));
}

}  // namespace

vtkBigusReslice::vtkBigusReslice() : Sweep(std::make_unique<Recorded>())
{
  this->SetNumberOfOutputPorts(4);
  // VTK's executive cannot make stencils by name.
  this->GetExecutive()->SetOutputData(2, vtkSmartPointer<vtkImageStencilData>::New());
}

vtkBigusReslice::~vtkBigusReslice()
{
  this->SetResliceAxes(nullptr);
  this->SetResliceTransform(nullptr);
  this->SetInformationInput(nullptr);
  this->SetRecordedFrames(nullptr);
}

void vtkBigusReslice::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "ResliceAxes: " << this->ResliceAxes << "\n";
  if (this->ResliceAxes)
  {
    this->ResliceAxes->PrintSelf(os, indent.GetNextIndent());
  }
  os << indent << "ResliceTransform: " << this->ResliceTransform << "\n";
  os << indent << "InformationInput: " << this->InformationInput << "\n";
  os << indent << "RecordedFrames: " << this->RecordedFrames << "\n";
  os << indent << "OutputExtent:";
  for (int bound : this->OutputExtent)
  {
    os << " " << bound;
  }
  os << (this->ComputeOutputExtent ? " (default)\n" : "\n");
  os << indent << "OutputDimensionality: " << this->OutputDimensionality << "\n";
  os << indent << "TransformInputSampling: " << (this->TransformInputSampling ? "On\n" : "Off\n");
  os << indent << "AutoCropOutput: " << (this->AutoCropOutput ? "On\n" : "Off\n");
  os << indent << "SlabNumberOfSlices: " << this->SlabNumberOfSlices << "\n";
  os << indent << "SlabMode: " << this->GetSlabModeAsString() << "\n";
  os << indent << "SlabSliceSpacingFraction: " << this->SlabSliceSpacingFraction << "\n";
  os << indent << "SlabTrapezoidIntegration: " << (this->SlabTrapezoidIntegration ? "On\n" : "Off\n");
  os << indent << "CoverageThreshold: " << this->CoverageThreshold << "\n";
  os << indent << "BackgroundLevel: " << this->BackgroundLevel << "\n";
  os << indent << "GenerateCoverageOutput: " << (this->GenerateCoverageOutput ? "On\n" : "Off\n");
  os << indent << "GenerateStencilOutput: " << (this->GenerateStencilOutput ? "On\n" : "Off\n");
}

//------------------------------------------------------------------------------
// Axes

void vtkBigusReslice::SetResliceAxesDirectionCosines(double x0, double x1, double x2, double y0, double y1, double y2,
                                                     double z0, double z1, double z2)
{
  const double cosines[9] = {x0, x1, x2, y0, y1, y2, z0, z1, z2};
  this->SetResliceAxesDirectionCosines(cosines);
}

void vtkBigusReslice::SetResliceAxesDirectionCosines(const double x[3], const double y[3], const double z[3])
{
  this->SetResliceAxesDirectionCosines(x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]);
}

void vtkBigusReslice::SetResliceAxesDirectionCosines(const double xyz[9])
{
  if (!this->ResliceAxes)
  {
    this->ResliceAxes = vtkMatrix4x4::New();
    this->Modified();
  }
  for (int column = 0; column < 3; ++column)
  {
    for (int row = 0; row < 3; ++row)
    {
      this->ResliceAxes->SetElement(row, column, xyz[3 * column + row]);
    }
    this->ResliceAxes->SetElement(3, column, 0);
  }
}

void vtkBigusReslice::GetResliceAxesDirectionCosines(double x[3], double y[3], double z[3])
{
  double xyz[9];
  this->GetResliceAxesDirectionCosines(xyz);
  std::copy(xyz, xyz + 3, x);
  std::copy(xyz + 3, xyz + 6, y);
  std::copy(xyz + 6, xyz + 9, z);
}

void vtkBigusReslice::GetResliceAxesDirectionCosines(double xyz[9])
{
  for (int column = 0; column < 3; ++column)
  {
    for (int row = 0; row < 3; ++row)
    {
      xyz[3 * column + row] = this->ResliceAxes ? this->ResliceAxes->GetElement(row, column) : row == column;
    }
  }
}

void vtkBigusReslice::SetResliceAxesOrigin(double x, double y, double z)
{
  const double origin[3] = {x, y, z};
  this->SetResliceAxesOrigin(origin);
}

void vtkBigusReslice::SetResliceAxesOrigin(const double origin[3])
{
  if (!this->ResliceAxes)
  {
    this->ResliceAxes = vtkMatrix4x4::New();
    this->Modified();
  }
  for (int row = 0; row < 3; ++row)
  {
    this->ResliceAxes->SetElement(row, 3, origin[row]);
  }
  this->ResliceAxes->SetElement(3, 3, 1);
}

void vtkBigusReslice::GetResliceAxesOrigin(double origin[3])
{
  for (int row = 0; row < 3; ++row)
  {
    origin[row] = this->ResliceAxes ? this->ResliceAxes->GetElement(row, 3) : 0;
  }
}

//------------------------------------------------------------------------------
// Output geometry

void vtkBigusReslice::SetOutputExtent(int x0, int x1, int y0, int y1, int z0, int z1)
{
  const int extent[6] = {x0, x1, y0, y1, z0, z1};
  this->SetOutputExtent(extent);
}

void vtkBigusReslice::SetOutputExtent(const int extent[6])
{
  if (bigus::GiveValues(extent, this->OutputExtent, this->ComputeOutputExtent))
  {
    this->Modified();
  }
}

void vtkBigusReslice::SetOutputExtentToDefault()
{
  if (bigus::TakeValuesBack(0, this->OutputExtent, this->ComputeOutputExtent))
  {
    this->Modified();
  }
}

void vtkBigusReslice::SetOutputToFrame(vtkMatrix4x4* imageToReference, int width, int height)
{
  // The columns of the matrix are steps of a pixel, so an output index is a place along the axes.
  this->SetResliceAxes(imageToReference);
  this->SetOutputSpacing(1, 1, 1);
  this->SetOutputOrigin(0, 0, 0);
  this->SetOutputExtent(0, width - 1, 0, height - 1, 0, 0);
  this->SetOutputDimensionality(2);
}

const char* vtkBigusReslice::GetSlabModeAsString()
{
  const char* const names[] = {"Min", "Max", "Mean", "Sum"};
  return names[this->SlabMode];
}

//------------------------------------------------------------------------------
// Names of vtkImageReslice that mean nothing here

const char* vtkBigusReslice::GetInterpolationModeAsString()
{
  const char* const names[] = {"NearestNeighbor", "Linear", "Cubic"};
  return names[this->InterpolationMode];
}

void vtkBigusReslice::Refuse(const char* what, const char* instead)
{
  vtkErrorMacro(<< "vtkBigusReslice has no " << what << "; " << instead);
}

void vtkBigusReslice::SetWrap(vtkTypeBool wrap)
{
  if (wrap)
  {
    this->Refuse("Wrap",
                 "a field does not end at a border. Apply vtkImageWrapPad or vtkImageReslice to the output of "
                 "vtkBigusVoxelizer.");
  }
}

void vtkBigusReslice::SetMirror(vtkTypeBool mirror)
{
  if (mirror)
  {
    this->Refuse("Mirror",
                 "a field does not end at a border. Apply vtkImageMirrorPad or vtkImageReslice to the output of "
                 "vtkBigusVoxelizer.");
  }
}

void vtkBigusReslice::SetInterpolator(vtkAbstractImageInterpolator* interpolator)
{
  if (interpolator)
  {
    this->Refuse("Interpolator",
                 "a field has a value at every point. To smooth across the plane set ElevationSigma; to smooth in it "
                 "apply vtkImageGaussianSmooth to the output.");
  }
}

void vtkBigusReslice::SetScalarShift(double shift)
{
  if (shift != 0)
  {
    this->Refuse("ScalarShift", "apply vtkImageShiftScale to the output.");
  }
}

void vtkBigusReslice::SetScalarScale(double scale)
{
  if (scale != 1)
  {
    this->Refuse("ScalarScale", "apply vtkImageShiftScale to the output.");
  }
}

void vtkBigusReslice::SetStencilData(vtkImageStencilData* stencil)
{
  if (stencil)
  {
    this->Refuse("input stencil", "apply vtkImageStencil to the output.");
  }
}

vtkMTimeType vtkBigusReslice::GetMTime()
{
  vtkMTimeType time = this->Superclass::GetMTime();
  for (vtkObject* part :
       {static_cast<vtkObject*>(this->ResliceAxes), static_cast<vtkObject*>(this->ResliceTransform),
        static_cast<vtkObject*>(this->InformationInput), static_cast<vtkObject*>(this->RecordedFrames)})
  {
    time = part ? std::max(time, part->GetMTime()) : time;
  }
  return time;
}

vtkImageData* vtkBigusReslice::GetCoverageOutput()
{
  return vtkImageData::SafeDownCast(this->GetOutputDataObject(1));
}

vtkImageData* vtkBigusReslice::GetDistanceOutput()
{
  return vtkImageData::SafeDownCast(this->GetOutputDataObject(3));
}

vtkImageStencilData* vtkBigusReslice::GetStencilOutput()
{
  return vtkImageStencilData::SafeDownCast(this->GetOutputDataObject(2));
}

void vtkBigusReslice::SetStencilOutput(vtkImageStencilData* stencil)
{
  if (stencil != this->GetStencilOutput())
  {
    vtkNew<vtkImageStencilData> own;  // which the pipeline cannot make by itself
    this->GetExecutive()->SetOutputData(2, stencil ? stencil : own.Get());
    this->Modified();
  }
}

//------------------------------------------------------------------------------
// Pipeline

int vtkBigusReslice::FillOutputPortInformation(int port, vtkInformation* info)
{
  info->Set(vtkDataObject::DATA_TYPE_NAME(), port == 2 ? "vtkImageStencilData" : "vtkImageData");
  return 1;
}

int vtkBigusReslice::RequestInformation(vtkInformation* request, vtkInformationVector** inputs,
                                        vtkInformationVector* outputs)
{
  for (const int port : {1, 3})
  {
    vtkDataObject::SetPointDataActiveScalarInfo(outputs->GetInformationObject(port), VTK_FLOAT, 1);
  }
  return this->Superclass::RequestInformation(request, inputs, outputs);
}

void vtkBigusReslice::ComputeGrid(double spacing[3], double origin[3], int extent[6])
{
  std::copy_n(this->OutputExtent, 6, extent);
  if (this->ComputeOutputSpacing || this->ComputeOutputOrigin || this->ComputeOutputExtent)
  {
    const InputGrid in = this->InformationInput
                             ? GridOf(this->InformationInput)
                             : GridOf(bigus::GridOver(this->UpdatedField(), Eigen::Matrix3d::Identity(),
                                                      kDefaultDimension, this->Parts()));

    // The grid is turned to the output's axes as vtkImageReslice does: spacing and size are averaged with the squares of
    // the direction cosines as weights, and the centre is kept. Weights of the identity leave it as it stands.
    const Eigen::Matrix4d axes = this->ResliceAxes ? ToEigen(this->ResliceAxes) : Eigen::Matrix4d::Identity();
    const Eigen::Matrix4d turn = this->TransformInputSampling ? axes : Eigen::Matrix4d::Identity();
    const Eigen::Vector4d centre = turn.inverse() * in.Centre().homogeneous();
    if (!centre.allFinite() || !axes.inverse().allFinite())
    {
      throw bigus::Error(
          "ResliceAxes cannot be inverted, so there is no default output geometry; set "
          "OutputSpacing, OutputOrigin and OutputExtent, or mend the axes.");
    }
    const Eigen::AlignedBox3d crop =
        this->AutoCropOutput ? in.BoundsFrom(OutputToWorld(this->ResliceAxes, this->ResliceTransform).inverse())
                             : Eigen::AlignedBox3d();
    for (int i = 0; i < 3; ++i)
    {
      const Eigen::Array3d weight = turn.block<3, 1>(0, i).array().square();
      const double sum = weight.sum();
      double length = 0, first = 0;
      for (int j = 0; j < 3; ++j)
      {
        length += weight[j] * (static_cast<double>(in.extent[2 * j + 1]) - in.extent[2 * j]) * std::abs(in.spacing[j]);
        first += weight[j] * in.extent[2 * j];
      }
      length = this->AutoCropOutput ? crop.sizes()[i] : length / (sum * std::sqrt(sum));
      if (this->ComputeOutputSpacing)
      {
        spacing[i] = (weight * in.spacing.array().abs()).sum() / sum;
      }
      if (this->ComputeOutputExtent)
      {
        extent[2 * i] = vtkMath::Round(std::clamp(first / sum, -kLargestIndex, kLargestIndex));
        extent[2 * i + 1] = vtkMath::Round(extent[2 * i] + std::min(std::abs(length / spacing[i]), kLargestIndex));
      }
      if (this->ComputeOutputOrigin)
      {
        origin[i] = this->AutoCropOutput
                        ? crop.min()[i] - extent[2 * i] * spacing[i]
                        : centre[i] - 0.5 * (static_cast<double>(extent[2 * i]) + extent[2 * i + 1]) * spacing[i];
      }
    }
  }
  for (int axis = this->OutputDimensionality; axis < 3; ++axis)
  {
    extent[2 * axis] = extent[2 * axis + 1] = 0;
    origin[axis] = 0;
  }
  for (int axis = 0; axis < 3; ++axis)
  {
    if (static_cast<double>(extent[2 * axis + 1]) - extent[2 * axis] + 1 > std::numeric_limits<int>::max())
    {
      throw bigus::Error("OutputExtent runs from " + std::to_string(extent[2 * axis]) + " to " +
                         std::to_string(extent[2 * axis + 1]) + " along axis " + std::to_string(axis) +
                         "; an axis can have at most 2^31 - 1 pixels.");
    }
  }
}

void vtkBigusReslice::ComputeIndexToWorld(const double spacing[3], const double origin[3], double matrix[16])
{
  Eigen::Matrix4d indexToOutput = Eigen::Matrix4d::Identity();
  indexToOutput.diagonal().head<3>() = Eigen::Map<const Eigen::Vector3d>(spacing);
  indexToOutput.col(3).head<3>() = Eigen::Map<const Eigen::Vector3d>(origin);
  Eigen::Map<RowMajorMatrix> indexToWorld(matrix);
  indexToWorld = OutputToWorld(this->ResliceAxes, this->ResliceTransform) * indexToOutput;
}

void vtkBigusReslice::AllocateOutputs(vtkInformationVector* outputs, const int extent[6])
{
  if (!(this->CoverageThreshold >= 0))
  {
    throw bigus::Error("CoverageThreshold is " + std::to_string(this->CoverageThreshold) + "; it must be at least 0.");
  }
  this->Superclass::AllocateOutputs(outputs, extent);
  vtkImageData* image = vtkImageData::GetData(outputs, 0);
  vtkImageData* coverage = vtkImageData::GetData(outputs, 1);
  coverage->SetOrigin(image->GetOrigin());
  coverage->SetSpacing(image->GetSpacing());
  if (this->GenerateCoverageOutput)
  {
    bigus::AllocatePixels(coverage, extent, VTK_FLOAT, "Coverage");
  }
  if (this->GenerateStencilOutput)
  {
    vtkImageStencilData* stencil = StencilOf(outputs);
    stencil->SetOrigin(image->GetOrigin());
    stencil->SetSpacing(image->GetSpacing());
    stencil->SetExtent(extent);
    stencil->AllocateExtents();
  }
  if (this->RecordedFrames)
  {
    this->FillDistance(outputs, extent);
  }
}

void vtkBigusReslice::FillDistance(vtkInformationVector* outputs, const int extent[6])
{
  Recorded& recorded = *this->Sweep;
  if (recorded.image != this->RecordedFrames || recorded.time != this->RecordedFrames->GetMTime())
  {
    recorded = {bigus::SweepFromImage(this->RecordedFrames).sweep, this->RecordedFrames,
                this->RecordedFrames->GetMTime()};
  }
  vtkImageData* image = vtkImageData::GetData(outputs, 0);
  vtkImageData* distance = vtkImageData::GetData(outputs, 3);
  distance->SetOrigin(image->GetOrigin());
  distance->SetSpacing(image->GetSpacing());
  bigus::AllocatePixels(distance, extent, VTK_FLOAT, "Distance");

  RowMajorMatrix indexToWorld;
  this->ComputeIndexToWorld(image->GetSpacing(), image->GetOrigin(), indexToWorld.data());
  bigus::SlicePlane plane;
  plane.columnStep = indexToWorld.col(0).head<3>();
  plane.rowStep = indexToWorld.col(1).head<3>();
  plane.width = extent[1] - extent[0] + 1;
  plane.height = extent[3] - extent[2] + 1;
  std::vector<int> frames(recorded.sweep->NumberOfFrames());
  std::iota(frames.begin(), frames.end(), 0);
  for (int k = extent[4]; k <= extent[5]; ++k)
  {
    plane.origin = (indexToWorld * Eigen::Vector4d(extent[0], extent[2], k, 1)).head<3>();
    bigus::DistanceToFrames(*recorded.sweep, frames, plane,
                            static_cast<float*>(distance->GetScalarPointer(extent[0], extent[2], k)));
  }
}

bigus::Slab vtkBigusReslice::ComputeSlab()
{
  if (!std::isfinite(this->SlabSliceSpacingFraction))
  {
    throw bigus::Error("SlabSliceSpacingFraction is not finite; 1 puts a slab's planes one OutputSpacing apart.");
  }
  static_assert(bigus::Slab::Min == VTK_IMAGE_SLAB_MIN && bigus::Slab::Sum == VTK_IMAGE_SLAB_SUM);
  return {this->SlabNumberOfSlices, this->SlabSliceSpacingFraction, static_cast<bigus::Slab::Mode>(this->SlabMode),
          this->SlabTrapezoidIntegration != 0};
}

bool vtkBigusReslice::FillsBackground() const
{
  // Where nothing is seen S and I are 0 already.
  return this->BackgroundLevel != 0 || this->CoverageThreshold > 0;
}

bool vtkBigusReslice::NeedsCoverage()
{
  return this->FillsBackground() || this->GenerateCoverageOutput || this->GenerateStencilOutput;
}

void vtkBigusReslice::StoreBand(const bigus::PixelBand& band, vtkInformationVector* outputs)
{
  const float threshold = static_cast<float>(this->CoverageThreshold);
  if (this->FillsBackground())
  {
    const bool bytes = this->OutputScalarType == VTK_UNSIGNED_CHAR;
    const float background = static_cast<float>(bytes ? this->BackgroundLevel / 255 : this->BackgroundLevel);
    for (vtkIdType pixel = 0; pixel < band.count; ++pixel)
    {
      band.image[pixel] = band.coverage[pixel] > threshold ? band.image[pixel] : background;
    }
  }
  this->Superclass::StoreBand(band, outputs);
  if (this->GenerateCoverageOutput)
  {
    bigus::StorePixels(band.coverage, band.first, band.count, vtkImageData::GetData(outputs, 1));
  }
  if (this->GenerateStencilOutput)
  {
    InsertRuns(band, threshold, StencilOf(outputs));
  }
}
