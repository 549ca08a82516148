// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusSliceWidget.h"

#include <chrono>
#include <string>

#include "vtkBigusSliceProp.h"
#include "vtkBigusSliceRepresentation.h"
#include "vtkCallbackCommand.h"
#include "vtkCommand.h"
#include "vtkEvent.h"
#include "vtkMatrix4x4.h"
#include "vtkObjectFactory.h"
#include "vtkRenderWindow.h"
#include "vtkRenderWindowInteractor.h"
#include "vtkRenderer.h"
#include "vtkWidgetCallbackMapper.h"
#include "vtkWidgetEvent.h"
#include "vtkWidgetEventTranslator.h"

vtkStandardNewMacro(vtkBigusSliceWidget);

namespace
{

// The direction of a column of the plane.
void ColumnOf(vtkBigusSliceRepresentation* representation, int column, double direction[3])
{
  for (int row = 0; row < 3; ++row)
  {
    direction[row] = representation->GetSliceProp()->GetPlane()->GetElement(row, column);
  }
}

}  // namespace

vtkBigusSliceWidget::vtkBigusSliceWidget()
{
  using Self = vtkBigusSliceWidget;
  vtkWidgetCallbackMapper* mapper = this->CallbackMapper;
  mapper->SetCallbackMethod(vtkCommand::LeftButtonPressEvent, vtkWidgetEvent::Select, this, Self::SelectAction);
  mapper->SetCallbackMethod(vtkCommand::LeftButtonReleaseEvent, vtkWidgetEvent::EndSelect, this, Self::EndSelectAction);
  mapper->SetCallbackMethod(vtkCommand::MiddleButtonPressEvent, vtkWidgetEvent::Translate, this, Self::TranslateAction);
  mapper->SetCallbackMethod(vtkCommand::MiddleButtonReleaseEvent, vtkWidgetEvent::EndTranslate, this,
                            Self::EndSelectAction);
  mapper->SetCallbackMethod(vtkCommand::RightButtonPressEvent, vtkWidgetEvent::Scale, this, Self::WindowLevelAction);
  mapper->SetCallbackMethod(vtkCommand::RightButtonReleaseEvent, vtkWidgetEvent::EndScale, this, Self::EndSelectAction);
  mapper->SetCallbackMethod(vtkCommand::MouseMoveEvent, vtkWidgetEvent::Move, this, Self::MoveAction);
  mapper->SetCallbackMethod(vtkCommand::TimerEvent, vtkWidgetEvent::TimedOut, this, Self::RestAction);
  for (const char* key : {"Up", "Down", "Left", "Right", "x", "y", "z", "b", "g", "Home"})
  {
    mapper->SetCallbackMethod(vtkCommand::KeyPressEvent, vtkEvent::AnyModifier, 0, 0, key, vtkWidgetEvent::ModifyEvent,
                              this, Self::KeyAction);
  }
}

void vtkBigusSliceWidget::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "KeyStep: " << this->KeyStep << "\n";
  os << indent << "KeyAngle: " << this->KeyAngle << "\n";
  os << indent << "RestMilliseconds: " << this->RestMilliseconds << "\n";
  os << indent << "PictureSeconds: " << this->PictureSeconds << "\n";
  os << indent << "ResliceSeconds: " << this->ResliceSeconds << "\n";
}

void vtkBigusSliceWidget::SetRepresentation(vtkBigusSliceRepresentation* representation)
{
  this->SetWidgetRepresentation(representation);
}

vtkBigusSliceRepresentation* vtkBigusSliceWidget::GetSliceRepresentation()
{
  this->CreateDefaultRepresentation();
  return vtkBigusSliceRepresentation::SafeDownCast(this->WidgetRep);
}

void vtkBigusSliceWidget::CreateDefaultRepresentation()
{
  if (!this->WidgetRep)
  {
    this->WidgetRep = vtkBigusSliceRepresentation::New();
  }
}

