// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusFieldMapper
 * @brief   Draws the Gaussians of a field as ellipsoids
 *
 * The input is a field (see vtkBigusTrainer for its arrays). Give the mapper to a vtkActor. Every Gaussian is an
 * ellipsoid along its axes whose surface lies ScaleFactor standard deviations from its centre. Reflectivity r is coloured
 * by a table centred on zero, blue below and orange above, over [-ReflectivityRange, ReflectivityRange]; opacity is
 * |r| / ReflectivityRange, at most 1, so faint Gaussians do not hide strong ones. A lookup table that is set replaces
 * both, with its own range.
 *
 * vtkGlyph3DMapper draws the ellipsoids, one instance each. Level of detail keeps the window responsive. Gaussians are
 * sorted once by |r| times their cross-section, (s_x s_y s_z)^(2/3):
 *
 *     many triangles      only where a Gaussian of median size is large on the screen
 *     strongest first     when the window wants frames quickly (vtkRenderWindow::SetDesiredUpdateRate, which interactors
 *                         set while the mouse moves), only as many ellipsoids as fit into half the time that the actor
 *                         is given, beside as many points as fit into the other half. The times are measured
 *     points              far away, where a Gaussian of median size is smaller than PointsBelow pixels
 *     everything          when the window has time, as for a still picture
 *
 * Points are as large as the actor's property says (vtkProperty::SetPointSize, pixels).
 *
 * @sa vtkBigusFieldVolume vtkBigusFieldTensors vtkBigusSweepOutline
 */
#ifndef vtkBigusFieldMapper_h
#define vtkBigusFieldMapper_h

#include <memory>  // for what is drawn

#include "vtkBigusRenderingModule.h"  // for the export macro
#include "vtkMapper.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkPolyData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSRENDERING_EXPORT vtkBigusFieldMapper : public vtkMapper
{
public:
  static vtkBigusFieldMapper* New();
  vtkTypeMacro(vtkBigusFieldMapper, vtkMapper);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The field.
   */
  void SetInputData(vtkPolyData* field);
  vtkPolyData* GetInput();
  ///@}

  ///@{
  /**
   * How many standard deviations from a Gaussian's centre its surface is drawn, 0.01 to 100, default 1.
   */
  vtkSetClampMacro(ScaleFactor, double, 0.01, 100);
  vtkGetMacro(ScaleFactor, double);
  ///@}

  ///@{
  /**
   * |r| that has the full colour. 0 (default): the 95th percentile of |r| in the field. GetReflectivityRangeInUse says
   * which that is; it updates the input.
   */
  vtkSetClampMacro(ReflectivityRange, double, 0, VTK_DOUBLE_MAX);
  vtkGetMacro(ReflectivityRange, double);
  double GetReflectivityRangeInUse();
  ///@}

  ///@{
  /**
   * Whether opacity is |r| / ReflectivityRange (on, default) or 1. The actor's opacity multiplies either.
   */
  vtkSetMacro(OpacityByReflectivity, vtkTypeBool);
  vtkGetMacro(OpacityByReflectivity, vtkTypeBool);
  vtkBooleanMacro(OpacityByReflectivity, vtkTypeBool);
  ///@}

  ///@{
  /**
   * Whether fewer ellipsoids are drawn when the window wants frames quickly. Default on.
   */
  vtkSetMacro(LevelOfDetail, vtkTypeBool);
  vtkGetMacro(LevelOfDetail, vtkTypeBool);
  vtkBooleanMacro(LevelOfDetail, vtkTypeBool);
  ///@}

  ///@{
  /**
   * The most ellipsoids drawn, also in a still picture: the strongest. At least 1; default: all.
   */
  vtkSetClampMacro(MaximumNumberOfEllipsoids, vtkIdType, 1, VTK_ID_MAX);
  vtkGetMacro(MaximumNumberOfEllipsoids, vtkIdType);
  ///@}

  ///@{
  /**
   * All Gaussians are points where ScaleFactor standard deviations of the median Gaussian are fewer pixels than this, at
   * least 0, default 0.5. 0: never.
   */
  vtkSetClampMacro(PointsBelow, double, 0, VTK_DOUBLE_MAX);
  vtkGetMacro(PointsBelow, double);
  ///@}

  ///@{
  /**
   * What the last Render drew.
   */
  vtkGetMacro(NumberOfEllipsoidsDrawn, vtkIdType);
  vtkGetMacro(NumberOfPointsDrawn, vtkIdType);
  ///@}

  /** Holds every ellipsoid. */
  double* GetBounds() VTK_SIZEHINT(6) override;
  void GetBounds(double bounds[6]) override { this->vtkAbstractMapper3D::GetBounds(bounds); }

  void CreateDefaultLookupTable() override;
  bool HasOpaqueGeometry() override;
  bool HasTranslucentPolygonalGeometry() override;
  void Render(vtkRenderer* renderer, vtkActor* actor) override;
  void ReleaseGraphicsResources(vtkWindow* window) override;

protected:
  vtkBigusFieldMapper();
  ~vtkBigusFieldMapper() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;

  double ScaleFactor = 1;
  double ReflectivityRange = 0;
  vtkTypeBool OpacityByReflectivity = 1;
  vtkTypeBool LevelOfDetail = 1;
  vtkIdType MaximumNumberOfEllipsoids;
  double PointsBelow = 0.5;
  vtkIdType NumberOfEllipsoidsDrawn = 0;
  vtkIdType NumberOfPointsDrawn = 0;

private:
  vtkBigusFieldMapper(const vtkBigusFieldMapper&) = delete;
  void operator=(const vtkBigusFieldMapper&) = delete;

  bool UpdateField();
  void UpdateTable();
  double PixelsPerSigma(vtkRenderer* renderer, vtkActor* actor) const;
  void DrawEllipsoids(vtkRenderer* renderer, vtkActor* actor, double pixels, vtkIdType most, double seconds);
  void DrawPoints(vtkRenderer* renderer, vtkActor* actor, double seconds);

  struct Drawing;
  std::unique_ptr<Drawing> Drawn;
};

#endif
