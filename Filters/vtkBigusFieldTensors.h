// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusFieldTensors
 * @brief   Gives a field the tensors that VTK's and ParaView's glyph filters ask for
 *
 * The input is a field (see vtkBigusTrainer for its arrays). The output is the same field with one more point array of 9
 * components, row by row, which is the active tensors. With R the rotation matrix of a Gaussian and s its scales it is
 *
 *     StandardDeviation   R diag(s)   R^T, mm    the symmetric square root of the covariance
 *     Covariance          R diag(s^2) R^T, mm^2
 *
 * Eigenvectors of both are the Gaussian's axes. vtkTensorGlyph stretches its source by the eigenvalues, so with
 * StandardDeviation and a sphere of radius 1 it draws the surface at one standard deviation.
 *
 * @sa vtkBigusFieldMapper vtkTensorGlyph
 */
#ifndef vtkBigusFieldTensors_h
#define vtkBigusFieldTensors_h

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkPolyDataAlgorithm.h"

class VTKBIGUSFILTERS_EXPORT vtkBigusFieldTensors : public vtkPolyDataAlgorithm
{
public:
  static vtkBigusFieldTensors* New();
  vtkTypeMacro(vtkBigusFieldTensors, vtkPolyDataAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  /** What the tensors are; also the name of the array. */
  enum
  {
    StandardDeviation = 0,
    Covariance = 1
  };

  ///@{
  /**
   * What the tensors are, default StandardDeviation.
   */
  vtkSetClampMacro(Tensor, int, StandardDeviation, Covariance);
  vtkGetMacro(Tensor, int);
  void SetTensorToStandardDeviation() { this->SetTensor(StandardDeviation); }
  void SetTensorToCovariance() { this->SetTensor(Covariance); }
  const char* GetTensorAsString();
  ///@}

protected:
  vtkBigusFieldTensors() = default;
  ~vtkBigusFieldTensors() override = default;

  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  int Tensor = StandardDeviation;

private:
  vtkBigusFieldTensors(const vtkBigusFieldTensors&) = delete;
  void operator=(const vtkBigusFieldTensors&) = delete;
};

#endif
