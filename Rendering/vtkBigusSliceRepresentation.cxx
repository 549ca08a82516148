// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusSliceRepresentation.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "Core/Numerics/Constants.h"
#include "vtkActor.h"
#include "vtkBigusReslice.h"
#include "vtkBigusSliceProp.h"
#include "vtkCamera.h"
#include "vtkConeSource.h"
#include "vtkImageProperty.h"
#include "vtkInteractorObserver.h"
#include "vtkLineSource.h"
#include "vtkMatrix4x4.h"
#include "vtkObjectFactory.h"
#include "vtkPolyDataMapper.h"
#include "vtkPropCollection.h"
#include "vtkProperty.h"
#include "vtkRenderer.h"
#include "vtkSphereSource.h"

vtkStandardNewMacro(vtkBigusSliceRepresentation);

namespace
{

constexpr double kArrow = 0.3;       // length of the normal's arrow as a share of the slice's shorter side
constexpr double kHandlePixels = 5;  // radius of the ball
constexpr double kAim = 0.8;         // of a picture's time that is planned with, because some take longer than most
constexpr double kLeastShare = 0.2;  // of a picture's time, for the slice; with less it is coarser and hardly faster
constexpr double kRise = 0.5;        // weight of a picture that took longer than those before, all but the slice
constexpr double kFall = 0.1;        // and of one that took less, so that the estimate stays above the mean
constexpr double kFacing = 0.95;     // cosine from which a plane counts as seen from its front (18 degrees)
constexpr double kSmallestWindow = 1e-3;  // of the picture's intensities, where the contrast would turn over
constexpr int kPlacedPixels = 512;

using RowMajorMatrix = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
using Eigen::Vector3d;

Eigen::Matrix4d ToEigen(vtkMatrix4x4* matrix)
{
  return Eigen::Map<const RowMajorMatrix>(matrix->GetData());
}

void Store(const Eigen::Matrix4d& matrix, vtkMatrix4x4* to)
{
  const RowMajorMatrix rows = matrix;
  to->DeepCopy(rows.data());
}

Vector3d ToWorld(vtkRenderer* renderer, double x, double y, double depth)
{
  double world[4];
  vtkInteractorObserver::ComputeDisplayToWorld(renderer, x, y, depth, world);
  return {world[0], world[1], world[2]};
}

Vector3d ToDisplay(vtkRenderer* renderer, const Vector3d& world)
{
  double display[3];
  vtkInteractorObserver::ComputeWorldToDisplay(renderer, world[0], world[1], world[2], display);
  return {display[0], display[1], display[2]};
}

// Of a point from the piece of a line between two others, in the window's plane.
double DistanceToSegment(const Eigen::Vector2d& point, const Eigen::Vector2d& from, const Eigen::Vector2d& to)
{
  const Eigen::Vector2d along = to - from;
  const double share = along.squaredNorm() > 0 ? (point - from).dot(along) / along.squaredNorm() : 0;
  return (point - from - std::clamp(share, 0.0, 1.0) * along).norm();
}

}  // namespace

// The slice's rectangle, mm.
struct vtkBigusSliceRepresentation::Geometry
{
  Vector3d centre, normal;
  Vector3d halfColumns, halfRows;  // from the middle to the border

  double Arrow() const { return 2 * kArrow * std::min(halfColumns.norm(), halfRows.norm()); }

  // Where a ray meets the plane, in shares of the half sides (-1 to 1 inside); false when it does not.
  bool Meet(const Vector3d& from, const Vector3d& to, Vector3d& point, double& columns, double& rows) const
  {
    const double slope = (to - from).dot(normal);
    if (!(std::abs(slope) > 1e-9 * (to - from).norm()))
    {
      return false;
    }
    point = from + (centre - from).dot(normal) / slope * (to - from);
    Eigen::Matrix<double, 3, 2> sides;
    sides << halfColumns, halfRows;
    const Eigen::Vector2d shares = sides.colPivHouseholderQr().solve(point - centre);
    columns = shares[0];
    rows = shares[1];
    return true;
  }
};

vtkBigusSliceRepresentation::Geometry vtkBigusSliceRepresentation::GeometryOfSlice()
{
  const Eigen::Matrix4d plane = ToEigen(this->SliceProp->GetPlane());
  const int* size = this->SliceProp->GetSliceSize();
  const double* spacing = this->SliceProp->GetSliceSpacing();
  const double* origin = this->SliceProp->GetSliceOrigin();
  Geometry geometry;
  geometry.centre = plane.col(3).head<3>();
  Vector3d* const halves[2] = {&geometry.halfColumns, &geometry.halfRows};
  for (int axis = 0; axis < 2; ++axis)
  {
    geometry.centre += (origin[axis] + 0.5 * (size[axis] - 1) * spacing[axis]) * plane.col(axis).head<3>();
    *halves[axis] = 0.5 * size[axis] * spacing[axis] * plane.col(axis).head<3>();
  }
  geometry.normal = geometry.halfColumns.cross(geometry.halfRows).normalized();
  return geometry;
}

