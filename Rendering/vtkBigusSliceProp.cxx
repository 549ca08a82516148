// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusSliceProp.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include "Core/Model/Error.h"
#include "Core/Model/GaussianField.h"
#include "Core/Slicing/Pixels.h"
#include "Data/FieldData.h"
#include "vtkActor.h"
#include "vtkAlgorithmOutput.h"
#include "vtkBigusReslice.h"
#include "vtkCellArray.h"
#include "vtkImageData.h"
#include "vtkImageProperty.h"
#include "vtkImageSliceMapper.h"
#include "vtkLookupTable.h"
#include "vtkMatrix4x4.h"
#include "vtkObjectFactory.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkPolyDataMapper.h"
#include "vtkProperty.h"
#include "vtkRenderer.h"

vtkStandardNewMacro(vtkBigusSliceProp);

namespace
{

constexpr double kLargestReduction = 8;      // a 512 x 512 slice becomes 64 x 64, the coarsest that shows anything
constexpr double kReductionStep = 0.25;      // so that noise of the clock does not change the pixels of every picture
constexpr double kHalfMaximum = 1.177410;    // sqrt(2 ln 2): where a Gaussian profile has fallen to half, in sigmas
constexpr double kSmallestCoverage = 1e-30;  // a threshold above 0, because a table of no width shows nothing
constexpr int kOverlayShades = 64;           // greys between a coverage of 0 and the threshold

constexpr int kPassOfColours = 1;  // of vtkImageSlice::SetStackedImagePass: without depth

Eigen::Vector3d Column(vtkMatrix4x4* matrix, int column)
{
  return {matrix->GetElement(0, column), matrix->GetElement(1, column), matrix->GetElement(2, column)};
}

void SetColumn(vtkMatrix4x4* matrix, int column, const Eigen::Vector3d& values)
{
  for (int row = 0; row < 3; ++row)
  {
    matrix->SetElement(row, column, values[row]);
  }
}

// A unit vector at right angles to the plane; z where the plane's axes do not span one.
Eigen::Vector3d NormalOf(vtkMatrix4x4* plane)
{
  const Eigen::Vector3d normal = Column(plane, 0).cross(Column(plane, 1));
  const double length = normal.norm();
  return length > 0 && std::isfinite(length) ? Eigen::Vector3d(normal / length) : Eigen::Vector3d::UnitZ();
}

}  // namespace

// What the prop knows of its input, read again when that changes.
struct vtkBigusSliceProp::Known
{
  bigus::Beam beam;
  Eigen::AlignedBox3d box;  // of the centres, padded by the mean scale; empty without Gaussians
  double meanCoverage = 0;
  vtkPolyData* input = nullptr;  // compared, never followed
  vtkMTimeType time = 0;
};

// What is drawn as it stands, so that VTK does not do again what has not changed.
struct vtkBigusSliceProp::Made
{
  std::array<double, 5> shades = {};   // of the overlay: threshold, opacity, colour
  std::array<double, 16> shapes = {};  // corners of the slice, normal, half the slab
};

vtkBigusSliceProp::vtkBigusSliceProp() : FieldKnown(std::make_unique<Known>()), Drawn(std::make_unique<Made>())
{
  vtkNew<vtkMatrix4x4> plane;
  this->SetPlane(plane);
  vtkNew<vtkMatrix4x4> placement;
  this->SetUserMatrix(placement);
  this->Reslice->SetOutputDimensionality(2);

  vtkNew<vtkImageSliceMapper> picture;
  picture->SetInputConnection(this->Reslice->GetOutputPort());
  picture->BorderOn();  // pixels are squares about their places, so the picture reaches the outline
  this->SetMapper(picture);
  this->GetProperty()->SetColorWindow(1);
  this->GetProperty()->SetColorLevel(0.5);

  vtkNew<vtkImageSliceMapper> coverage;
  coverage->SetInputConnection(this->Reslice->GetCoverageOutputPort());
  coverage->BorderOn();
  this->Coverage->SetMapper(coverage);
  this->Coverage->GetProperty()->SetLookupTable(this->CoverageTable);
  this->Coverage->GetProperty()->UseLookupTableScalarRangeOn();
  this->Coverage->SetStackedImagePass(kPassOfColours);

  vtkNew<vtkPolyDataMapper> outline;
  outline->SetInputData(this->OutlineShape);
  this->Outline->SetMapper(outline);
  this->Outline->GetProperty()->LightingOff();
  this->Outline->GetProperty()->SetColor(1, 1, 1);

  vtkNew<vtkPolyDataMapper> beam;
  beam->SetInputData(this->BeamShape);
  this->Beam->SetMapper(beam);
  this->Beam->GetProperty()->LightingOff();
  this->Beam->GetProperty()->SetColor(0.55, 0.8, 1);
  this->Beam->GetProperty()->SetOpacity(0.25);
}

