// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusTransformField
 * @brief   Moves, turns, mirrors and scales a Gaussian field
 *
 * The input is a field (see vtkBigusTrainer for its arrays), the output the same field in other coordinates: points,
 * scales, rotations and the beam's thickness together. A slice of the output at Transform * T shows what a slice of the
 * input at T showed. vtkTransformPolyDataFilter moves points only, and gives a field whose Gaussians point elsewhere.
 *
 * The transform must be linear and stretch space alike in all directions, because the beam has one thickness; else the
 * update is an error. Arrays that are no part of a field are dropped. The provenance gets a line `transform`, the matrix
 * row by row.
 *
 * @sa vtkBigusReslice vtkTransform
 */
#ifndef vtkBigusTransformField_h
#define vtkBigusTransformField_h

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkPolyDataAlgorithm.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkAbstractTransform;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSFILTERS_EXPORT vtkBigusTransformField : public vtkPolyDataAlgorithm
{
public:
  static vtkBigusTransformField* New();
  vtkTypeMacro(vtkBigusTransformField, vtkPolyDataAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * From the input's coordinates to the output's, mm, for example a vtkTransform. Null (default) changes nothing. It is
   * used by reference: a change to it is seen at the next update.
   */
  virtual void SetTransform(vtkAbstractTransform* transform);
  vtkAbstractTransform* GetTransform() const { return this->Transform; }
  ///@}

  /** Follows Transform. */
  vtkMTimeType GetMTime() override;

protected:
  vtkBigusTransformField() = default;
  ~vtkBigusTransformField() override;

  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  vtkAbstractTransform* Transform = nullptr;

private:
  vtkBigusTransformField(const vtkBigusTransformField&) = delete;
  void operator=(const vtkBigusTransformField&) = delete;
};

#endif
