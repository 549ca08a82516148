// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldMapper.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "Core/Model/GaussianField.h"
#include "Core/Numerics/Statistics.h"
#include "Data/Arrays.h"
#include "Data/FieldData.h"
#include "vtkActor.h"
#include "vtkBoundingBox.h"
#include "vtkCamera.h"
#include "vtkCellArray.h"
#include "vtkColorTransferFunction.h"
#include "vtkExecutive.h"
#include "vtkFloatArray.h"
#include "vtkGlyph3DMapper.h"
#include "vtkInformation.h"
#include "vtkLookupTable.h"
#include "vtkMath.h"
#include "vtkMatrix4x4.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkPolyDataMapper.h"
#include "vtkRenderWindow.h"
#include "vtkRenderer.h"
#include "vtkSphereSource.h"

vtkStandardNewMacro(vtkBigusFieldMapper);

namespace
{

constexpr double kRangeQuantile = 0.95;  // of |r|: a few Gaussians far above the rest would make all others faint
constexpr int kTableSize = 257;          // odd, so that zero has an entry of its own
constexpr vtkIdType kSmallestLevel = 256;
constexpr double kShareOfTime = 0.7;  // of the actor's time, because the window clears, copies and swaps as well
// Seconds a triangle before any was measured: that of Mesa's llvmpipe on two cores. A graphics card is found to be
// faster by the second picture.
constexpr double kFirstSecondsPerTriangle = 5e-7;
constexpr double kFirstSecondsPerPoint = 5e-7;
constexpr double kShareOfPoints = 0.5;  // of the time of a hurried picture: its ellipsoids have the other half

/// A sphere of radius 1, and the pixels of one standard deviation up to which it looks round.
struct Shape
{
  int theta, phi;
  double pixels;
};
constexpr std::array<Shape, 3> kShapes = {
    {{6, 5, 4.0}, {12, 9, 16.0}, {24, 17, std::numeric_limits<double>::infinity()}}};

/// The strongest so many Gaussians, and what draws them.
struct Level
{
  vtkIdType size = 0;
  vtkNew<vtkPolyData> gaussians;
  vtkNew<vtkGlyph3DMapper> mapper;
  int shape = -1;      ///< of the mapper's source
  bool drawn = false;  ///< with this shape: the time of a first picture counts its upload, too
};

/// The strongest so many Gaussians as points.
struct PointLevel
{
  vtkIdType size = 0;
  vtkNew<vtkPolyDataMapper> mapper;
  bool drawn = false;  ///< the time of a first picture counts its upload, too
};

/// Levels of `most`, of half as many and so on.
template <typename T>
void FillLevels(vtkIdType most, std::vector<std::unique_ptr<T>>& levels)
{
  if (!levels.empty() && levels.front()->size == most)
  {
    return;
  }
  levels.clear();
  for (vtkIdType size = most; size > 0 && (size == most || size >= kSmallestLevel); size /= 2)
  {
    levels.push_back(std::make_unique<T>());
    levels.back()->size = size;
  }
}

/// The largest level that is drawn in `seconds`, with `each` for a Gaussian; the smallest if none is.
template <typename T>
T& ChooseLevel(const std::vector<std::unique_ptr<T>>& levels, double each, double seconds)
{
  const auto fits = [&](const auto& level) { return static_cast<double>(level->size) * each <= seconds; };
  const auto found = std::find_if(levels.begin(), levels.end(), fits);
  return found == levels.end() ? *levels.back() : **found;
}

/// Gaussians of the field from the strongest on, as single-precision arrays.
void FillSorted(const bigus::GaussianField& field, vtkPolyData* sorted)
{
  const std::size_t n = field.Size();
  std::vector<double> strength(n);
  for (std::size_t i = 0; i < n; ++i)
  {
    strength[i] = std::abs(field.reflectivities[i]) * std::pow(field.scales[i].prod(), 2.0 / 3);
  }
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return strength[a] > strength[b]; });

  const vtkIdType count = static_cast<vtkIdType>(n);
  vtkNew<vtkPoints> points;
  points->SetDataTypeToFloat();
  points->SetNumberOfPoints(count);
  const auto scales = bigus::NewArray<vtkFloatArray>("Scale", 3, count);
  const auto rotations = bigus::NewArray<vtkFloatArray>("Rotation", 4, count);
  const auto reflectivities = bigus::NewArray<vtkFloatArray>("Reflectivity", 1, count);
  for (vtkIdType k = 0; k < count; ++k)
  {
    const std::size_t i = order[k];
    points->SetPoint(k, field.means[i].data());
    scales->SetTuple(k, field.scales[i].data());
    rotations->SetTuple(k, field.rotations[i].normalized().eval().data());
    reflectivities->SetValue(k, static_cast<float>(field.reflectivities[i]));
  }
  sorted->Initialize();
  sorted->SetPoints(points);
  sorted->GetPointData()->AddArray(scales);
  sorted->GetPointData()->AddArray(rotations);
  sorted->GetPointData()->SetScalars(reflectivities);
}