vtkBigusSliceProp::~vtkBigusSliceProp()
{
  this->SetPlane(nullptr);
}

void vtkBigusSliceProp::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Reslice: " << this->Reslice.Get() << "\n";
  os << indent << "Plane: " << this->Plane << "\n";
  os << indent << "SliceSize: " << this->SliceSize[0] << " " << this->SliceSize[1] << "\n";
  os << indent << "SliceSpacing: " << this->SliceSpacing[0] << " " << this->SliceSpacing[1] << "\n";
  os << indent << "SliceOrigin: " << this->SliceOrigin[0] << " " << this->SliceOrigin[1] << "\n";
  os << indent << "CoverageVisibility: " << (this->GetCoverageVisibility() ? "On\n" : "Off\n");
  os << indent << "CoverageThreshold: " << this->CoverageThreshold << "\n";
  os << indent << "CoverageOpacity: " << this->CoverageOpacity << "\n";
  os << indent << "CoverageColor: " << this->CoverageColor[0] << " " << this->CoverageColor[1] << " "
     << this->CoverageColor[2] << "\n";
  os << indent << "OutlineVisibility: " << (this->OutlineVisibility ? "On\n" : "Off\n");
  os << indent << "BeamVisibility: " << (this->BeamVisibility ? "On\n" : "Off\n");
  os << indent << "TimeBudget: " << this->TimeBudget << "\n";
  os << indent << "InteractiveTolerance: " << this->InteractiveTolerance << "\n";
  os << indent << "Reduction: " << this->Reduction << "\n";
  os << indent << "ResliceSeconds: " << this->ResliceSeconds << "\n";
}

//------------------------------------------------------------------------------
// Input and geometry

void vtkBigusSliceProp::SetInputData(vtkPolyData* field)
{
  this->Reslice->SetInputData(field);
  this->Modified();
}

void vtkBigusSliceProp::SetInputConnection(vtkAlgorithmOutput* field)
{
  this->Reslice->SetInputConnection(field);
  this->Modified();
}

bool vtkBigusSliceProp::HasField()
{
  return this->Reslice->GetNumberOfInputConnections(0) > 0;
}

void vtkBigusSliceProp::SetPlane(vtkMatrix4x4* plane)
{
  vtkSetObjectBodyMacro(Plane, vtkMatrix4x4, plane);
  this->Reslice->SetResliceAxes(plane);
}

void vtkBigusSliceProp::SetSliceSize(int width, int height)
{
  if (width < 1 || height < 1)
  {
    vtkErrorMacro(<< "SetSliceSize(" << width << ", " << height << "): columns and rows must each be at least 1.");
    return;
  }
  if (width != this->SliceSize[0] || height != this->SliceSize[1])
  {
    this->SliceSize[0] = width;
    this->SliceSize[1] = height;
    this->Modified();
  }
}

void vtkBigusSliceProp::SetSliceSpacing(double x, double y)
{
  if (!(x > 0 && y > 0 && std::isfinite(x) && std::isfinite(y)))
  {
    vtkErrorMacro(<< "SetSliceSpacing(" << x << ", " << y << "): the distances between pixels must be above 0.");
    return;
  }
  if (x != this->SliceSpacing[0] || y != this->SliceSpacing[1])
  {
    this->SliceSpacing[0] = x;
    this->SliceSpacing[1] = y;
    this->Modified();
  }
}

void vtkBigusSliceProp::SetSliceOrigin(double x, double y)
{
  if (x != this->SliceOrigin[0] || y != this->SliceOrigin[1])
  {
    this->SliceOrigin[0] = x;
    this->SliceOrigin[1] = y;
    this->Modified();
  }
}

void vtkBigusSliceProp::SetPlaneToFrame(vtkMatrix4x4* imageToReference, int width, int height)
{
  this->SetPlane(imageToReference);
  this->SetSliceSize(width, height);
  this->SetSliceSpacing(1, 1);
  this->SetSliceOrigin(0, 0);
}

