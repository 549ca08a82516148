// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusPartitionField
 * @brief   One process's part of a Gaussian field
 *
 * Input and output are fields (see vtkBigusTrainer). The field is split into NumberOfChunks chunks, dealt to NumberOfPieces
 * pieces; the output is piece number Piece. vtkBigusReslice and vtkBigusVoxelizer with a Controller render the pieces of
 * all its processes together. Their pictures have the same bits for any number of pieces.
 *
 * A chunk takes blocks of 256 consecutive Gaussians in turn, so that every piece has its share of the work on any slice.
 * The field data array `Chunks` says which chunks the part has. A piece beyond NumberOfChunks is empty.
 *
 * Behind a vtkBigusFieldReader of as many chunks this process reads its piece alone.
 *
 * @sa vtkBigusFieldToImage::SetController
 */
#ifndef vtkBigusPartitionField_h
#define vtkBigusPartitionField_h

#include "vtkBigusFiltersParallelModule.h"  // for the export macro
#include "vtkPolyDataAlgorithm.h"

class VTKBIGUSFILTERSPARALLEL_EXPORT vtkBigusPartitionField : public vtkPolyDataAlgorithm
{
public:
  static vtkBigusPartitionField* New();
  vtkTypeMacro(vtkBigusPartitionField, vtkPolyDataAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * Into how many chunks the field is split: a power of two from 1 to 4096, default 16. As many processes at most have
   * something to do, and pictures depend on it in their last bits.
   */
  vtkSetMacro(NumberOfChunks, int);
  vtkGetMacro(NumberOfChunks, int);
  ///@}

  ///@{
  /**
   * Of the pieces, as a rule the number of processes, 1 or more, default 1.
   */
  vtkSetMacro(NumberOfPieces, int);
  vtkGetMacro(NumberOfPieces, int);
  ///@}

  ///@{
  /**
   * Which piece the output is, as a rule the number of this process, from 0 on, default 0.
   */
  vtkSetMacro(Piece, int);
  vtkGetMacro(Piece, int);
  ///@}

protected:
  vtkBigusPartitionField() = default;
  ~vtkBigusPartitionField() override = default;

  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  int NumberOfChunks = 16;
  int NumberOfPieces = 1;
  int Piece = 0;
  bool IsInputAPart = false;  // the update in progress: the reader gives this piece alone

private:
  vtkBigusPartitionField(const vtkBigusPartitionField&) = delete;
  void operator=(const vtkBigusPartitionField&) = delete;
};

#endif
