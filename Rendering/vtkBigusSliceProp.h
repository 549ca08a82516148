// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusSliceProp
 * @brief   A slice of a Gaussian field in a 3-D scene, at the plane that it shows
 *
 * The input is a field: a vtkPolyData whose points are Gaussians (see vtkBigusTrainer). The prop holds a
 * vtkBigusReslice and a matrix, the Plane, that both places the plane to render and its picture. Whoever changes the
 * matrix moves the slice and what it shows. A place (x, y, 0) on the slice lies at Plane (x, y, 0, 1), mm, in the field's
 * frame. Pixel (i, j) is at (x, y) = SliceOrigin + SliceSpacing (i, j).
 *
 * It is a vtkImageSlice: GetProperty() has the picture's window, level, colour map (LookupTable), opacity and
 * interpolation, and pickers and vtkInteractorStyleImage find it. What the sweep never saw is greyed. The outline of the
 * slice and the probe's beam, as a translucent slab about the plane, can be shown beside it. Another vtkImageSlice whose
 * UserMatrix is the prop's moves with the plane.
 *
 * With a TimeBudget the picture is rendered more coarsely, so that it follows a plane that moves. Without one (default)
 * it is exact: bit for bit what vtkBigusReslice gives.
 *
 * @sa vtkBigusReslice vtkBigusSliceWidget vtkImageSlice
 */
#ifndef vtkBigusSliceProp_h
#define vtkBigusSliceProp_h

#include <memory>  // for what is known of the field

#include "vtkBigusRenderingModule.h"  // for the export macro
#include "vtkImageSlice.h"
#include "vtkNew.h"
#include "vtkTimeStamp.h"  // for SliceTime

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkActor;
class vtkAlgorithmOutput;
class vtkLookupTable;
class vtkMatrix4x4;
class vtkPolyData;
class vtkProperty;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif
class vtkBigusReslice;

class VTKBIGUSRENDERING_EXPORT vtkBigusSliceProp : public vtkImageSlice
{
public:
  static vtkBigusSliceProp* New();
  vtkTypeMacro(vtkBigusSliceProp, vtkImageSlice);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The field. Without one nothing is drawn.
   */
  void SetInputData(vtkPolyData* field);
  void SetInputConnection(vtkAlgorithmOutput* field);
  ///@}

  /**
   * What renders the slice. Its OutputMode, ElevationSigma, Tolerance, Engine and so on may be set; its axes and output
   * geometry belong to the prop, which sets them when it updates. Default: a float picture in [0, 1].
   */
  vtkBigusReslice* GetReslice() { return this->Reslice; }

  ///@{
  /**
   * The plane's pose: columns 0 and 1 are the directions of x and y on the slice, column 3 is its point (0, 0), mm. By
   * reference: a change to the matrix moves the slice at the next rendering. Default: the identity, of the prop's own.
   */
  void SetPlane(vtkMatrix4x4* plane);
  vtkMatrix4x4* GetPlane() { return this->Plane; }
  ///@}

  ///@{
  /**
   * Columns and rows of the exact slice, each at least 1. Default: 512, 512.
   */
  void SetSliceSize(int width, int height);
  vtkGetVector2Macro(SliceSize, int);
  ///@}

  ///@{
  /**
   * Distance between columns and between rows, in units of the columns of Plane, above 0. Default: 1, 1.
   */
  void SetSliceSpacing(double x, double y);
  vtkGetVector2Macro(SliceSpacing, double);
  ///@}

  ///@{
  /**
   * Place of pixel (0, 0) on the plane, in units of the columns of Plane. Default: 0, 0.
   */
  void SetSliceOrigin(double x, double y);
  vtkGetVector2Macro(SliceOrigin, double);
  ///@}

  /**
   * Shows a tracked frame's plane: pixel (i, j) lies at `imageToReference` (i, j, 0, 1), mm. Plane is the matrix, by
   * reference; spacing 1, origin 0.
   */
  void SetPlaneToFrame(vtkMatrix4x4* imageToReference, int width, int height);

  /**
   * Puts the plane through the middle of the field, at right angles to `normalAxis` (0 x, 1 y, 2 z) of its frame, with
   * square pixels, `pixels` along its longer side, over the field's box: that of the Gaussians' centres, padded by their
   * mean scale. The plane's point (0, 0) is the slice's middle. The columns run along y for the normal x, along x for the
   * others; rows along z, z and y. Plane is written into. Updates the input.
   */
  void PlaceInField(int normalAxis, int pixels);

  ///@{
  /**
   * Whether what the sweep never saw is greyed: pixels whose coverage is below CoverageThreshold times the field's mean
   * coverage, which is the sum of (2 pi)^(3/2) times the product of the scales, divided by the volume of the field's box
   * (see PlaceInField). From there the grey grows to CoverageOpacity (0 to 1) where the coverage is 0. Default: on, threshold 0.1,
   * opacity 0.6, colour (0.45, 0.45, 0.5).
   */
  void SetCoverageVisibility(vtkTypeBool visible);
  vtkTypeBool GetCoverageVisibility();
  vtkBooleanMacro(CoverageVisibility, vtkTypeBool);
  vtkSetClampMacro(CoverageThreshold, double, 0, VTK_DOUBLE_MAX);
  vtkGetMacro(CoverageThreshold, double);
  vtkSetClampMacro(CoverageOpacity, double, 0, 1);
  vtkGetMacro(CoverageOpacity, double);
  vtkSetVector3Macro(CoverageColor, double);
  vtkGetVector3Macro(CoverageColor, double);
  ///@}