void vtkBigusSliceProp::PlaceInField(int normalAxis, int pixels)
{
  if (normalAxis < 0 || normalAxis > 2 || pixels < 2)
  {
    vtkErrorMacro(<< "PlaceInField(" << normalAxis << ", " << pixels
                  << "): the axis must be 0, 1 or 2, and the pixels at least 2.");
    return;
  }
  double bounds[6];
  if (!this->GetFieldBox(bounds))
  {
    return;
  }
  const Eigen::AlignedBox3d& box = this->FieldKnown->box;
  const int columnAxis = normalAxis == 0 ? 1 : 0, rowAxis = normalAxis == 2 ? 1 : 2;
  const double width = box.sizes()[columnAxis], height = box.sizes()[rowAxis];
  const double spacing = std::max(width, height) / pixels;
  this->Plane->Identity();
  SetColumn(this->Plane, 0, Eigen::Vector3d::Unit(columnAxis));
  SetColumn(this->Plane, 1, Eigen::Vector3d::Unit(rowAxis));
  SetColumn(this->Plane, 2, Eigen::Vector3d::Unit(columnAxis).cross(Eigen::Vector3d::Unit(rowAxis)));
  SetColumn(this->Plane, 3, box.center());
  const int columns = std::max(1, static_cast<int>(std::ceil(width / spacing - 1e-9)));
  const int rows = std::max(1, static_cast<int>(std::ceil(height / spacing - 1e-9)));
  this->SetSliceSize(columns, rows);
  this->SetSliceSpacing(spacing, spacing);
  this->SetSliceOrigin(-0.5 * (columns - 1) * spacing, -0.5 * (rows - 1) * spacing);
}

const vtkBigusSliceProp::Known& vtkBigusSliceProp::KnownOfField()
{
  Known& known = *this->FieldKnown;
  vtkPolyData* input = nullptr;
  if (this->HasField())
  {
    this->Reslice->GetInputAlgorithm(0, 0)->Update(this->Reslice->GetInputConnection(0, 0)->GetIndex());
    input = vtkPolyData::SafeDownCast(this->Reslice->GetInputDataObject(0, 0));
  }
  if (input && known.input == input && known.time == input->GetMTime())
  {
    return known;
  }
  known = Known();
  if (!input)
  {
    return known;
  }
  try
  {
    const bigus::GaussianField field = bigus::FieldFromPolyData(input);
    const bigus::FieldSpread spread = bigus::SpreadOf(field);
    known.beam = field.beam;
    known.box = spread.Box();
    known.meanCoverage = spread.MeanCoverage();
  }
  catch (const bigus::Error& error)
  {
    vtkErrorMacro(<< error.what());
  }
  known.input = input;
  known.time = input->GetMTime();
  return known;
}

bool vtkBigusSliceProp::GetFieldBox(double box[6])
{
  const Known& known = this->KnownOfField();
  for (int axis = 0; axis < 3; ++axis)
  {
    box[2 * axis] = known.box.min()[axis];
    box[2 * axis + 1] = known.box.max()[axis];
  }
  return !known.box.isEmpty();
}

double vtkBigusSliceProp::GetBeamSigma()
{
  const double given = this->Reslice->GetElevationSigma();
  return given >= 0 ? given : std::sqrt(this->KnownOfField().beam.Variance(NormalOf(this->Plane)));
}

//------------------------------------------------------------------------------
// The slice

double vtkBigusSliceProp::NextReduction() const
{
  // The time grows with the number of pixels, so with 1 / Reduction^2.
  const double wanted = this->Reduction * std::sqrt(this->ResliceSeconds / this->TimeBudget);
  const double step = std::ceil(wanted / kReductionStep) * kReductionStep;
  // Pixels become larger at once and smaller only when they fit with room to spare, because changes of size can be seen.
  const bool change = step > this->Reduction || wanted < this->Reduction - 1.5 * kReductionStep;
  return change ? std::clamp(step, 1.0, kLargestReduction) : this->Reduction;
}

void vtkBigusSliceProp::SetResliceGeometry()
{
  double spacing[2], origin[2];
  int last[2];
  for (int axis = 0; axis < 2; ++axis)
  {
    // Fewer pixels fill the same rectangle.
    const int size = std::max(1, static_cast<int>(std::round(this->SliceSize[axis] / this->Reduction)));
    const double larger = static_cast<double>(this->SliceSize[axis]) / size;
    last[axis] = size - 1;
    spacing[axis] = this->SliceSpacing[axis] * larger;
    origin[axis] = this->SliceOrigin[axis] + 0.5 * (larger - 1) * this->SliceSpacing[axis];
  }
  this->Reslice->SetOutputSpacing(spacing[0], spacing[1], 1);
  this->Reslice->SetOutputOrigin(origin[0], origin[1], 0);
  this->Reslice->SetOutputExtent(0, last[0], 0, last[1], 0, 0);

  const bool coarse = this->TimeBudget > 0;
  if (coarse && this->ExactTolerance < 0)
  {
    this->ExactTolerance = this->Reslice->GetTolerance();
    this->Reslice->SetTolerance(std::max(this->ExactTolerance, this->InteractiveTolerance));
  }
  else if (!coarse && this->ExactTolerance >= 0)
  {
    this->Reslice->SetTolerance(this->ExactTolerance);
    this->ExactTolerance = -1;
  }
}