vtkBigusSliceRepresentation::vtkBigusSliceRepresentation()
{
  this->InteractionState = Outside;
  this->HandleSize = kHandlePixels;
  vtkNew<vtkBigusSliceProp> prop;
  this->SetSliceProp(prop);
  this->HandleProperty->SetColor(0.9, 0.9, 0.9);
  this->HandleProperty->SetLineWidth(2);
  this->SelectedHandleProperty->SetColor(0, 1, 0);
  this->SelectedHandleProperty->SetLineWidth(2);
  this->Ball->SetThetaResolution(16);
  this->Ball->SetPhiResolution(8);
  this->Tip->SetResolution(12);
  vtkPolyDataAlgorithm* const shapes[3] = {this->Ball, this->Shaft, this->Tip};
  for (int k = 0; k < 3; ++k)
  {
    vtkNew<vtkPolyDataMapper> mapper;
    mapper->SetInputConnection(shapes[k]->GetOutputPort());
    this->Handles[k]->SetMapper(mapper);
    this->Handles[k]->SetProperty(this->HandleProperty);
  }
}

vtkBigusSliceRepresentation::~vtkBigusSliceRepresentation()
{
  this->SetSliceProp(nullptr);
}

vtkCxxSetObjectMacro(vtkBigusSliceRepresentation, SliceProp, vtkBigusSliceProp);

void vtkBigusSliceRepresentation::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "SliceProp: " << this->SliceProp << "\n";
  os << indent << "Tolerance: " << this->Tolerance << "\n";
  os << indent << "MarginSize: " << this->MarginSize << "\n";
  os << indent << "DesiredUpdateRate: " << this->DesiredUpdateRate << "\n";
  os << indent << "HandleVisibility: " << (this->HandleVisibility ? "On\n" : "Off\n");
  os << indent << "HandleProperty: " << this->HandleProperty.Get() << "\n";
  os << indent << "SelectedHandleProperty: " << this->SelectedHandleProperty.Get() << "\n";
  os << indent << "Moving: " << (this->Moving ? "yes\n" : "no\n");
}

//------------------------------------------------------------------------------
// The plane

void vtkBigusSliceRepresentation::GetCenter(double center[3])
{
  Eigen::Map<Vector3d>(center, 3) = this->GeometryOfSlice().centre;
}

void vtkBigusSliceRepresentation::GetNormal(double normal[3])
{
  Eigen::Map<Vector3d>(normal, 3) = this->GeometryOfSlice().normal;
}

void vtkBigusSliceRepresentation::Push(double distance)
{
  Eigen::Matrix4d plane = ToEigen(this->SliceProp->GetPlane());
  plane.col(3).head<3>() += distance * this->GeometryOfSlice().normal;
  Store(plane, this->SliceProp->GetPlane());
}

void vtkBigusSliceRepresentation::Translate(double alongColumns, double alongRows)
{
  const Geometry slice = this->GeometryOfSlice();
  Eigen::Matrix4d plane = ToEigen(this->SliceProp->GetPlane());
  plane.col(3).head<3>() += alongColumns * slice.halfColumns.normalized() + alongRows * slice.halfRows.normalized();
  Store(plane, this->SliceProp->GetPlane());
}

void vtkBigusSliceRepresentation::Rotate(const double axis[3], double degrees)
{
  const Vector3d about(axis);
  if (!(about.norm() > 0) || degrees == 0)
  {
    return;
  }
  const Vector3d centre = this->GeometryOfSlice().centre;
  const Eigen::Affine3d turn = Eigen::Translation3d(centre) *
                               Eigen::AngleAxisd(degrees * bigus::kRadiansPerDegree, about.normalized()) *
                               Eigen::Translation3d(-centre);
  Store(turn.matrix() * ToEigen(this->SliceProp->GetPlane()), this->SliceProp->GetPlane());
}