void vtkBigusSliceWidget::SetEnabled(int enabling)
{
  if (this->Enabled == enabling)
  {
    return;
  }
  if (enabling)
  {
    this->GetSliceRepresentation()->KeepPlane();
  }
  else
  {
    this->StopTimer();
    this->WidgetState = Waiting;
  }
  this->Superclass::SetEnabled(enabling);
}

//------------------------------------------------------------------------------
// The mouse

void vtkBigusSliceWidget::Start(int state)
{
  vtkBigusSliceRepresentation* representation = this->GetSliceRepresentation();
  const int* at = this->Interactor->GetEventPosition();
  if (!this->CurrentRenderer || !this->CurrentRenderer->IsInViewport(at[0], at[1]) ||
      representation->ComputeInteractionState(at[0], at[1]) == vtkBigusSliceRepresentation::Outside)
  {
    return;
  }
  if (state != vtkBigusSliceRepresentation::Outside)
  {
    representation->SetInteractionState(state);
  }
  this->WidgetState = Active;
  this->GrabFocus(this->EventCallbackCommand);
  double position[2] = {static_cast<double>(at[0]), static_cast<double>(at[1])};
  representation->StartWidgetInteraction(position);
  representation->Highlight(1);
  this->EventCallbackCommand->SetAbortFlag(1);
  this->StartInteraction();
  this->InvokeEvent(vtkCommand::StartInteractionEvent, nullptr);
  this->Render();
}

void vtkBigusSliceWidget::SelectAction(vtkAbstractWidget* widget)
{
  auto* self = static_cast<vtkBigusSliceWidget*>(widget);
  self->Start(self->Interactor->GetShiftKey() ? vtkBigusSliceRepresentation::Translating
                                              : vtkBigusSliceRepresentation::Outside);
}

void vtkBigusSliceWidget::TranslateAction(vtkAbstractWidget* widget)
{
  static_cast<vtkBigusSliceWidget*>(widget)->Start(vtkBigusSliceRepresentation::Translating);
}

void vtkBigusSliceWidget::WindowLevelAction(vtkAbstractWidget* widget)
{
  static_cast<vtkBigusSliceWidget*>(widget)->Start(vtkBigusSliceRepresentation::WindowLevel);
}

void vtkBigusSliceWidget::Hover(int X, int Y)
{
  using Representation = vtkBigusSliceRepresentation;
  const int before = this->WidgetRep->GetInteractionState();
  const int state = this->WidgetRep->ComputeInteractionState(X, Y);
  if (state == before)
  {
    return;
  }
  const bool changed = state == Representation::Outside   ? this->RequestCursorShape(VTK_CURSOR_DEFAULT)
                       : state == Representation::Pushing ? this->RequestCursorShape(VTK_CURSOR_SIZENS)
                                                          : this->RequestCursorShape(VTK_CURSOR_HAND);
  if (changed)
  {
    this->Render();
  }
}

void vtkBigusSliceWidget::MoveAction(vtkAbstractWidget* widget)
{
  auto* self = static_cast<vtkBigusSliceWidget*>(widget);
  const int* at = self->Interactor->GetEventPosition();
  if (self->WidgetState == Waiting)
  {
    self->Hover(at[0], at[1]);
    return;
  }
  vtkBigusSliceRepresentation* representation = self->GetSliceRepresentation();
  const auto start = std::chrono::steady_clock::now();
  double position[2] = {static_cast<double>(at[0]), static_cast<double>(at[1])};
  representation->SetMoving(representation->GetInteractionState() != vtkBigusSliceRepresentation::WindowLevel);
  representation->WidgetInteraction(position);
  self->EventCallbackCommand->SetAbortFlag(1);
  self->InvokeEvent(vtkCommand::InteractionEvent, nullptr);
  self->Render();
  self->PictureSeconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  self->ResliceSeconds = representation->GetSliceProp()->GetResliceSeconds();
  representation->SetPictureSeconds(self->PictureSeconds);
  self->StopTimer();
  self->Timer = self->Interactor->CreateOneShotTimer(self->RestMilliseconds);
}

