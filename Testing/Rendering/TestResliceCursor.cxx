// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusResliceCursorRepresentation in VTK's own reslice cursor widget, moved by events.
#include <memory>

#include "RenderingTestSupport.h"
#include "vtkBigusReslice.h"
#include "vtkBigusResliceCursorRepresentation.h"
#include "vtkCallbackCommand.h"
#include "vtkCamera.h"
#include "vtkGenericRenderWindowInteractor.h"
#include "vtkPlane.h"
#include "vtkPlaneSource.h"
#include "vtkResliceCursor.h"
#include "vtkResliceCursorPolyDataAlgorithm.h"
#include "vtkResliceCursorWidget.h"

namespace bigus::test
{
namespace
{

using Eigen::Vector3d;

struct CursorView : Scene
{
  CursorView(vtkPolyData* field, vtkResliceCursor* cursor, int axis) : Scene(240, 240)
  {
    this->representation->SetInputData(field);
    this->representation->PlaceCursor(cursor, axis, 64);
    this->interactor->SetRenderWindow(this->window);
    this->interactor->SetInteractorStyle(nullptr);
    this->interactor->Initialize();
    this->widget->SetInteractor(this->interactor);
    this->widget->SetRepresentation(this->representation);
    this->widget->SetDefaultRenderer(this->renderer);
    this->renderer->GetActiveCamera()->ParallelProjectionOn();
    this->widget->On();
    Vector3d from = Vector3d::Unit(axis), up = Vector3d::Unit(axis == 2 ? 1 : 2);
    vtkCamera* camera = this->renderer->GetActiveCamera();
    camera->SetFocalPoint(cursor->GetCenter());
    const Vector3d position = Vector3d(cursor->GetCenter()) + 50 * from;
    camera->SetPosition(position.data());
    camera->SetViewUp(up.data());
    camera->SetParallelScale(14);
    camera->SetClippingRange(1, 200);
    this->window->Render();
  }

  Eigen::Vector2d ToWindow(const Vector3d& point)
  {
    this->renderer->SetWorldPoint(point[0], point[1], point[2], 1);
    this->renderer->WorldToDisplay();
    return {std::round(this->renderer->GetDisplayPoint()[0]), std::round(this->renderer->GetDisplayPoint()[1])};
  }

  void Send(unsigned long event, const Eigen::Vector2d& at)
  {
    this->interactor->SetEventInformation(static_cast<int>(at[0]), static_cast<int>(at[1]));
    this->interactor->InvokeEvent(event);
  }

  /// The texture is, bit for bit, a reslice by hand of the rectangle on which it is drawn.
  ::testing::AssertionResult IsExact(vtkPolyData* field)
  {
    this->window->Render();
    vtkImageData* shown = this->representation->GetFieldReslice()->GetOutput();
    const int* size = shown->GetDimensions();
    const Vector3d origin(this->representation->GetPlaneSource()->GetOrigin());
    const Vector3d columns = Vector3d(this->representation->GetPlaneSource()->GetPoint1()) - origin;
    const Vector3d rows = Vector3d(this->representation->GetPlaneSource()->GetPoint2()) - origin;
    vtkNew<vtkBigusReslice> reslice;
    reslice->SetInputData(field);
    Eigen::Matrix3d turn;
    turn << columns.normalized(), rows.normalized(), columns.cross(rows).normalized();
    reslice->SetResliceAxes(ToVtk(RigidMatrix(turn, origin)));
    reslice->SetOutputDimensionality(2);
    reslice->SetOutputSpacing(columns.norm() / size[0], rows.norm() / size[1], 1);
    reslice->SetOutputOrigin(0.5 * columns.norm() / size[0], 0.5 * rows.norm() / size[1], 0);
    reslice->SetOutputExtent(0, size[0] - 1, 0, size[1] - 1, 0, 0);
    reslice->Update();
    // The two planes differ by roundings of double, so floats may in their last bits.
    for (int j = 0; j < size[1]; ++j)
    {
      for (int i = 0; i < size[0]; ++i)
      {
        const float a = FloatAt(shown, i, j, 0), b = FloatAt(reslice->GetOutput(), i, j, 0);
        if (std::abs(a - b) > 2e-5f)
        {
          return ::testing::AssertionFailure() << "pixel (" << i << ", " << j << ") is " << a << ", by hand " << b;
        }
      }
    }
    return LargestValue(shown) > 0.2 ? ::testing::AssertionSuccess() : ::testing::AssertionFailure() << "it is dark";
  }

