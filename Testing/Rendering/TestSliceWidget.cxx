// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusSliceWidget by the events that a user's mouse and keys send.
#include <map>

#include "Core/Numerics/Constants.h"
#include "RenderingTestSupport.h"
#include "vtkBigusReslice.h"
#include "vtkBigusSliceProp.h"
#include "vtkBigusSliceRepresentation.h"
#include "vtkBigusSliceWidget.h"
#include "vtkCallbackCommand.h"
#include "vtkCamera.h"
#include "vtkGenericRenderWindowInteractor.h"
#include "vtkImageProperty.h"

namespace bigus::test
{
namespace
{

using Eigen::Matrix4d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kSide = 64;  // pixels of the square slice, 0.25 mm apart, about the plane's origin
constexpr double kWidgetStep = 0.25;
constexpr double kHalf = 0.5 * kSide * kWidgetStep;  // mm

using State = vtkBigusSliceRepresentation;

/// A slice at z = 0 in a window that sees it from the side, in parallel projection.
struct WidgetScene : Scene
{
  explicit WidgetScene(const Vector3d& from = {12, -30, 40})
  {
    this->prop = this->widget->GetSliceRepresentation()->GetSliceProp();
    this->prop->SetInputData(this->field);
    this->prop->SetPlane(this->plane);
    this->prop->SetSliceSize(kSide, kSide);
    this->prop->SetSliceSpacing(kWidgetStep, kWidgetStep);
    this->prop->SetSliceOrigin(-0.5 * (kSide - 1) * kWidgetStep, -0.5 * (kSide - 1) * kWidgetStep);
    vtkCamera* camera = this->renderer->GetActiveCamera();
    camera->ParallelProjectionOn();
    camera->SetParallelScale(16);
    camera->SetFocalPoint(0, 0, 0);
    camera->SetPosition(from.data());
    camera->SetViewUp(0, 1, 0);
    camera->SetClippingRange(1, 200);
    this->interactor->SetRenderWindow(this->window);
    this->interactor->SetInteractorStyle(nullptr);  // what the widget lets pass goes nowhere
    this->interactor->Initialize();
    this->widget->SetInteractor(this->interactor);
    this->count->SetClientData(&this->events);
    this->count->SetCallback([](vtkObject*, unsigned long event, void* events, void*)
                             { ++(*static_cast<std::map<unsigned long, int>*>(events))[event]; });
    for (const auto event :
         {vtkCommand::StartInteractionEvent, vtkCommand::InteractionEvent, vtkCommand::EndInteractionEvent})
    {
      this->widget->AddObserver(event, this->count);
    }
    this->window->Render();
    this->widget->On();
    this->window->Render();
  }

  Vector2d ToWindow(const Vector3d& point)
  {
    this->renderer->SetWorldPoint(point[0], point[1], point[2], 1);
    this->renderer->WorldToDisplay();
    const double* display = this->renderer->GetDisplayPoint();
    return {std::round(display[0]), std::round(display[1])};
  }

  void Send(unsigned long event, const Vector2d& at, bool shift = false)
  {
    this->interactor->SetEventInformation(static_cast<int>(at[0]), static_cast<int>(at[1]), 0, shift);
    this->interactor->InvokeEvent(event);
  }

  void Press(const char* key, bool shift = false, bool control = false)
  {
    this->interactor->SetEventInformation(5, 5, control, shift, 0, 0, key);
    this->interactor->InvokeEvent(vtkCommand::KeyPressEvent);
  }

  void Drag(const Vector2d& from, const Vector2d& to, bool shift = false)
  {
    this->Send(vtkCommand::LeftButtonPressEvent, from, shift);
    for (const double share : {0.25, 0.5, 0.75, 1.0})
    {
      this->Send(vtkCommand::MouseMoveEvent, (from + share * (to - from)).array().round());
    }
    this->Send(vtkCommand::LeftButtonReleaseEvent, to);
  }

  /// Millimetres that a motion in the window means in parallel projection.
  Vector3d MotionInWorld(const Vector2d& pixels)
  {
    vtkCamera* camera = this->renderer->GetActiveCamera();
    const Vector3d view(camera->GetDirectionOfProjection());
    const Vector3d right = view.cross(Vector3d(camera->GetViewUp())).normalized();
    const double mmPerPixel = 2 * camera->GetParallelScale() / this->window->GetSize()[1];
    return mmPerPixel * (pixels[0] * right + pixels[1] * right.cross(view));
  }

  Matrix4d Plane() { return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(this->plane->GetData()); }