void vtkBigusSliceWidget::EndSelectAction(vtkAbstractWidget* widget)
{
  auto* self = static_cast<vtkBigusSliceWidget*>(widget);
  if (self->WidgetState == Waiting)
  {
    return;
  }
  self->WidgetState = Waiting;
  self->StopTimer();
  self->ReleaseFocus();
  const int* at = self->Interactor->GetEventPosition();
  double position[2] = {static_cast<double>(at[0]), static_cast<double>(at[1])};
  vtkBigusSliceRepresentation* representation = self->GetSliceRepresentation();
  representation->EndWidgetInteraction(position);
  representation->Highlight(0);
  representation->SetInteractionState(vtkBigusSliceRepresentation::Outside);
  self->EventCallbackCommand->SetAbortFlag(1);
  self->EndInteraction();
  self->InvokeEvent(vtkCommand::EndInteractionEvent, nullptr);
  self->Render();
}

void vtkBigusSliceWidget::StopTimer()
{
  if (this->Timer >= 0 && this->Interactor)
  {
    this->Interactor->DestroyTimer(this->Timer);
  }
  this->Timer = -1;
}

void vtkBigusSliceWidget::RestAction(vtkAbstractWidget* widget)
{
  auto* self = static_cast<vtkBigusSliceWidget*>(widget);
  const auto* timer = static_cast<const int*>(self->CallData);
  if (self->WidgetState == Active && timer && *timer == self->Timer)
  {
    self->Timer = -1;
    self->GetSliceRepresentation()->SetMoving(false);
    self->Render();
  }
}

//------------------------------------------------------------------------------
// Keys

bool vtkBigusSliceWidget::PressKey()
{
  vtkBigusSliceRepresentation* representation = this->GetSliceRepresentation();
  vtkBigusSliceProp* prop = representation->GetSliceProp();
  const char* symbol = this->Interactor->GetKeySym();
  const std::string key = symbol ? symbol : "";
  const bool vertical = key == "Up" || key == "Down";
  if (vertical || key == "Left" || key == "Right")
  {
    const double sign = key == "Up" || key == "Right" ? 1 : -1;
    if (this->Interactor->GetShiftKey())
    {
      double axis[3];
      ColumnOf(representation, vertical ? 0 : 1, axis);
      representation->Rotate(axis, sign * this->KeyAngle);
    }
    else if (this->Interactor->GetControlKey())
    {
      // Rows run downwards in an ultrasound picture.
      representation->Translate(vertical ? 0 : sign * this->KeyStep, vertical ? -sign * this->KeyStep : 0);
    }
    else
    {
      representation->Push(sign * this->KeyStep);
    }
  }
  else if (key == "x" || key == "y" || key == "z")
  {
    representation->AlignWithAxis(key[0] - 'x');
  }
  else if (key == "b")
  {
    prop->SetBeamVisibility(!prop->GetBeamVisibility());
  }
  else if (key == "g")
  {
    prop->SetCoverageVisibility(!prop->GetCoverageVisibility());
  }
  else if (key == "Home")
  {
    representation->ResetPlane();
  }
  else
  {
    return false;
  }
  return true;
}

void vtkBigusSliceWidget::KeyAction(vtkAbstractWidget* widget)
{
  auto* self = static_cast<vtkBigusSliceWidget*>(widget);
  if (self->WidgetState == Active)
  {
    return;
  }
  self->InvokeEvent(vtkCommand::StartInteractionEvent, nullptr);
  if (self->PressKey())
  {
    self->EventCallbackCommand->SetAbortFlag(1);
    self->InvokeEvent(vtkCommand::InteractionEvent, nullptr);
  }
  self->InvokeEvent(vtkCommand::EndInteractionEvent, nullptr);
  self->Render();
}