/// The first `size` points of `sorted`, which it shares when that is all of them.
void TakeFirst(vtkPolyData* sorted, vtkIdType size, vtkPolyData* first)
{
  if (size == sorted->GetNumberOfPoints())
  {
    first->ShallowCopy(sorted);
    return;
  }
  vtkNew<vtkPoints> points;
  points->SetDataTypeToFloat();
  points->SetNumberOfPoints(size);
  points->GetData()->InsertTuples(0, size, 0, sorted->GetPoints()->GetData());
  first->SetPoints(points);
  first->GetPointData()->CopyAllOn();
  first->GetPointData()->CopyAllocate(sorted->GetPointData(), size);
  first->GetPointData()->CopyData(sorted->GetPointData(), 0, size, 0);
}

/// Renders; seconds until the pixels are there.
double SecondsOf(vtkMapper* mapper, vtkRenderer* renderer, vtkActor* actor)
{
  vtkRenderWindow* window = renderer->GetRenderWindow();
  window->WaitForCompletion();
  const auto start = std::chrono::steady_clock::now();
  mapper->Render(renderer, actor);
  window->WaitForCompletion();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

struct vtkBigusFieldMapper::Drawing
{
  vtkMTimeType readTime = 0;  ///< of the input
  bool valid = false;
  double quantile = 0;     ///< of |r|
  double medianScale = 0;  ///< mm
  vtkNew<vtkPolyData> sorted;
  std::vector<std::unique_ptr<Level>> levels;  ///< each half of the one before
  std::vector<std::unique_ptr<PointLevel>> pointLevels;
  std::array<vtkNew<vtkSphereSource>, kShapes.size()> shapes;
  vtkSmartPointer<vtkLookupTable> table;  ///< the default one
  double tableRange = -1;
  bool tableIsTranslucent = false;
  double boundsFactor = -1;  ///< ScaleFactor of the bounds that were found last
  double secondsPerTriangle = kFirstSecondsPerTriangle;
  double secondsPerPoint = kFirstSecondsPerPoint;

  void Read(vtkPolyData* input);
};

/// Throws bigus::Error.
void vtkBigusFieldMapper::Drawing::Read(vtkPolyData* input)
{
  const bigus::GaussianField field = bigus::FieldFromPolyData(input);
  FillSorted(field, this->sorted);
  std::vector<double> strengths, scales;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    strengths.push_back(std::abs(field.reflectivities[i]));
    scales.push_back(std::cbrt(field.scales[i].prod()));
  }
  this->quantile = bigus::OrderStatistic(std::move(strengths), kRangeQuantile);
  this->medianScale = bigus::OrderStatistic(std::move(scales), 0.5);

  this->levels.clear();
  this->pointLevels.clear();
  this->boundsFactor = -1;
}

vtkBigusFieldMapper::vtkBigusFieldMapper() : MaximumNumberOfEllipsoids(VTK_ID_MAX), Drawn(std::make_unique<Drawing>())
{
  for (std::size_t k = 0; k < kShapes.size(); ++k)
  {
    this->Drawn->shapes[k]->SetRadius(1);
    this->Drawn->shapes[k]->SetThetaResolution(kShapes[k].theta);
    this->Drawn->shapes[k]->SetPhiResolution(kShapes[k].phi);
  }
  this->UseLookupTableScalarRange = 1;
}