  /// The picture in use is, bit for bit, one made by hand at the plane as it is now.
  ::testing::AssertionResult IsExact()
  {
    vtkNew<vtkBigusReslice> reslice;
    reslice->SetInputData(this->field);
    vtkNew<vtkMatrix4x4> axes;
    axes->DeepCopy(this->plane);
    reslice->SetResliceAxes(axes);
    reslice->SetOutputDimensionality(2);
    reslice->SetOutputSpacing(kWidgetStep, kWidgetStep, 1);
    reslice->SetOutputOrigin(-0.5 * (kSide - 1) * kWidgetStep, -0.5 * (kSide - 1) * kWidgetStep, 0);
    reslice->SetOutputExtent(0, kSide - 1, 0, kSide - 1, 0, 0);
    reslice->Update();
    return SameBits(this->prop->GetReslice()->GetOutput(), reslice->GetOutput());
  }

  vtkSmartPointer<vtkPolyData> field = ToPolyData(RandomField(80, 11));
  vtkNew<vtkMatrix4x4> plane;
  vtkNew<vtkBigusSliceWidget> widget;
  vtkBigusSliceProp* prop;
  vtkNew<vtkGenericRenderWindowInteractor> interactor;
  std::map<unsigned long, int> events;
  vtkNew<vtkCallbackCommand> count;
};

TEST(SliceWidget, WhatLiesUnderTheMouseIsTold)
{
  BIGUS_NEEDS_DISPLAY();
  WidgetScene scene;
  vtkBigusSliceRepresentation* representation = scene.widget->GetSliceRepresentation();
  const auto stateAt = [&](const Vector3d& point)
  {
    const Vector2d at = scene.ToWindow(point);
    return representation->ComputeInteractionState(static_cast<int>(at[0]), static_cast<int>(at[1]));
  };
  EXPECT_EQ(stateAt({0, 0, 0}), State::Translating);                      // the ball
  EXPECT_EQ(stateAt({0, 0, 3.5}), State::Rotating);                       // the arrow
  EXPECT_EQ(stateAt({4, -3, 0}), State::Pushing);                         // inside
  EXPECT_EQ(stateAt({0.95 * kHalf, -1, 0}), State::Tilting);              // a margin
  EXPECT_EQ(stateAt({-0.95 * kHalf, 0.95 * kHalf, 0}), State::Spinning);  // a corner
  EXPECT_EQ(stateAt({1.2 * kHalf, 0, 0}), State::Outside);
}

TEST(SliceWidget, LeftPushesAlongTheNormalByTheMotionAlongIt)
{
  BIGUS_NEEDS_DISPLAY();
  WidgetScene scene;
  const Vector2d from = scene.ToWindow({4, -3, 0}), motion(8, 32);
  scene.Drag(from, from + motion);
  EXPECT_EQ(scene.events[vtkCommand::StartInteractionEvent], 1);
  EXPECT_EQ(scene.events[vtkCommand::InteractionEvent], 4);
  EXPECT_EQ(scene.events[vtkCommand::EndInteractionEvent], 1);
  Matrix4d expected = Matrix4d::Identity();
  expected(2, 3) = scene.MotionInWorld(motion)[2];
  EXPECT_GT(expected(2, 3), 0.5);
  EXPECT_LT((scene.Plane() - expected).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_TRUE(scene.IsExact());
}

TEST(SliceWidget, FromTheFrontUpwardsPushesAway)
{
  BIGUS_NEEDS_DISPLAY();
  WidgetScene scene({0, 0, 40});
  const Vector2d from = scene.ToWindow({4, -3, 0}), motion(0, 30);
  scene.Drag(from, from + motion);
  EXPECT_NEAR(scene.Plane()(2, 3), -scene.MotionInWorld(motion)[1], 1e-6);
  EXPECT_TRUE(scene.IsExact());
}

TEST(SliceWidget, ShiftAndTheBallMoveItInItsPlane)
{
  BIGUS_NEEDS_DISPLAY();
  for (const bool ball : {false, true})
  {
    WidgetScene scene({0, 0, 40});
    const Vector2d from = scene.ToWindow(ball ? Vector3d(0, 0, 0) : Vector3d(4, -3, 0)), motion(21, -13);
    scene.Drag(from, from + motion, !ball);
    Matrix4d expected = Matrix4d::Identity();
    expected.col(3).head<3>() = scene.MotionInWorld(motion);
    EXPECT_LT((scene.Plane() - expected).cwiseAbs().maxCoeff(), 1e-6) << (ball ? "ball" : "shift");
    EXPECT_TRUE(scene.IsExact());
  }
}

TEST(SliceWidget, ACornerSpinsByTheAngleThatTheMouseGoesRound)
{
  BIGUS_NEEDS_DISPLAY();
  WidgetScene scene({0, 0, 40});
  const Vector3d corner(0.95 * kHalf, 0.95 * kHalf, 0);
  scene.Drag(scene.ToWindow(corner), scene.ToWindow(Vector3d(-corner[0], corner[1], 0)));
  const Matrix4d quarter = RigidMatrix(Eigen::AngleAxisd(0.5 * kPi, Vector3d::UnitZ()).toRotationMatrix(), {0, 0, 0});
  EXPECT_LT((scene.Plane() - quarter).cwiseAbs().maxCoeff(), 0.02);  // places are whole pixels of the window
  EXPECT_TRUE(scene.IsExact());
}

TEST(SliceWidget, AMarginTiltsAboutTheAxisThroughTheMiddleAndFollowsTheMouse)
{
  BIGUS_NEEDS_DISPLAY();
  WidgetScene scene({0, -40, 3});  // nearly along the plane, so that upwards is along the normal
  const Vector3d held(0.93 * kHalf, 0, 0);
  const Vector2d from = scene.ToWindow(held), motion(0, 6);
  scene.Drag(from, from + motion);
  const Matrix4d plane = scene.Plane();
  EXPECT_LT(plane.col(3).head<3>().norm(), 1e-9);                            // the middle stays
  EXPECT_LT((plane.col(1).head<3>() - Vector3d::UnitY()).norm(), 1e-9);      // and the axis
  EXPECT_NEAR(held[0] * plane(2, 0), scene.MotionInWorld(motion)[2], 0.05);  // what was held goes up with the mouse
  EXPECT_TRUE(scene.IsExact());
}

TEST(SliceWidget, TheArrowTurnsFreelyAboutTheMiddle)
{
  BIGUS_NEEDS_DISPLAY();
  WidgetScene scene;
  const Vector2d from = scene.ToWindow({0, 0, 3.5}), motion(40, 0);
  scene.Drag(from, from + motion);
  const Matrix4d plane = scene.Plane();
  const Eigen::Matrix3d turn = plane.topLeftCorner<3, 3>();
  EXPECT_LT((turn * turn.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_LT(plane.col(3).head<3>().norm(), 1e-9);
  // A share of the window's width is that share of a full turn, and the arrow's tip goes with the mouse.
  const double angle = Eigen::AngleAxisd(turn).angle();
  EXPECT_NEAR(angle, 2 * kPi * 40 / 300, 1e-9);
  EXPECT_GT(turn.col(2).dot(scene.MotionInWorld(motion)), 0);
  EXPECT_TRUE(scene.IsExact());
}

TEST(SliceWidget, RightChangesWindowAndLevelAndLeavesThePlane)
{
  BIGUS_NEEDS_DISPLAY();
  WidgetScene scene;
  const Vector2d from = scene.ToWindow({4, -3, 0});
  scene.Send(vtkCommand::RightButtonPressEvent, from);
  scene.Send(vtkCommand::MouseMoveEvent, from + Vector2d(30, 24));
  EXPECT_EQ(scene.prop->GetReduction(), 1);
  scene.Send(vtkCommand::RightButtonReleaseEvent, from + Vector2d(30, 24));
  EXPECT_NEAR(scene.prop->GetProperty()->GetColorWindow(), 1.2, 1e-9);
  EXPECT_NEAR(scene.prop->GetProperty()->GetColorLevel(), 0.7, 1e-9);
  EXPECT_EQ(scene.Plane(), Matrix4d::Identity());
}

TEST(SliceWidget, ItIsCoarseWhileItMovesAndExactWhenTheMouseRestsOrLeaves)
{
  BIGUS_NEEDS_DISPLAY();
  WidgetScene scene;
  scene.widget->GetSliceRepresentation()->SetDesiredUpdateRate(1000);
  scene.prop->GetReslice()->SetEngine("reference");  // slow enough for any clock
  const Vector2d from = scene.ToWindow({4, -3, 0});
  scene.Send(vtkCommand::LeftButtonPressEvent, from);
  for (int k = 1; k <= 4; ++k)
  {
    scene.Send(vtkCommand::MouseMoveEvent, from + Vector2d(0, 2 * k));
  }
  EXPECT_GT(scene.prop->GetReduction(), 1);
  EXPECT_GT(scene.widget->GetPictureSeconds(), scene.widget->GetResliceSeconds());
  scene.widget->GetSliceRepresentation()->SetMoving(false);
  scene.window->Render();
  EXPECT_EQ(scene.prop->GetReduction(), 1);
  scene.Send(vtkCommand::MouseMoveEvent, from + Vector2d(0, 10));
  scene.Send(vtkCommand::LeftButtonReleaseEvent, from + Vector2d(0, 10));
  EXPECT_EQ(scene.prop->GetReduction(), 1);
  EXPECT_EQ(scene.prop->GetReslice()->GetOutput()->GetDimensions()[0], kSide);
  EXPECT_EQ(scene.prop->GetReslice()->GetTolerance(), 1e-4);
}

TEST(SliceWidget, TheBudgetLeavesRoomFollowsSlowPicturesAtOnceAndForgetsAHiccup)
{
  vtkNew<vtkBigusSliceRepresentation> representation;
  vtkBigusSliceProp* prop = representation->GetSliceProp();
  representation->SetDesiredUpdateRate(25);  // 40 ms
  const auto budgetAfter = [&](double seconds, int pictures)
  {
    for (int k = 0; k < pictures; ++k)
    {
      representation->SetPictureSeconds(seconds);
    }
    return prop->GetTimeBudget();
  };
  representation->SetMoving(true);
  // All but the slice takes 20 ms. The first picture tells, and with the slice a picture takes less than it may.
  const double steady = budgetAfter(0.020, 1);
  EXPECT_GT(steady, 0.010);
  EXPECT_LT(0.020 + steady, 0.9 * 0.040);
  // Two pictures that take 26 ms cut what the slice may take by more than half of the difference.
  EXPECT_LT(budgetAfter(0.026, 2), steady - 0.003);
  EXPECT_GT(budgetAfter(0.020, 40), 0.9 * steady);
  // A second in which another program had the processor counts as one late picture.
  EXPECT_LT(budgetAfter(1.0, 1), 0.8 * steady);
  EXPECT_GT(budgetAfter(0.020, 15), 0.8 * steady);
  // However slow the rest is, the slice has some time, because a slice without pixels shows nothing.
  EXPECT_GT(budgetAfter(0.5, 50), 0.007);
  representation->SetMoving(false);
  EXPECT_EQ(prop->GetTimeBudget(), 0);
}

TEST(SliceWidget, KeysPushTurnAlignAndPutBack)
{
  BIGUS_NEEDS_DISPLAY();
  WidgetScene scene;
  scene.Press("Up");
  EXPECT_DOUBLE_EQ(scene.Plane()(2, 3), 0.5);
  EXPECT_TRUE(scene.IsExact());
  scene.Press("Left");
  EXPECT_DOUBLE_EQ(scene.Plane()(2, 3), 0);
  scene.Press("Up", true);
  EXPECT_NEAR(scene.Plane()(2, 1), std::sin(kRadiansPerDegree), 1e-12);
  EXPECT_TRUE(scene.IsExact());
  scene.Press("Right", false, true);
  EXPECT_NEAR(scene.Plane()(0, 3), 0.5, 1e-12);
  scene.Press("x");
  EXPECT_LT((scene.Plane().col(0).head<3>() - Vector3d::UnitY()).norm(), 1e-12);
  EXPECT_LT((scene.Plane().col(1).head<3>() - Vector3d::UnitZ()).norm(), 1e-12);
  EXPECT_NEAR(scene.Plane()(0, 3), 0.5, 1e-9);
  scene.Press("Home");
  EXPECT_EQ(scene.Plane(), Matrix4d::Identity());
  EXPECT_TRUE(scene.IsExact());
  scene.Press("b");
  EXPECT_TRUE(scene.prop->GetBeamVisibility());
  scene.Press("g");
  EXPECT_FALSE(scene.prop->GetCoverageVisibility());
  const int before = scene.events[vtkCommand::InteractionEvent];
  scene.Press("q");
  EXPECT_EQ(scene.events[vtkCommand::InteractionEvent], before);
}

TEST(SliceWidget, BesideTheSliceAndWhenOffNothingMoves)
{
  BIGUS_NEEDS_DISPLAY();
  WidgetScene scene;
  scene.Drag({3, 3}, {90, 90});
  EXPECT_EQ(scene.Plane(), Matrix4d::Identity());
  EXPECT_EQ(scene.events[vtkCommand::StartInteractionEvent], 0);
  scene.widget->Off();
  const Vector2d from = scene.ToWindow({4, -3, 0});
  scene.Drag(from, from + Vector2d(8, 32));
  scene.Press("Up");
  EXPECT_EQ(scene.Plane(), Matrix4d::Identity());
}

TEST(SliceWidget, PlaceWidgetPutsItThroughTheMiddleOfTheBounds)
{
  vtkNew<vtkBigusSliceRepresentation> representation;
  representation->GetSliceProp()->SetInputData(ToPolyData(RandomField(80, 11)));
  double bounds[6] = {0, 2, -4, 4, 5, 9}, centre[3], normal[3];
  representation->PlaceWidget(bounds);
  representation->GetCenter(centre);
  representation->GetNormal(normal);
  EXPECT_LT((Vector3d(centre) - Vector3d(1, 0, 7)).norm(), 1e-9);
  EXPECT_LT((Vector3d(normal) - Vector3d::UnitZ()).norm(), 1e-9);
  EXPECT_EQ(
      std::max(representation->GetSliceProp()->GetSliceSize()[0], representation->GetSliceProp()->GetSliceSize()[1]),
      512);
}

}  // namespace
}  // namespace bigus::test