void vtkBigusSliceProp::UpdateOverlay()
{
  this->Reslice->SetGenerateCoverageOutput(this->GetCoverageVisibility());
  if (!this->GetCoverageVisibility())
  {
    return;
  }
  const double limit = std::max(this->CoverageThreshold * this->KnownOfField().meanCoverage, kSmallestCoverage);
  vtkLookupTable* table = this->CoverageTable;
  const std::array<double, 5> shades = {limit, this->CoverageOpacity, this->CoverageColor[0], this->CoverageColor[1],
                                        this->CoverageColor[2]};
  if (shades == this->Drawn->shades)
  {
    return;  // a table that is touched makes VTK colour the whole picture anew
  }
  this->Drawn->shades = shades;
  table->SetNumberOfTableValues(kOverlayShades);
  table->SetTableRange(0, limit);
  for (int i = 0; i < kOverlayShades; ++i)
  {
    const double share = 1 - (i + 0.5) / kOverlayShades;
    table->SetTableValue(i, this->CoverageColor[0], this->CoverageColor[1], this->CoverageColor[2],
                         this->CoverageOpacity * share);
  }
  table->SetAboveRangeColor(this->CoverageColor[0], this->CoverageColor[1], this->CoverageColor[2], 0);
  table->UseAboveRangeColorOn();
}

void vtkBigusSliceProp::UpdateSlice()
{
  if (!this->HasField())
  {
    return;
  }
  this->UpdateShapes();
  this->UpdateOverlay();
  if (this->TimeBudget <= 0)
  {
    this->Reduction = 1;
  }
  else if (this->Reslice->GetMTime() > this->SliceTime)
  {
    this->Reduction = this->NextReduction();
  }
  this->SetResliceGeometry();
  const vtkMTimeType before = this->Reslice->GetOutput()->GetUpdateTime();
  const auto start = std::chrono::steady_clock::now();
  this->Reslice->Update();
  if (this->Reslice->GetOutput()->GetUpdateTime() != before)  // else it was up to date
  {
    this->ResliceSeconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    this->SliceTime.Modified();
  }
}

//------------------------------------------------------------------------------
// Drawing

void vtkBigusSliceProp::UpdateShapes()
{
  // What VTK draws is inverted, so the matrix that places it needs a third column, which that of a plane may lack.
  vtkMatrix4x4* placement = this->GetUserMatrix();
  const Eigen::Vector3d normal = NormalOf(this->Plane);
  vtkNew<vtkMatrix4x4> wanted;
  wanted->DeepCopy(this->Plane);
  SetColumn(wanted, 2, normal);
  if (!std::equal(wanted->GetData(), wanted->GetData() + 16, placement->GetData()))
  {
    placement->DeepCopy(wanted);
  }

  // The border of the slice's pixels, and the same on either side of the beam. Doubles without gaps.
  static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
  Eigen::Vector3d corners[4];
  for (int corner = 0; corner < 4; ++corner)
  {
    const bool last[2] = {corner == 1 || corner == 2, corner >= 2};
    corners[corner] = Column(this->Plane, 3);
    for (int axis = 0; axis < 2; ++axis)
    {
      const double index = last[axis] ? this->SliceSize[axis] - 0.5 : -0.5;
      corners[corner] += (this->SliceOrigin[axis] + index * this->SliceSpacing[axis]) * Column(this->Plane, axis);
    }
  }
  const double half = this->BeamVisibility ? kHalfMaximum * this->GetBeamSigma() : 0;
  std::array<double, 16> shapes;
  std::copy_n(corners[0].data(), 12, shapes.begin());
  std::copy_n(normal.data(), 3, shapes.begin() + 12);
  shapes[15] = half;
  if (shapes == this->Drawn->shapes)
  {
    return;
  }
  this->Drawn->shapes = shapes;
  vtkNew<vtkPoints> border;
  border->SetDataTypeToDouble();
  vtkNew<vtkPoints> box;
  box->SetDataTypeToDouble();
  for (const Eigen::Vector3d& corner : corners)
  {
    border->InsertNextPoint(corner.data());
  }
  for (const double side : {-half, half})
  {
    for (const Eigen::Vector3d& corner : corners)
    {
      box->InsertNextPoint(Eigen::Vector3d(corner + side * normal).data());
    }
  }
  vtkNew<vtkCellArray> line;
  line->InsertNextCell({0, 1, 2, 3, 0});
  this->OutlineShape->SetPoints(border);
  this->OutlineShape->SetLines(line);
  vtkNew<vtkCellArray> faces;
  for (const auto& face : {std::initializer_list<vtkIdType>{0, 1, 2, 3},
                           {7, 6, 5, 4},
                           {0, 4, 5, 1},
                           {1, 5, 6, 2},
                           {2, 6, 7, 3},
                           {3, 7, 4, 0}})
  {
    faces->InsertNextCell(face);
  }
  this->BeamShape->SetPoints(box);
  this->BeamShape->SetPolys(faces);
}

