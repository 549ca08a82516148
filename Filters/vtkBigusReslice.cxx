// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusReslice.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Model/FieldTransform.h"
#include "Core/Slicing/Pixels.h"
#include "Core/StandardError/StandardError.h"
#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "Data/SweepData.h"
#include "FieldRenderer.h"
#include "PipelineSupport.h"
#include "vtkExecutive.h"
#include "vtkHomogeneousTransform.h"
#include "vtkImageData.h"
#include "vtkImageStencilData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"
#include "vtkSmartPointer.h"

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

// None: the identity.
Eigen::Matrix4d ToEigen(vtkMatrix4x4* matrix)
{
  return matrix ? Eigen::Matrix4d(Eigen::Map<const RowMajorMatrix>(matrix->GetData())) : Eigen::Matrix4d::Identity();
}

std::optional<Eigen::Matrix4d> ToEigen(vtkAbstractTransform* transform)
{
  if (!transform)
  {
    return std::nullopt;
  }
  auto* homogeneous = vtkHomogeneousTransform::SafeDownCast(transform);
  if (!homogeneous)
  {
    bigus::RefuseTransform("ResliceTransform", transform->GetClassName(), "planes");
  }
  homogeneous->Update();
  return ToEigen(homogeneous->GetMatrix());
}

bigus::OutputGrid GridOf(vtkImageData* image)
{
  bigus::OutputGrid grid;
  image->GetSpacing(grid.spacing.data());
  image->GetOrigin(grid.origin.data());
  image->GetExtent(grid.extent.data());
  return grid;
}

vtkImageStencilData* StencilOf(vtkInformationVector* outputs)
{
  return vtkImageStencilData::SafeDownCast(vtkDataObject::GetData(outputs, 2));
}

}  // namespace