  ///@{
  /**
   * Whether the outline of the slice, along the outer border of its pixels, is drawn, and how. Default: on, white.
   */
  vtkSetMacro(OutlineVisibility, vtkTypeBool);
  vtkGetMacro(OutlineVisibility, vtkTypeBool);
  vtkBooleanMacro(OutlineVisibility, vtkTypeBool);
  vtkProperty* GetOutlineProperty();
  ///@}

  ///@{
  /**
   * Whether the beam that the slice is seen through is drawn as a slab about the plane, and how. The slab ends where the
   * elevation profile has fallen to half its peak, 1.177 standard deviations on either side. Default: off, light blue, 0.25
   * opaque.
   */
  vtkSetMacro(BeamVisibility, vtkTypeBool);
  vtkGetMacro(BeamVisibility, vtkTypeBool);
  vtkBooleanMacro(BeamVisibility, vtkTypeBool);
  vtkProperty* GetBeamProperty();
  ///@}

  /**
   * The field's box, x0, x1, y0, y1, z0, z1, mm; false without Gaussians. Updates the input.
   */
  bool GetFieldBox(double box[6]);

  /**
   * Standard deviation, mm, of the beam that the slice is seen through: the reslice's ElevationSigma, or where that is
   * negative the field's at this plane. Updates the input.
   */
  double GetBeamSigma();

  ///@{
  /**
   * Seconds that one rendering of the slice may take. 0 (default): as long as the exact one takes. With a budget the
   * Tolerance is at least InteractiveTolerance (default 1/255, one grey level of 255; 0 to 1) and pixels are as much
   * larger as the time of the last slices asks for, up to 8 times.
   */
  vtkSetClampMacro(TimeBudget, double, 0, VTK_DOUBLE_MAX);
  vtkGetMacro(TimeBudget, double);
  vtkSetClampMacro(InteractiveTolerance, double, 0, 1);
  vtkGetMacro(InteractiveTolerance, double);
  ///@}

  ///@{
  /**
   * Of the last slice: how many times larger than SliceSpacing its pixels are (1: exact), and the seconds it took.
   */
  vtkGetMacro(Reduction, double);
  vtkGetMacro(ResliceSeconds, double);
  ///@}

  /**
   * Renders the slice unless it is up to date. Drawing the prop does it, too. GetReslice()->GetOutput() is then what is
   * shown.
   */
  void UpdateSlice();

  double* GetBounds() VTK_SIZEHINT(6) override;
  using vtkProp3D::GetBounds;
  int RenderOpaqueGeometry(vtkViewport* viewport) override;
  int RenderTranslucentPolygonalGeometry(vtkViewport* viewport) override;
  vtkTypeBool HasTranslucentPolygonalGeometry() override;
  void ReleaseGraphicsResources(vtkWindow* window) override;
  vtkMTimeType GetMTime() override;

protected:
  vtkBigusSliceProp();
  ~vtkBigusSliceProp() override;

  vtkNew<vtkBigusReslice> Reslice;
  vtkMatrix4x4* Plane = nullptr;
  int SliceSize[2] = {512, 512};
  double SliceSpacing[2] = {1, 1};
  double SliceOrigin[2] = {0, 0};
  double CoverageThreshold = 0.1;
  double CoverageOpacity = 0.6;
  double CoverageColor[3] = {0.45, 0.45, 0.5};
  vtkTypeBool OutlineVisibility = 1;
  vtkTypeBool BeamVisibility = 0;
  double TimeBudget = 0;
  double InteractiveTolerance = 1.0 / 255;
  double Reduction = 1;
  double ResliceSeconds = 0;

private:
  vtkBigusSliceProp(const vtkBigusSliceProp&) = delete;
  void operator=(const vtkBigusSliceProp&) = delete;

  struct Known;
  struct Made;
  const Known& KnownOfField();
  bool HasField();
  double NextReduction() const;
  int RenderLayers(vtkViewport* viewport);
  void SetResliceGeometry();
  void UpdateOverlay();
  void UpdateShapes();

  vtkNew<vtkImageSlice> Coverage;
  vtkNew<vtkLookupTable> CoverageTable;
  vtkNew<vtkActor> Outline;
  vtkNew<vtkActor> Beam;
  vtkNew<vtkPolyData> OutlineShape;
  vtkNew<vtkPolyData> BeamShape;
  double ExactTolerance = -1;  // the reslice's, kept while a larger one is in use; negative: none is
  vtkTimeStamp SliceTime;      // when the last slice was rendered
  std::unique_ptr<Known> FieldKnown;
  std::unique_ptr<Made> Drawn;
};

#endif
