// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusSweepOutline
 * @brief   Where a sweep's frames lie, and the probe's path, as lines, and its pixels at their places
 *
 * The input is a sweep (see vtkBigusTrainer for its arrays). Its pixels must be there.
 *
 * Output 0 holds the outline of every FrameStride-th usable frame, a closed line through the centres of its corner
 * pixels, mm, in the order (0, 0), (width - 1, 0), (width - 1, height - 1), (0, height - 1). Cell data: `Frame`, the
 * frame's index in the input's third axis, and `Timestamp` in seconds where the sweep has it.
 *
 * Output 1 holds the probe's path: one polyline through the middle of the first row of every usable frame, where images
 * of a probe begin. Point data: `Frame` and `Timestamp` as above. A sweep of one usable frame gives a single point
 * without a line.
 *
 * Output 2, filled when GeneratePixels is on, is a vtkStructuredGrid (x, y, frame) of the sweep's pixels. Its outside shows
 * the first and the last frame; a cut through it shows what was recorded there.
 *
 * @sa vtkBigusFieldMapper
 */
#ifndef vtkBigusSweepOutline_h
#define vtkBigusSweepOutline_h

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkPolyDataAlgorithm.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkAlgorithmOutput;
class vtkStructuredGrid;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSFILTERS_EXPORT vtkBigusSweepOutline : public vtkPolyDataAlgorithm
{
public:
  static vtkBigusSweepOutline* New();
  vtkTypeMacro(vtkBigusSweepOutline, vtkPolyDataAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * Outlines of every n-th usable frame, beginning with the first; at least 1, default 1. The last usable frame has an
   * outline whatever the stride. The path goes through all.
   */
  vtkSetClampMacro(FrameStride, int, 1, VTK_INT_MAX);
  vtkGetMacro(FrameStride, int);
  ///@}

  ///@{
  /**
   * Whether output 2 is filled: the pixels of the frames that have an outline, `Recorded`, each at its place, frame behind
   * frame. It takes 12 bytes and the pixel's own for each. Default: off.
   */
  vtkSetMacro(GeneratePixels, vtkTypeBool);
  vtkGetMacro(GeneratePixels, vtkTypeBool);
  vtkBooleanMacro(GeneratePixels, vtkTypeBool);
  vtkStructuredGrid* GetPixelsOutput();
  ///@}

  ///@{
  /**
   * The probe's path.
   */
  vtkAlgorithmOutput* GetPathOutputPort() { return this->GetOutputPort(1); }
  vtkPolyData* GetPathOutput();
  ///@}

protected:
  vtkBigusSweepOutline();
  ~vtkBigusSweepOutline() override = default;

  int FillInputPortInformation(int port, vtkInformation* info) override;
  int FillOutputPortInformation(int port, vtkInformation* info) override;
  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  int FrameStride = 1;
  vtkTypeBool GeneratePixels = 0;

private:
  vtkBigusSweepOutline(const vtkBigusSweepOutline&) = delete;
  void operator=(const vtkBigusSweepOutline&) = delete;
};

#endif
