// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusFieldLabeler
 * @brief   Labels drawn on tracked frames, carried by a Gaussian field to any plane
 *
 * Input 0 is a field, input 1 the sweep at the poses that the field was trained at, as vtkBigusTrainer takes it, and input 2
 * label pictures: an image of whole numbers from 0 (no label) to 255, one slice for each frame, or for those that the field
 * data `SourceFrame` of both images say. Without it, an image whose extent begins elsewhere than at 0 was cropped: it lies
 * where its extent says in the pictures of the sweep's file, and nothing is labelled outside. Where most pictures between
 * the first and the last that has a label have none, these are taken for frames that nobody drew on (KeepEmptyPictures).
 * `LabelNames`, `LabelValues` and `LabelColors` in the field data of input 2 name labels (Data/LabelData.h); others are
 * called "Label 3".
 *
 * The output is the field, with a point array `LabelWeight` of one component for each label: how much of it each Gaussian
 * has, 0 to 1. vtkBigusReslice and vtkBigusVoxelizer show labels where the field has them. Shapes and reflectivities stay
 * what they are, and so do slices.
 *
 * @sa vtkBigusReslice vtkBigusVoxelizer
 */
#ifndef vtkBigusFieldLabeler_h
#define vtkBigusFieldLabeler_h

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkPolyDataAlgorithm.h"

class VTKBIGUSFILTERS_EXPORT vtkBigusFieldLabeler : public vtkPolyDataAlgorithm
{
public:
  static vtkBigusFieldLabeler* New();
  vtkTypeMacro(vtkBigusFieldLabeler, vtkPolyDataAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /** Whether an empty picture always says that its frame shows none of the labels. Default: off. */
  vtkSetMacro(KeepEmptyPictures, vtkTypeBool);
  vtkGetMacro(KeepEmptyPictures, vtkTypeBool);
  vtkBooleanMacro(KeepEmptyPictures, vtkTypeBool);
  ///@}

  ///@{
  /** What computes: "auto" (default), "cpu", "cpu-double", "reference", "cuda". */
  vtkSetStringMacro(Engine);
  vtkGetStringMacro(Engine);
  ///@}

protected:
  vtkBigusFieldLabeler();
  ~vtkBigusFieldLabeler() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  vtkTypeBool KeepEmptyPictures = 0;
  char* Engine = nullptr;

private:
  vtkBigusFieldLabeler(const vtkBigusFieldLabeler&) = delete;
  void operator=(const vtkBigusFieldLabeler&) = delete;
};

#endif
