// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusSliceWidget
 * @brief   Moves a slice of a Gaussian field with mouse and keys; the picture follows
 *
 * An ordinary VTK widget: SetInteractor, give the representation its field, On. Buttons, as in vtkImagePlaneWidget and
 * vtkImplicitPlaneWidget2:
 *
 * - left on the slice pushes it along its normal; on a margin tilts it about the axis through its middle that runs along
 *   this margin; on a corner spins it about its normal; on the arrow turns it freely; on the ball moves it in its plane;
 * - middle, or shift and left, on the slice moves it in its plane;
 * - right on the slice changes window (to the right: wider) and level (upwards: higher).
 *
 * A slice that is seen from its front is pushed, and tilted, by moving the mouse up (away) and down. Keys:
 *
 * - Up and Right push the slice by KeyStep, Down and Left back;
 * - with Shift, Up and Down tilt it about its columns' direction, Right and Left about its rows', by KeyAngle;
 * - with Ctrl, the arrows move it in its plane by KeyStep;
 * - x, y and z put it at right angles to that axis of the field's frame;
 * - b shows and hides the probe's beam, g the grey over what the sweep never saw; Home puts the plane back.
 *
 * The event translator (GetEventTranslator()) changes all that. Events: StartInteractionEvent, InteractionEvent and
 * EndInteractionEvent; a key press invokes all three. While the mouse moves the slice the picture is rendered within a
 * time budget; it is exact after the button is released, after a key, and when the mouse rests for RestMilliseconds.
 *
 * @sa vtkBigusSliceRepresentation vtkImagePlaneWidget vtkImplicitPlaneWidget2
 */
#ifndef vtkBigusSliceWidget_h
#define vtkBigusSliceWidget_h

#include "vtkAbstractWidget.h"
#include "vtkBigusRenderingModule.h"  // for the export macro

class vtkBigusSliceRepresentation;

class VTKBIGUSRENDERING_EXPORT vtkBigusSliceWidget : public vtkAbstractWidget
{
public:
  static vtkBigusSliceWidget* New();
  vtkTypeMacro(vtkBigusSliceWidget, vtkAbstractWidget);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * What is drawn and moved; made when it is first needed.
   */
  void SetRepresentation(vtkBigusSliceRepresentation* representation);
  vtkBigusSliceRepresentation* GetSliceRepresentation();
  void CreateDefaultRepresentation() override;
  ///@}

  ///@{
  /**
   * How far one key press moves the slice, mm (above 0, default 0.5), and turns it, degrees (default 1).
   */
  vtkSetClampMacro(KeyStep, double, 1e-6, 1e6);
  vtkGetMacro(KeyStep, double);
  vtkSetClampMacro(KeyAngle, double, 1e-6, 180);
  vtkGetMacro(KeyAngle, double);
  ///@}

  ///@{
  /**
   * How long the mouse rests, with its button down, until the slice is rendered exactly, ms. Default: 250.
   */
  vtkSetClampMacro(RestMilliseconds, int, 1, 60000);
  vtkGetMacro(RestMilliseconds, int);
  ///@}

  ///@{
  /**
   * Of the last motion of the mouse, in seconds: from the event to the picture, and how much of that the slice took.
   */
  vtkGetMacro(PictureSeconds, double);
  vtkGetMacro(ResliceSeconds, double);
  ///@}

  void SetEnabled(int enabling) override;

protected:
  vtkBigusSliceWidget();
  ~vtkBigusSliceWidget() override = default;

  double KeyStep = 0.5;
  double KeyAngle = 1;
  int RestMilliseconds = 250;
  double PictureSeconds = 0;
  double ResliceSeconds = 0;

private:
  vtkBigusSliceWidget(const vtkBigusSliceWidget&) = delete;
  void operator=(const vtkBigusSliceWidget&) = delete;

  static void SelectAction(vtkAbstractWidget*);
  static void TranslateAction(vtkAbstractWidget*);
  static void WindowLevelAction(vtkAbstractWidget*);
  static void MoveAction(vtkAbstractWidget*);
  static void EndSelectAction(vtkAbstractWidget*);
  static void KeyAction(vtkAbstractWidget*);
  static void RestAction(vtkAbstractWidget*);
  void Start(int state);
  void Hover(int X, int Y);
  void StopTimer();
  bool PressKey();

  enum
  {
    Waiting,
    Active
  };
  int WidgetState = Waiting;
  int Timer = -1;
};

#endif