void vtkBigusSliceRepresentation::AlignWithAxis(int axis)
{
  if (axis < 0 || axis > 2)
  {
    vtkErrorMacro(<< "AlignWithAxis(" << axis << "): the axis must be 0, 1 or 2.");
    return;
  }
  const Geometry slice = this->GeometryOfSlice();
  Eigen::Matrix4d plane = ToEigen(this->SliceProp->GetPlane());
  // The same directions as vtkBigusSliceProp::PlaceInField; lengths of the columns stay.
  const double columns = plane.col(0).head<3>().norm(), rows = plane.col(1).head<3>().norm();
  plane.col(0).head<3>() = columns * Vector3d::Unit(axis == 0 ? 1 : 0);
  plane.col(1).head<3>() = rows * Vector3d::Unit(axis == 2 ? 1 : 2);
  plane.col(2).head<3>() = plane.col(0).head<3>().cross(plane.col(1).head<3>()).normalized();
  Store(plane, this->SliceProp->GetPlane());
  plane.col(3).head<3>() += slice.centre - this->GeometryOfSlice().centre;
  Store(plane, this->SliceProp->GetPlane());
}

void vtkBigusSliceRepresentation::KeepPlane()
{
  std::copy_n(this->SliceProp->GetPlane()->GetData(), 16, this->KeptPlane);
  this->Kept = true;
}

void vtkBigusSliceRepresentation::ResetPlane()
{
  if (this->Kept)
  {
    this->SliceProp->GetPlane()->DeepCopy(this->KeptPlane);
  }
}

void vtkBigusSliceRepresentation::PlaceWidget(double bounds[6])
{
  double placed[6], centre[3];
  this->AdjustBounds(bounds, placed, centre);
  std::copy_n(placed, 6, this->InitialBounds);
  this->InitialLength = (Vector3d(placed[1], placed[3], placed[5]) - Vector3d(placed[0], placed[2], placed[4])).norm();
  this->SliceProp->PlaceInField(2, kPlacedPixels);
  Eigen::Matrix4d plane = ToEigen(this->SliceProp->GetPlane());
  plane.col(3).head<3>() += Vector3d(centre) - this->GeometryOfSlice().centre;
  Store(plane, this->SliceProp->GetPlane());
  this->KeepPlane();
  this->Placed = 1;
  this->ValidPick = 1;
  this->BuildRepresentation();
}

//------------------------------------------------------------------------------
// The mouse

int vtkBigusSliceRepresentation::ComputeInteractionState(int X, int Y, int)
{
  this->InteractionState = Outside;
  if (!this->Renderer || !this->GetVisibility())
  {
    return this->InteractionState;
  }
  const Geometry slice = this->GeometryOfSlice();
  const Eigen::Vector2d mouse(X, Y);
  const Vector3d middle = ToDisplay(this->Renderer, slice.centre);
  const Vector3d tip = ToDisplay(this->Renderer, slice.centre + slice.Arrow() * slice.normal);
  const auto hold = [this](const Vector3d& point) { Eigen::Map<Vector3d>(this->LastPick, 3) = point; };
  Vector3d point;
  double columns, rows;
  const bool met = slice.Meet(ToWorld(this->Renderer, X, Y, 0), ToWorld(this->Renderer, X, Y, 1), point, columns, rows);
  if (this->HandleVisibility && (mouse - middle.head<2>()).norm() <= this->Tolerance)
  {
    this->InteractionState = Translating;
    hold(slice.centre);
  }
  else if (this->HandleVisibility && DistanceToSegment(mouse, middle.head<2>(), tip.head<2>()) <= this->Tolerance)
  {
    this->InteractionState = Rotating;
    hold(slice.centre + slice.Arrow() * slice.normal);
  }
  else if (met && std::abs(columns) <= 1 && std::abs(rows) <= 1)
  {
    const double inner = 1 - 2 * this->MarginSize;
    const bool side = std::abs(columns) > inner, end = std::abs(rows) > inner;
    this->InteractionState = side && end ? Spinning : side || end ? Tilting : Pushing;
    hold(point);
    // At a side the axis runs along the rows, and the arm from it to the mouse along the columns.
    Eigen::Map<Vector3d>(this->TiltAxis, 3) = (side ? slice.halfRows : slice.halfColumns).normalized();
    Eigen::Map<Vector3d>(this->TiltArm, 3) =
        side ? Vector3d(columns * slice.halfColumns) : Vector3d(rows * slice.halfRows);
  }
  return this->InteractionState;
}

void vtkBigusSliceRepresentation::StartWidgetInteraction(double position[2])
{
  this->StartEventPosition[0] = this->LastEventPosition[0] = position[0];
  this->StartEventPosition[1] = this->LastEventPosition[1] = position[1];
  this->SetMoving(this->InteractionState != WindowLevel);
}