vtkBigusFieldMapper::~vtkBigusFieldMapper() = default;

void vtkBigusFieldMapper::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "ScaleFactor: " << this->ScaleFactor << "\n";
  os << indent << "ReflectivityRange: " << this->ReflectivityRange << "\n";
  os << indent << "OpacityByReflectivity: " << this->OpacityByReflectivity << "\n";
  os << indent << "LevelOfDetail: " << this->LevelOfDetail << "\n";
  os << indent << "MaximumNumberOfEllipsoids: " << this->MaximumNumberOfEllipsoids << "\n";
  os << indent << "PointsBelow: " << this->PointsBelow << "\n";
  os << indent << "NumberOfEllipsoidsDrawn: " << this->NumberOfEllipsoidsDrawn << "\n";
  os << indent << "NumberOfPointsDrawn: " << this->NumberOfPointsDrawn << "\n";
}

void vtkBigusFieldMapper::SetInputData(vtkPolyData* field)
{
  this->SetInputDataInternal(0, field);
}

vtkPolyData* vtkBigusFieldMapper::GetInput()
{
  return this->GetNumberOfInputConnections(0) > 0 ? vtkPolyData::SafeDownCast(this->GetExecutive()->GetInputData(0, 0))
                                                  : nullptr;
}

int vtkBigusFieldMapper::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkPolyData");
  return 1;
}

/// Brings the input up to date and reads it when it changed. False without a valid field.
bool vtkBigusFieldMapper::UpdateField()
{
  if (this->GetNumberOfInputConnections(0) == 0)
  {
    return false;
  }
  if (!this->Static)
  {
    this->GetInputAlgorithm()->Update();
  }
  vtkPolyData* input = this->GetInput();
  if (!input)
  {
    return false;
  }
  if (input->GetMTime() != this->Drawn->readTime)
  {
    this->Drawn->readTime = input->GetMTime();
    this->Drawn->valid = false;
    try
    {
      this->Drawn->Read(input);
      this->Drawn->valid = true;
    }
    catch (const std::exception& error)
    {
      vtkErrorMacro(<< error.what());
    }
  }
  return this->Drawn->valid;
}

double vtkBigusFieldMapper::GetReflectivityRangeInUse()
{
  if (this->ReflectivityRange > 0 || !this->UpdateField())
  {
    return this->ReflectivityRange;
  }
  return this->Drawn->quantile > 0 ? this->Drawn->quantile : 1;
}

void vtkBigusFieldMapper::CreateDefaultLookupTable()
{
  this->Drawn->table = vtkSmartPointer<vtkLookupTable>::New();
  this->Drawn->tableRange = -1;
  this->SetLookupTable(this->Drawn->table);
  this->UpdateTable();
}

/// The default table follows the range and whether opacity tells |r|.
void vtkBigusFieldMapper::UpdateTable()
{
  if (!this->LookupTable)
  {
    this->CreateDefaultLookupTable();
    return;
  }
  const double range = this->GetReflectivityRangeInUse();
  const bool translucent = this->OpacityByReflectivity != 0;
  Drawing& drawn = *this->Drawn;
  if (this->LookupTable != drawn.table.Get() || range <= 0 ||
      (range == drawn.tableRange && translucent == drawn.tableIsTranslucent))
  {
    return;
  }
  drawn.tableRange = range;
  drawn.tableIsTranslucent = translucent;
  vtkNew<vtkColorTransferFunction> colors;
  colors->SetColorSpaceToLab();
  colors->AddRGBPoint(-1, 0.10, 0.36, 0.95);
  colors->AddRGBPoint(0, 0.88, 0.88, 0.88);
  colors->AddRGBPoint(1, 0.98, 0.50, 0.08);
  drawn.table->SetNumberOfTableValues(kTableSize);
  drawn.table->SetTableRange(-range, range);
  for (int k = 0; k < kTableSize; ++k)
  {
    const double share = 2.0 * k / (kTableSize - 1) - 1;  // -1 to 1
    double color[3];
    colors->GetColor(share, color);
    drawn.table->SetTableValue(k, color[0], color[1], color[2], translucent ? std::abs(share) : 1);
  }
}