vtkBigusReslice::vtkBigusReslice() : Sweep(std::make_unique<Recorded>())
{
  this->SetNumberOfOutputPorts(6);
  this->StandardErrorPort = 4;
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
  os << indent << "GenerateLabelOutput: " << (this->GenerateLabelOutput ? "On\n" : "Off\n");
  os << indent << "InterpolationMode: " << this->GetInterpolationModeAsString() << "\n";
  os << indent << "Border: " << (this->Border ? "On\n" : "Off\n");
  os << indent << "BorderThickness: " << this->BorderThickness << "\n";
  os << indent << "Optimization: " << (this->Optimization ? "On\n" : "Off\n");
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

vtkBigusDerivedPropertyMacro(vtkBigusReslice, OutputExtent, int, 6, 0);

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

double vtkBigusReslice::GetStandardErrorOfMean(vtkImageData* where)
{
  vtkImageData* const sigma = this->GetStandardErrorOutput();
  const int* const size = sigma->GetDimensions();
  const bool fits =
      !where || (where->GetScalarType() == VTK_UNSIGNED_CHAR && where->GetNumberOfScalarComponents() == 1 &&
                 std::equal(size, size + 3, where->GetDimensions()));
  const bigus::StandardError* const kept = this->KeptStandardError();
  if (!kept || sigma->GetScalarType() != VTK_FLOAT || !sigma->GetScalarPointer() || !fits)
  {
    vtkErrorMacro(
        << "GetStandardErrorOfMean: output 4 must be filled, and the pixels to take be an image of unsigned char of the "
           "same dimensions.");
    return std::numeric_limits<double>::quiet_NaN();
  }
  RowMajorMatrix indexToWorld;
  this->ComputeIndexToWorld(sigma->GetSpacing(), sigma->GetOrigin(), indexToWorld.data());
  return kept->OfMean(bigus::SlicePlane::FromImageToReference(indexToWorld, size[0], size[1]),
                      static_cast<const float*>(sigma->GetScalarPointer()),
                      where ? static_cast<const unsigned char*>(where->GetScalarPointer()) : nullptr, size[2],
                      indexToWorld.col(2).norm());
}

vtkImageData* vtkBigusReslice::GetLabelOutput()
{
  return vtkImageData::SafeDownCast(this->GetOutputDataObject(5));
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
  for (const int port : {1, 3, 4})
  {
    vtkDataObject::SetPointDataActiveScalarInfo(outputs->GetInformationObject(port), VTK_FLOAT, 1);
  }
  vtkDataObject::SetPointDataActiveScalarInfo(outputs->GetInformationObject(5), VTK_UNSIGNED_CHAR, 1);
  return this->Superclass::RequestInformation(request, inputs, outputs);
}

bigus::OutputGrid vtkBigusReslice::ComputeGrid(bigus::GivenGrid given)
{
  if (!this->ComputeOutputExtent)
  {
    given.extent.emplace();
    std::copy_n(this->OutputExtent, 6, given.extent->begin());
  }
  bigus::ResliceSettings settings{ToEigen(this->ResliceAxes), std::nullopt, this->TransformInputSampling != 0,
                                  this->AutoCropOutput != 0, this->OutputDimensionality};
  if (settings.crops && !given.IsWhole())
  {
    settings.transform = ToEigen(this->ResliceTransform);
  }
  return bigus::ResliceGrid(given, settings,
                            [this]
                            {
                              const double axes[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
                              return this->InformationInput ? GridOf(this->InformationInput)
                                                            : this->GridOverInput(axes, bigus::kDefaultDimension);
                            });
}

void vtkBigusReslice::ComputeIndexToWorld(const double spacing[3], const double origin[3], double matrix[16])
{
  const Eigen::Matrix4d outputToWorld =
      bigus::OutputToWorld(ToEigen(this->ResliceAxes), ToEigen(this->ResliceTransform));
  Eigen::Map<RowMajorMatrix> indexToWorld(matrix);
  indexToWorld = bigus::IndexToWorld(outputToWorld, Eigen::Vector3d(spacing), Eigen::Vector3d(origin));
}

void vtkBigusReslice::AllocateOutputs(vtkInformationVector* outputs, const int extent[6])
{
  this->GetSeen().Validate();
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
  if (this->GenerateLabelOutput)
  {
    vtkImageData* labels = vtkImageData::GetData(outputs, 5);
    labels->SetOrigin(image->GetOrigin());
    labels->SetSpacing(image->GetSpacing());
    bigus::AllocatePixels(labels, extent, VTK_UNSIGNED_CHAR, "Labels");
    bigus::ReplaceLabelNames(labels, this->Labelled().Labels());
  }
}

bool vtkBigusReslice::CompleteOutputs(const bigus::GridPart& grid,
                                      const std::function<bool(const int*, float*)>& render,
                                      vtkInformationVector* outputs)
{
  if (this->GenerateLabelOutput && bigus::ExtentSize(grid.extent) > 0)
  {
    this->Labelled().Render(grid, static_cast<std::uint8_t*>(vtkImageData::GetData(outputs, 5)->GetScalarPointer()));
  }
  return this->Superclass::CompleteOutputs(grid, render, outputs);
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
  bigus::Extent part;
  std::copy_n(extent, 6, part.begin());
  bigus::GridDistances(*recorded.sweep, indexToWorld, part, static_cast<float*>(distance->GetScalarPointer()));
}

bigus::Slab vtkBigusReslice::ComputeSlab()
{
  static_assert(bigus::Slab::Min == VTK_IMAGE_SLAB_MIN && bigus::Slab::Sum == VTK_IMAGE_SLAB_SUM);
  const bigus::Slab slab{this->SlabNumberOfSlices, this->SlabSliceSpacingFraction,
                         static_cast<bigus::Slab::Mode>(this->SlabMode), this->SlabTrapezoidIntegration != 0};
  slab.Validate();
  return slab;
}

bigus::Seen vtkBigusReslice::GetSeen() const
{
  return {this->CoverageThreshold, this->BackgroundLevel};
}

bool vtkBigusReslice::NeedsCoverage()
{
  return this->GetSeen().FillsBackground() || this->GenerateCoverageOutput || this->GenerateStencilOutput;
}

bool vtkBigusReslice::KeepsIntensities()
{
  return this->Superclass::KeepsIntensities() && !this->GetSeen().FillsBackground();
}

void vtkBigusReslice::StoreBand(const bigus::PixelBand& band, vtkInformationVector* outputs)
{
  const bigus::Seen seen = this->GetSeen();
  if (seen.FillsBackground())
  {
    seen.FillBackground(band, this->OutputScalarType == VTK_UNSIGNED_CHAR);
  }
  this->Superclass::StoreBand(band, outputs);
  if (this->GenerateCoverageOutput)
  {
    bigus::StorePixels(band.coverage, band.first, band.count, vtkImageData::GetData(outputs, 1));
  }
  if (this->GenerateStencilOutput)
  {
    vtkImageStencilData* stencil = StencilOf(outputs);
    bigus::Extent extent;
    stencil->GetExtent(extent.data());
    seen.ForEachRun(band, extent,
                    [stencil](int first, int last, int y, int z) { stencil->InsertNextExtent(first, last, y, z); });
  }
}