void vtkBigusSliceRepresentation::WidgetInteraction(double position[2])
{
  if (!this->Renderer)
  {
    return;
  }
  const Geometry slice = this->GeometryOfSlice();
  // The motion of the mouse at the depth where it holds the slice, mm.
  const double depth = ToDisplay(this->Renderer, Vector3d(this->LastPick))[2];
  const Vector3d from = ToWorld(this->Renderer, this->LastEventPosition[0], this->LastEventPosition[1], depth);
  const Vector3d to = ToWorld(this->Renderer, position[0], position[1], depth);
  const Vector3d motion = to - from;
  double view[3], up[3];
  this->Renderer->GetActiveCamera()->GetDirectionOfProjection(view);
  this->Renderer->GetActiveCamera()->GetViewUp(up);
  // Seen from its front a plane has no motion along its normal in the window: upwards then means away.
  const double facing = slice.normal.dot(Vector3d(view));
  const double along =
      std::abs(facing) > kFacing ? motion.dot(Vector3d(up)) * (facing > 0 ? 1 : -1) : motion.dot(slice.normal);

  switch (this->InteractionState)
  {
    case Pushing:
      this->Push(along);
      break;
    case Translating:
      this->Translate(motion.dot(slice.halfColumns.normalized()), motion.dot(slice.halfRows.normalized()));
      break;
    case Rotating:
    {
      // A trackball: across the whole window is a full turn.
      const int* size = this->Renderer->GetSize();
      const double x = (position[0] - this->LastEventPosition[0]) / size[0];
      const double y = (position[1] - this->LastEventPosition[1]) / size[1];
      const Vector3d axis = motion.cross(Vector3d(view));
      this->Rotate(axis.data(), 360 * std::hypot(x, y));
      break;
    }
    case Tilting:
    {
      const Vector3d axis(this->TiltAxis), arm(this->TiltArm);
      // The margin follows the mouse along the normal. It goes along axis x arm when the angle is positive.
      const double sign = axis.cross(arm).dot(slice.normal) > 0 ? 1 : -1;
      this->Rotate(axis.data(), sign * along / arm.norm() / bigus::kRadiansPerDegree);
      const Eigen::AngleAxisd turn(sign * along / arm.norm(), axis);
      Eigen::Map<Vector3d>(this->TiltArm, 3) = turn * arm;
      break;
    }
    case Spinning:
    {
      Vector3d before, after;
      double columns, rows;
      const auto meet = [&](const double at[2], Vector3d& point)
      {
        return slice.Meet(ToWorld(this->Renderer, at[0], at[1], 0), ToWorld(this->Renderer, at[0], at[1], 1), point,
                          columns, rows);
      };
      if (meet(this->LastEventPosition, before) && meet(position, after))
      {
        before -= slice.centre;
        after -= slice.centre;
        const double angle = std::atan2(before.cross(after).dot(slice.normal), before.dot(after));
        this->Rotate(slice.normal.data(), angle / bigus::kRadiansPerDegree);
      }
      break;
    }
    case WindowLevel:
      this->ChangeWindowLevel(position);
      break;
    default:
      break;
  }
  Eigen::Map<Vector3d>(this->LastPick, 3) += motion;
  this->LastEventPosition[0] = position[0];
  this->LastEventPosition[1] = position[1];
  this->Modified();
  this->BuildRepresentation();
}

void vtkBigusSliceRepresentation::EndWidgetInteraction(double position[2])
{
  this->LastEventPosition[0] = position[0];
  this->LastEventPosition[1] = position[1];
  this->SetMoving(false);
}

void vtkBigusSliceRepresentation::ChangeWindowLevel(const double position[2])
{
  // As in VTK's styles for images: to the right for a wider window, upwards for a higher level, in shares of the picture's.
  const int* size = this->Renderer->GetSize();
  vtkImageProperty* property = this->SliceProp->GetProperty();
  const double window = property->GetColorWindow(), level = property->GetColorLevel();
  const double right = (position[0] - this->LastEventPosition[0]) / size[0];
  const double upwards = (position[1] - this->LastEventPosition[1]) / size[1];
  property->SetColorWindow(std::max(kSmallestWindow, window * (1 + 2 * right)));
  property->SetColorLevel(level + 2 * upwards * window);
}

void vtkBigusSliceRepresentation::SetPictureSeconds(double seconds)
{
  // One picture that another program held up counts as one that was late, not as a second without pictures.
  const double other = std::clamp(seconds - this->SliceProp->GetResliceSeconds(), 0.0, 1 / this->DesiredUpdateRate);
  const double weight = this->OtherSeconds < 0 ? 1 : other > this->OtherSeconds ? kRise : kFall;
  this->OtherSeconds += weight * (other - this->OtherSeconds);
  if (this->Moving)
  {
    this->SetMoving(true);
  }
}