double* vtkBigusFieldMapper::GetBounds()
{
  if (!this->UpdateField())
  {
    vtkMath::UninitializeBounds(this->Bounds);
  }
  else if (this->Drawn->boundsFactor != this->ScaleFactor)
  {
    this->Drawn->boundsFactor = this->ScaleFactor;
    vtkPolyData* sorted = this->Drawn->sorted;
    vtkDataArray* scales = sorted->GetPointData()->GetArray("Scale");
    vtkDataArray* rotations = sorted->GetPointData()->GetArray("Rotation");
    vtkBoundingBox box;
    for (vtkIdType k = 0; k < sorted->GetNumberOfPoints(); ++k)
    {
      Eigen::Vector3d x, scale;
      Eigen::Vector4d rotation;
      sorted->GetPoint(k, x.data());
      scales->GetTuple(k, scale.data());
      rotations->GetTuple(k, rotation.data());
      // The farthest point of {R diag(s) u, |u| = 1} along an axis is the norm of that row of R diag(s).
      const Eigen::Vector3d reach =
          this->ScaleFactor * (bigus::RotationMatrix(rotation) * scale.asDiagonal()).rowwise().norm();
      for (const double side : {-1.0, 1.0})
      {
        Eigen::Vector3d corner = x + side * reach;
        box.AddPoint(corner.data());
      }
    }
    vtkMath::UninitializeBounds(this->Bounds);
    if (box.IsValid())
    {
      box.GetBounds(this->Bounds);
    }
  }
  return this->Bounds;
}

bool vtkBigusFieldMapper::HasTranslucentPolygonalGeometry()
{
  this->UpdateTable();
  return this->LookupTable && !this->LookupTable->IsOpaque();
}

bool vtkBigusFieldMapper::HasOpaqueGeometry()
{
  return !this->HasTranslucentPolygonalGeometry();
}

/// Pixels of ScaleFactor standard deviations of the median Gaussian, at the middle of the field.
double vtkBigusFieldMapper::PixelsPerSigma(vtkRenderer* renderer, vtkActor* actor) const
{
  vtkCamera* camera = renderer->GetActiveCamera();
  const double* centre = actor->GetCenter();
  const double height = camera->GetParallelProjection()
                            ? 2 * camera->GetParallelScale()
                            : 2 * std::sqrt(vtkMath::Distance2BetweenPoints(centre, camera->GetPosition())) *
                                  std::tan(vtkMath::RadiansFromDegrees(0.5 * camera->GetViewAngle()));
  const double scale = std::cbrt(std::abs(actor->GetMatrix()->Determinant()));
  const double sigma = this->ScaleFactor * this->Drawn->medianScale * scale;
  return height > 0 ? sigma * renderer->GetSize()[1] / height : std::numeric_limits<double>::infinity();
}

/// The `most` strongest, or as many as fit into the time beside points.
void vtkBigusFieldMapper::DrawEllipsoids(vtkRenderer* renderer, vtkActor* actor, double pixels, vtkIdType most,
                                         double seconds)
{
  Drawing& drawn = *this->Drawn;
  int shape = 0;
  while (pixels > kShapes[shape].pixels)
  {
    ++shape;
  }
  drawn.shapes[shape]->Update();
  const vtkIdType triangles = drawn.shapes[shape]->GetOutput()->GetNumberOfPolys();
  FillLevels(most, drawn.levels);
  const double each = static_cast<double>(triangles) * drawn.secondsPerTriangle;
  const bool all = static_cast<double>(most) * each <= seconds;
  Level& level = ChooseLevel(drawn.levels, each, all ? seconds : (1 - kShareOfPoints) * seconds);

  if (level.gaussians->GetNumberOfPoints() == 0)
  {
    TakeFirst(drawn.sorted, level.size, level.gaussians);
    level.mapper->SetInputData(level.gaussians);
    level.mapper->SetScaleArray("Scale");
    level.mapper->SetScaleModeToScaleByVectorComponents();
    level.mapper->SetOrientationArray("Rotation");
    level.mapper->SetOrientationModeToQuaternion();
    level.mapper->UseLookupTableScalarRangeOn();
  }
  if (level.shape != shape)
  {
    level.shape = shape;
    level.drawn = false;
    level.mapper->SetSourceConnection(drawn.shapes[shape]->GetOutputPort());
  }
  level.mapper->SetScaleFactor(this->ScaleFactor);
  level.mapper->SetLookupTable(this->LookupTable);
  level.mapper->SetClippingPlanes(this->ClippingPlanes);

  const double took = SecondsOf(level.mapper, renderer, actor) / (static_cast<double>(level.size) * triangles);
  if (level.drawn)
  {
    drawn.secondsPerTriangle = 0.5 * (drawn.secondsPerTriangle + took);
  }
  level.drawn = true;
  this->NumberOfEllipsoidsDrawn = level.size;
}

