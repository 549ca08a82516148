// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusSliceRepresentation
 * @brief   What vtkBigusSliceWidget draws and moves: a slice of a field, its normal and its middle
 *
 * The slice is a vtkBigusSliceProp, drawn by the representation, so it must not be added to the renderer as well. Every
 * motion changes the prop's Plane, in place: other views that share the matrix follow. The slice's rectangle moves with
 * its plane; it is turned about its middle.
 *
 * ComputeInteractionState tells what lies under the mouse: the ball in the middle, the arrow of the normal, the slice's
 * inner part, its margins (MarginSize of each side) or corners. What dragging then does is said in vtkBigusSliceWidget.
 * While a motion goes on the prop has a time budget, such that pictures follow at DesiredUpdateRate; at its end the slice
 * is exact.
 *
 * @sa vtkBigusSliceWidget vtkBigusSliceProp vtkImplicitPlaneRepresentation
 */
#ifndef vtkBigusSliceRepresentation_h
#define vtkBigusSliceRepresentation_h

#include "vtkBigusRenderingModule.h"  // for the export macro
#include "vtkNew.h"
#include "vtkWidgetRepresentation.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkActor;
class vtkConeSource;
class vtkLineSource;
class vtkProperty;
class vtkSphereSource;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif
class vtkBigusSliceProp;

class VTKBIGUSRENDERING_EXPORT vtkBigusSliceRepresentation : public vtkWidgetRepresentation
{
public:
  static vtkBigusSliceRepresentation* New();
  vtkTypeMacro(vtkBigusSliceRepresentation, vtkWidgetRepresentation);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The slice that is moved. Default: one of its own.
   */
  virtual void SetSliceProp(vtkBigusSliceProp* prop);
  vtkBigusSliceProp* GetSliceProp() { return this->SliceProp; }
  ///@}

  /** What the mouse is over, or what a motion does. */
  enum InteractionStateType
  {
    Outside = 0,
    Pushing,      ///< along the normal
    Translating,  ///< in the plane
    Rotating,     ///< about the middle, freely
    Tilting,      ///< about the axis through the middle along the margin that is held
    Spinning,     ///< about the normal
    WindowLevel   ///< brightness and contrast of the picture
  };

  ///@{
  /**
   * What the next motion does; the widget sets it.
   */
  vtkSetClampMacro(InteractionState, int, Outside, WindowLevel);
  ///@}

  ///@{
  /**
   * How near the mouse must be to the ball or the arrow to hold it, 1 to 100 pixels. Default: 7.
   */
  vtkSetClampMacro(Tolerance, int, 1, 100);
  vtkGetMacro(Tolerance, int);
  ///@}

  ///@{
  /**
   * Width of the margins as a share of the slice's sides, 0 to 0.5. Default: 0.08. With 0 there is neither tilting nor
   * spinning with the mouse.
   */
  vtkSetClampMacro(MarginSize, double, 0, 0.5);
  vtkGetMacro(MarginSize, double);
  ///@}

  ///@{
  /**
   * Pictures a second that are aimed at while the plane moves, 1 to 1000. Default: 30.
   */
  vtkSetClampMacro(DesiredUpdateRate, double, 1, 1000);
  vtkGetMacro(DesiredUpdateRate, double);
  ///@}

  ///@{
  /**
   * Whether the normal's arrow and the ball in the middle are drawn and can be held. Default: on.
   */
  vtkSetMacro(HandleVisibility, vtkTypeBool);
  vtkGetMacro(HandleVisibility, vtkTypeBool);
  vtkBooleanMacro(HandleVisibility, vtkTypeBool);
  ///@}

  ///@{
  /**
   * How the arrow and the ball are drawn, and how what is held. Default: light grey and green.
   */
  vtkGetObjectMacro(HandleProperty, vtkProperty);
  vtkGetObjectMacro(SelectedHandleProperty, vtkProperty);
  ///@}