double* vtkBigusSliceProp::GetBounds()
{
  if (!this->HasField())
  {
    return nullptr;
  }
  this->UpdateShapes();
  (this->BeamVisibility ? this->BeamShape : this->OutlineShape)->GetBounds(this->Bounds);
  return this->Bounds;
}

int vtkBigusSliceProp::RenderLayers(vtkViewport* viewport)
{
  vtkRenderer* renderer = vtkRenderer::SafeDownCast(viewport);
  if (!renderer)
  {
    return 0;
  }
  this->Render(renderer);
  if (this->GetCoverageVisibility())
  {
    // It is the same rectangle as the picture, whose depth serves for both.
    this->Coverage->PokeMatrix(this->GetMatrix());
    this->Coverage->Render(renderer);
    this->Coverage->PokeMatrix(nullptr);
  }
  return 1;
}

int vtkBigusSliceProp::RenderOpaqueGeometry(vtkViewport* viewport)
{
  this->UpdateSlice();
  if (this->Reslice->GetOutput()->GetNumberOfPoints() == 0)
  {
    return 0;
  }
  int drawn = this->ForceTranslucent ? 0 : this->RenderLayers(viewport);
  if (this->OutlineVisibility)
  {
    drawn += this->Outline->RenderOpaqueGeometry(viewport);
  }
  return drawn;
}

vtkTypeBool vtkBigusSliceProp::HasTranslucentPolygonalGeometry()
{
  return (this->BeamVisibility && this->HasField()) || this->Superclass::HasTranslucentPolygonalGeometry();
}

int vtkBigusSliceProp::RenderTranslucentPolygonalGeometry(vtkViewport* viewport)
{
  if (this->Reslice->GetOutput()->GetNumberOfPoints() == 0)
  {
    return 0;
  }
  int drawn = this->ForceTranslucent ? this->RenderLayers(viewport) : 0;
  if (this->BeamVisibility && this->GetBeamSigma() > 0)  // a plane has no slab
  {
    this->Beam->SetPropertyKeys(this->GetPropertyKeys());  // the renderer's pass, which the slab's shader must follow
    drawn += this->Beam->RenderTranslucentPolygonalGeometry(viewport);
  }
  return drawn;
}

void vtkBigusSliceProp::ReleaseGraphicsResources(vtkWindow* window)
{
  this->Superclass::ReleaseGraphicsResources(window);
  this->Coverage->ReleaseGraphicsResources(window);
  this->Outline->ReleaseGraphicsResources(window);
  this->Beam->ReleaseGraphicsResources(window);
}

vtkMTimeType vtkBigusSliceProp::GetMTime()
{
  return std::max({this->Superclass::GetMTime(), this->Reslice->GetMTime(), this->Coverage->GetMTime(),
                   this->Outline->GetMTime(), this->Beam->GetMTime()});
}

void vtkBigusSliceProp::SetCoverageVisibility(vtkTypeBool visible)
{
  this->Coverage->SetVisibility(visible);
}

vtkTypeBool vtkBigusSliceProp::GetCoverageVisibility()
{
  return this->Coverage->GetVisibility();
}

vtkProperty* vtkBigusSliceProp::GetOutlineProperty()
{
  return this->Outline->GetProperty();
}

vtkProperty* vtkBigusSliceProp::GetBeamProperty()
{
  return this->Beam->GetProperty();
}
