// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusResliceCursorRepresentation
 * @brief   One view of a vtkResliceCursorWidget on a Gaussian field
 *
 * For multi-planar views: give it to a vtkResliceCursorWidget in place of vtkResliceCursorLineRepresentation, one a view,
 * and let the views share a vtkResliceCursor. Lines, picks and motions are VTK's. The picture is vtkBigusReslice's, at the
 * cursor's plane and exact at every moment.
 *
 * VTK's cursor wants an image, of which it takes bounds and spacing. PlaceCursor gives it one without pixels, over the
 * field's box. The picture has that spacing, in as many pixels as the plane is long, without padding to powers of two.
 * ThickMode is not followed: set the ElevationSigma of GetFieldReslice() instead.
 *
 * @sa vtkResliceCursorWidget vtkResliceCursor vtkBigusReslice
 */
#ifndef vtkBigusResliceCursorRepresentation_h
#define vtkBigusResliceCursorRepresentation_h

#include "vtkBigusRenderingModule.h"  // for the export macro
#include "vtkNew.h"
#include "vtkResliceCursorLineRepresentation.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkAlgorithmOutput;
class vtkPolyData;
class vtkResliceCursor;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif
class vtkBigusReslice;

class VTKBIGUSRENDERING_EXPORT vtkBigusResliceCursorRepresentation : public vtkResliceCursorLineRepresentation
{
public:
  static vtkBigusResliceCursorRepresentation* New();
  vtkTypeMacro(vtkBigusResliceCursorRepresentation, vtkResliceCursorLineRepresentation);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The field that is shown.
   */
  void SetInputData(vtkPolyData* field);
  void SetInputConnection(vtkAlgorithmOutput* field);
  ///@}

  /**
   * What renders the view. Its beam, tolerance, engine and output mode may be set; its geometry is the cursor's.
   */
  vtkBigusReslice* GetFieldReslice() { return this->FieldReslice; }

  /**
   * Shows the cursor's plane with this normal: 0 x, 1 y, 2 z of the cursor. Puts the cursor into the middle of the field's
   * box (see vtkBigusSliceProp::PlaceInField), with an image of that box whose longest side has `pixels` pixels and a
   * gap of 1/20 of that side where its lines meet, unless it has an image already. Updates the input.
   */
  void PlaceCursor(vtkResliceCursor* cursor, int normalAxis, int pixels);

protected:
  vtkBigusResliceCursorRepresentation();
  ~vtkBigusResliceCursorRepresentation() override;

  void SetResliceParameters(double spacingX, double spacingY, int extentX, int extentY) override;

  vtkNew<vtkBigusReslice> FieldReslice;

private:
  vtkBigusResliceCursorRepresentation(const vtkBigusResliceCursorRepresentation&) = delete;
  void operator=(const vtkBigusResliceCursorRepresentation&) = delete;
};

#endif