void vtkBigusSliceRepresentation::SetMoving(bool moving)
{
  this->Moving = moving;
  const double picture = 1 / this->DesiredUpdateRate;
  const double left = kAim * picture - std::max(0.0, this->OtherSeconds);
  this->SliceProp->SetTimeBudget(moving ? std::max(left, kLeastShare * picture) : 0);
}

void vtkBigusSliceRepresentation::Highlight(int on)
{
  if ((on != 0) == this->Highlighted)
  {
    return;
  }
  this->Highlighted = on != 0;
  vtkProperty* outline = this->SliceProp->GetOutlineProperty();
  if (on)
  {
    outline->GetColor(this->OutlineColor);
    outline->SetColor(this->SelectedHandleProperty->GetColor());
  }
  else
  {
    outline->SetColor(this->OutlineColor);
  }
  const bool ball = on && this->InteractionState == Translating;
  const bool arrow = on && this->InteractionState == Rotating;
  this->Handles[0]->SetProperty(ball ? this->SelectedHandleProperty : this->HandleProperty);
  this->Handles[1]->SetProperty(arrow ? this->SelectedHandleProperty : this->HandleProperty);
  this->Handles[2]->SetProperty(arrow ? this->SelectedHandleProperty : this->HandleProperty);
}

//------------------------------------------------------------------------------
// Drawing

void vtkBigusSliceRepresentation::BuildRepresentation()
{
  const Geometry slice = this->GeometryOfSlice();
  Vector3d centre = slice.centre;
  const Vector3d tip = centre + slice.Arrow() * slice.normal;
  double radius = 0.05 * slice.Arrow();
  if (this->Renderer && this->Renderer->GetActiveCamera())
  {
    this->ValidPick = 1;
    radius = this->SizeHandlesInPixels(1, centre.data());
  }
  this->Ball->SetCenter(centre.data());
  this->Ball->SetRadius(radius);
  this->Shaft->SetPoint1(centre.data());
  this->Shaft->SetPoint2(tip[0], tip[1], tip[2]);
  this->Tip->SetCenter(tip[0], tip[1], tip[2]);
  this->Tip->SetDirection(slice.normal.data());
  this->Tip->SetHeight(3 * radius);
  this->Tip->SetRadius(1.2 * radius);
  this->BuildTime.Modified();
}

double* vtkBigusSliceRepresentation::GetBounds()
{
  this->BuildRepresentation();
  double* bounds = this->SliceProp->GetBounds();
  if (!bounds || !this->HandleVisibility)
  {
    return bounds;
  }
  double* all = this->DrawnBounds;
  std::copy_n(bounds, 6, all);
  for (vtkActor* handle : this->Handles)
  {
    const double* more = handle->GetBounds();
    for (int axis = 0; axis < 3; ++axis)
    {
      all[2 * axis] = std::min(all[2 * axis], more[2 * axis]);
      all[2 * axis + 1] = std::max(all[2 * axis + 1], more[2 * axis + 1]);
    }
  }
  return all;
}

void vtkBigusSliceRepresentation::GetActors(vtkPropCollection* props)
{
  this->SliceProp->GetActors(props);
  for (vtkActor* handle : this->Handles)
  {
    props->AddItem(handle);
  }
}

void vtkBigusSliceRepresentation::ReleaseGraphicsResources(vtkWindow* window)
{
  this->SliceProp->ReleaseGraphicsResources(window);
  for (vtkActor* handle : this->Handles)
  {
    handle->ReleaseGraphicsResources(window);
  }
}

int vtkBigusSliceRepresentation::RenderOpaqueGeometry(vtkViewport* viewport)
{
  this->BuildRepresentation();
  int drawn = this->SliceProp->RenderOpaqueGeometry(viewport);
  for (vtkActor* handle : this->Handles)
  {
    drawn += this->HandleVisibility ? handle->RenderOpaqueGeometry(viewport) : 0;
  }
  return drawn;
}

int vtkBigusSliceRepresentation::RenderTranslucentPolygonalGeometry(vtkViewport* viewport)
{
  this->SliceProp->SetPropertyKeys(this->GetPropertyKeys());
  return this->SliceProp->RenderTranslucentPolygonalGeometry(viewport);
}

vtkTypeBool vtkBigusSliceRepresentation::HasTranslucentPolygonalGeometry()
{
  return this->SliceProp->HasTranslucentPolygonalGeometry();
}

vtkMTimeType vtkBigusSliceRepresentation::GetMTime()
{
  return std::max(this->Superclass::GetMTime(), this->SliceProp ? this->SliceProp->GetMTime() : 0);
}