  vtkNew<vtkBigusResliceCursorRepresentation> representation;
  vtkNew<vtkResliceCursorWidget> widget;
  vtkNew<vtkGenericRenderWindowInteractor> interactor;
};

TEST(ResliceCursor, ThreeViewsShowTheFieldAtTheCursorAndFollowItsCentre)
{
  BIGUS_NEEDS_DISPLAY();
  const auto field = ToPolyData(RandomField(80, 11));
  vtkNew<vtkResliceCursor> cursor;
  std::vector<std::unique_ptr<CursorView>> views;
  for (int axis = 0; axis < 3; ++axis)
  {
    views.push_back(std::make_unique<CursorView>(field, cursor, axis));
    EXPECT_TRUE(views.back()->IsExact(field)) << axis;
  }
  // Seen along z, the centre is dragged 3 mm along x and 2 mm along y.
  CursorView& view = *views[2];
  const Vector3d centre(cursor->GetCenter()), wanted = centre + Vector3d(3, 2, 0);
  const Eigen::Vector2d from = view.ToWindow(centre), to = view.ToWindow(wanted);
  view.Send(vtkCommand::MouseMoveEvent, from);
  view.Send(vtkCommand::LeftButtonPressEvent, from);
  view.Send(vtkCommand::MouseMoveEvent, 0.5 * (from + to));
  view.Send(vtkCommand::MouseMoveEvent, to);
  view.Send(vtkCommand::LeftButtonReleaseEvent, to);
  EXPECT_LT((Vector3d(cursor->GetCenter()) - wanted).norm(), 0.25);  // places are whole pixels of the window
  for (int axis = 0; axis < 3; ++axis)
  {
    EXPECT_TRUE(views[axis]->IsExact(field)) << axis;
    EXPECT_NEAR(views[axis]->representation->GetPlaneSource()->GetOrigin()[axis], cursor->GetCenter()[axis], 1e-6);
  }
}

TEST(ResliceCursor, TheCursorsLinesAreSeenInEveryView)
{
  BIGUS_NEEDS_DISPLAY();
  const auto field = ToPolyData(RandomField(80, 11));
  vtkNew<vtkResliceCursor> cursor;
  for (int axis = 0; axis < 3; ++axis)
  {
    CursorView view(field, cursor, axis);
    const auto pixels = view.Pixels();
    int coloured = 0;  // the picture is grey
    for (vtkIdType k = 0; k < pixels->GetNumberOfTuples(); ++k)
    {
      coloured += pixels->GetComponent(k, 0) != pixels->GetComponent(k, 1) ||
                  pixels->GetComponent(k, 1) != pixels->GetComponent(k, 2);
    }
    EXPECT_GT(coloured, 150) << axis;  // two lines in a window of 240 x 240
    EXPECT_LT(coloured, 2000) << axis;
  }
}

TEST(ResliceCursor, AnObliquePlaneIsShownExactly)
{
  BIGUS_NEEDS_DISPLAY();
  const auto field = ToPolyData(RandomField(80, 11));
  vtkNew<vtkResliceCursor> cursor;
  CursorView view(field, cursor, 0);
  cursor->GetPlane(0)->SetNormal(0.8, 0.6, 0);
  EXPECT_TRUE(view.IsExact(field));
  const Vector3d normal(view.representation->GetPlaneSource()->GetNormal());
  EXPECT_NEAR(std::abs(normal.dot(Vector3d(0.8, 0.6, 0))), 1, 1e-6);
}

TEST(ResliceCursor, TurningALineTurnsThePlaneOfAnotherView)
{
  BIGUS_NEEDS_DISPLAY();
  const auto field = ToPolyData(RandomField(80, 11));
  vtkNew<vtkResliceCursor> cursor;
  std::vector<std::unique_ptr<CursorView>> views;
  for (int axis = 0; axis < 3; ++axis)
  {
    views.push_back(std::make_unique<CursorView>(field, cursor, axis));
  }
  // Seen along z, a line is held 6 mm from the centre along x and dragged by 30 degrees about the centre.
  CursorView& view = *views[2];
  const Vector3d centre(cursor->GetCenter());
  const double radius = 6, turn = 30 * kRadiansPerDegree;
  const Eigen::Vector2d from = view.ToWindow(centre + Vector3d(radius, 0, 0));
  const Eigen::Vector2d to = view.ToWindow(centre + radius * Vector3d(std::cos(turn), std::sin(turn), 0));
  view.Send(vtkCommand::MouseMoveEvent, from);
  view.Send(vtkCommand::LeftButtonPressEvent, from);
  view.Send(vtkCommand::MouseMoveEvent, to);
  view.Send(vtkCommand::LeftButtonReleaseEvent, to);
  // The line along x is the plane with normal y, in the view of that plane.
  const Vector3d normal(cursor->GetPlane(1)->GetNormal());
  EXPECT_NEAR(std::abs(normal.dot(Vector3d(-std::sin(turn), std::cos(turn), 0))), 1, 2e-3);
  for (int axis = 0; axis < 3; ++axis)
  {
    EXPECT_TRUE(views[axis]->IsExact(field)) << axis;
  }
}

TEST(ResliceCursor, WithoutAFieldItSaysWhatIsMissing)
{
  vtkNew<vtkBigusResliceCursorRepresentation> representation;
  vtkNew<vtkResliceCursor> cursor;
  std::string text;
  vtkNew<vtkCallbackCommand> keep;
  keep->SetClientData(&text);
  keep->SetCallback([](vtkObject*, unsigned long, void* text, void* message)
                    { *static_cast<std::string*>(text) += static_cast<const char*>(message); });
  representation->AddObserver(vtkCommand::ErrorEvent, keep);
  representation->PlaceCursor(cursor, 0, 64);
  EXPECT_NE(text.find("SetInputData"), std::string::npos) << text;
}

}  // namespace
}  // namespace bigus::test
