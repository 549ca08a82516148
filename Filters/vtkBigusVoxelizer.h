// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusVoxelizer
 * @brief   Samples a Gaussian field on a regular grid
 *
 * The input is a field (see vtkBigusTrainer), the output a volume of it for everything that reads voxels. A
 * voxel holds the field at its centre
 *
 *     x = OutputOrigin + OutputDirection * (OutputSpacing * (i, j, k))      mm, the field's frame
 *
 * With ElevationSigma 0 (default) that is the field itself, the same whichever way the grid lies. With the
 * elevation profile of the probe every z slice of the grid is an image seen through the beam, as
 * vtkBigusReslice gives it.
 *
 * Output 1, filled when GenerateStandardErrorOutput is on, holds for each voxel how far the picture of a probe may be from
 * it whose plane is the voxel's z slice.
 *
 * What is not set is derived from the field's bounds, which hold every Gaussian to 3 standard deviations, but
 * for one in 1000 that reach farthest on each side: cubic voxels, MaximumDimension of them along the longest side. For that the input is updated when the
 * output information is asked for.
 *
 * @sa vtkBigusReslice
 */
#ifndef vtkBigusVoxelizer_h
#define vtkBigusVoxelizer_h

#include "vtkBigusFieldToImage.h"
#include "vtkBigusFiltersModule.h"  // for the export macro

class VTKBIGUSFILTERS_EXPORT vtkBigusVoxelizer : public vtkBigusFieldToImage
{
public:
  static vtkBigusVoxelizer* New();
  vtkTypeMacro(vtkBigusVoxelizer, vtkBigusFieldToImage);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * Number of voxels along each axis, at least 1. Default: automatic.
   */
  void SetOutputDimensions(int x, int y, int z);
  void SetOutputDimensions(const int dimensions[3]);
  vtkGetVector3Macro(OutputDimensions, int);
  void SetOutputDimensionsToDefault();
  ///@}

  ///@{
  /**
   * The grid's axes, a 3 x 3 matrix row by row whose columns are the x, y and z axes in the field's frame,
   * unit vectors, not all in one plane. Default: identity.
   */
  vtkSetVectorMacro(OutputDirection, double, 9);
  vtkGetVectorMacro(OutputDirection, double, 9);
  ///@}

  ///@{
  /**
   * Voxels along the longest side when the spacing is automatic, 2 to 4096, default 256.
   */
  vtkSetClampMacro(MaximumDimension, int, 2, 4096);
  vtkGetMacro(MaximumDimension, int);
  ///@}

protected:
  vtkBigusVoxelizer();
  ~vtkBigusVoxelizer() override = default;

  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  bigus::OutputGrid ComputeGrid(bigus::GivenGrid given) override;
  void ComputeIndexToWorld(const double spacing[3], const double origin[3], double matrix[16]) override;
  void AllocateOutputs(vtkInformationVector* outputs, const int extent[6]) override;

  int OutputDimensions[3] = {1, 1, 1};
  double OutputDirection[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  bool ComputeOutputDimensions = true;
  int MaximumDimension = 256;

private:
  vtkBigusVoxelizer(const vtkBigusVoxelizer&) = delete;
  void operator=(const vtkBigusVoxelizer&) = delete;
};

#endif