  ///@{
  /**
   * Of the plane, in the field's frame: the middle of the slice's rectangle, mm, and the unit normal, column 0 x column 1.
   */
  void GetCenter(double center[3]);
  void GetNormal(double normal[3]);
  ///@}

  ///@{
  /**
   * Motions by number: along the normal (mm), in the plane along its columns and rows (mm), about a vector through the
   * middle (degrees, right-handed), and the plane at right angles to an axis of the field's frame (0 x, 1 y, 2 z) through
   * the middle as it is.
   */
  void Push(double distance);
  void Translate(double alongColumns, double alongRows);
  void Rotate(const double axis[3], double degrees);
  void AlignWithAxis(int axis);
  ///@}

  ///@{
  /**
   * Keeps the plane as it is, and puts the plane back to what was kept. The widget keeps it when it is first enabled.
   */
  void KeepPlane();
  void ResetPlane();
  ///@}

  /**
   * Puts the plane through the middle of bounds (mm), at right angles to z, over the field (see
   * vtkBigusSliceProp::PlaceInField, with 512 pixels). A plane that was set on the prop needs no PlaceWidget.
   */
  void PlaceWidget(double bounds[6]) override;

  ///@{
  /**
   * What VTK asks of a representation.
   */
  void BuildRepresentation() override;
  int ComputeInteractionState(int X, int Y, int modify = 0) override;
  void StartWidgetInteraction(double position[2]) override;
  void WidgetInteraction(double position[2]) override;
  void EndWidgetInteraction(double position[2]) override;
  void Highlight(int on) override;
  double* GetBounds() VTK_SIZEHINT(6) override;
  void GetActors(vtkPropCollection* props) override;
  void ReleaseGraphicsResources(vtkWindow* window) override;
  int RenderOpaqueGeometry(vtkViewport* viewport) override;
  int RenderTranslucentPolygonalGeometry(vtkViewport* viewport) override;
  vtkTypeBool HasTranslucentPolygonalGeometry() override;
  vtkMTimeType GetMTime() override;
  ///@}

  ///@{
  /**
   * Tells how long the last picture took altogether, s. What is left of 0.8 times a picture's time after all but the slice
   * is the slice's budget, at least a fifth. The widget calls it. Then: whether the next pictures are coarse (true) or exact.
   */
  void SetPictureSeconds(double seconds);
  void SetMoving(bool moving);
  bool GetMoving() { return this->Moving; }
  ///@}

protected:
  vtkBigusSliceRepresentation();
  ~vtkBigusSliceRepresentation() override;

  vtkBigusSliceProp* SliceProp = nullptr;
  int Tolerance = 7;
  double MarginSize = 0.08;
  double DesiredUpdateRate = 30;
  vtkTypeBool HandleVisibility = 1;
  vtkNew<vtkProperty> HandleProperty;
  vtkNew<vtkProperty> SelectedHandleProperty;

private:
  vtkBigusSliceRepresentation(const vtkBigusSliceRepresentation&) = delete;
  void operator=(const vtkBigusSliceRepresentation&) = delete;

  struct Geometry;
  Geometry GeometryOfSlice();
  void ChangeWindowLevel(const double position[2]);

  vtkNew<vtkSphereSource> Ball;
  vtkNew<vtkLineSource> Shaft;
  vtkNew<vtkConeSource> Tip;
  vtkNew<vtkActor> Handles[3];  // of the three
  double KeptPlane[16];
  bool Kept = false;
  bool Moving = false;
  double OtherSeconds = -1;  // of a picture, without the slice, as slow pictures have it; negative: not known yet
  double LastEventPosition[2] = {0, 0};
  double LastPick[3] = {0, 0, 0};  // where the mouse held the slice, mm
  double TiltAxis[3] = {1, 0, 0}, TiltArm[3] = {0, 1, 0};
  double OutlineColor[3] = {1, 1, 1};  // before it was highlighted
  bool Highlighted = false;
  double DrawnBounds[6];
};

#endif