/// The strongest, as many as fit into the time.
void vtkBigusFieldMapper::DrawPoints(vtkRenderer* renderer, vtkActor* actor, double seconds)
{
  Drawing& drawn = *this->Drawn;
  FillLevels(drawn.sorted->GetNumberOfPoints(), drawn.pointLevels);
  PointLevel& level = ChooseLevel(drawn.pointLevels, drawn.secondsPerPoint, seconds);
  if (!level.mapper->GetInput())
  {
    vtkNew<vtkCellArray> vertices;
    vertices->AllocateExact(level.size, level.size);
    for (vtkIdType k = 0; k < level.size; ++k)
    {
      vertices->InsertNextCell(1, &k);
    }
    vtkNew<vtkPolyData> cloud;
    cloud->SetPoints(drawn.sorted->GetPoints());
    cloud->GetPointData()->SetScalars(drawn.sorted->GetPointData()->GetScalars());
    cloud->SetVerts(vertices);
    level.mapper->SetInputData(cloud);
    level.mapper->UseLookupTableScalarRangeOn();
  }
  level.mapper->SetLookupTable(this->LookupTable);
  level.mapper->SetClippingPlanes(this->ClippingPlanes);
  const double took = SecondsOf(level.mapper, renderer, actor) / static_cast<double>(level.size);
  if (level.drawn)
  {
    drawn.secondsPerPoint = 0.5 * (drawn.secondsPerPoint + took);
  }
  level.drawn = true;
  this->NumberOfPointsDrawn = level.size;
}

void vtkBigusFieldMapper::Render(vtkRenderer* renderer, vtkActor* actor)
{
  this->NumberOfEllipsoidsDrawn = this->NumberOfPointsDrawn = 0;
  if (!this->UpdateField() || this->Drawn->sorted->GetNumberOfPoints() == 0)
  {
    return;
  }
  this->UpdateTable();
  const double pixels = this->PixelsPerSigma(renderer, actor);
  const vtkIdType count = this->Drawn->sorted->GetNumberOfPoints();
  const vtkIdType wanted = std::min(count, this->MaximumNumberOfEllipsoids);
  const double seconds = this->LevelOfDetail ? kShareOfTime * actor->GetAllocatedRenderTime() : VTK_DOUBLE_MAX;
  const bool far = pixels < this->PointsBelow;
  if (!far)
  {
    this->DrawEllipsoids(renderer, actor, pixels, wanted, seconds);
  }
  if (this->NumberOfEllipsoidsDrawn < wanted)
  {
    this->DrawPoints(renderer, actor, far ? seconds : kShareOfPoints * seconds);
  }
}

void vtkBigusFieldMapper::ReleaseGraphicsResources(vtkWindow* window)
{
  for (const auto& level : this->Drawn->levels)
  {
    level->mapper->ReleaseGraphicsResources(window);
    level->drawn = false;
  }
  for (const auto& level : this->Drawn->pointLevels)
  {
    level->mapper->ReleaseGraphicsResources(window);
    level->drawn = false;
  }
  this->Superclass::ReleaseGraphicsResources(window);
}
