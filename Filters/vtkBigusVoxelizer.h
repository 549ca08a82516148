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
 * What is not set is derived from the field's bounds, which hold every Gaussian to 3 standard deviations:
 * cubic voxels, MaximumDimension of them along the longest side. For that the input is updated when the
 * output information is asked for.
 *
 * @sa vtkBigusReslice
 */
#ifndef vtkBigusVoxelizer_h
#define vtkBigusVoxelizer_h

#include <memory>  // for the renderer

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkImageAlgorithm.h"

namespace bigus
{
class FieldRenderer;
}

class VTKBIGUSFILTERS_EXPORT vtkBigusVoxelizer : public vtkImageAlgorithm
{
public:
  static vtkBigusVoxelizer* New();
  vtkTypeMacro(vtkBigusVoxelizer, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * Distance between voxel centres along each axis of the grid, mm, 1e-6 to 1e6. Default: automatic.
   */
  void SetOutputSpacing(double x, double y, double z);
  void SetOutputSpacing(const double spacing[3]);
  vtkGetVector3Macro(OutputSpacing, double);
  void SetOutputSpacingToDefault();
  ///@}

  ///@{
  /**
   * Place of voxel (0, 0, 0), mm in the field's frame. Default: automatic.
   */
  void SetOutputOrigin(double x, double y, double z);
  void SetOutputOrigin(const double origin[3]);
  vtkGetVector3Macro(OutputOrigin, double);
  void SetOutputOriginToDefault();
  ///@}

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

  /** What a voxel holds. */
  enum
  {
    Intensity = 0,       ///< displayed grey I in [0, 1); 0 to 255 for 8-bit output
    ScatteringField = 1  ///< S before the transfer function: signed, linear in reflectivity
  };

  ///@{
  /**
   * What a voxel holds, default Intensity. ScatteringField needs float output.
   */
  vtkSetClampMacro(OutputMode, int, Intensity, ScatteringField);
  vtkGetMacro(OutputMode, int);
  void SetOutputModeToIntensity() { this->SetOutputMode(Intensity); }
  void SetOutputModeToScatteringField() { this->SetOutputMode(ScatteringField); }
  ///@}

  ///@{
  /**
   * VTK_FLOAT (default) or VTK_UNSIGNED_CHAR: round(255 I).
   */
  vtkSetMacro(OutputScalarType, int);
  vtkGetMacro(OutputScalarType, int);
  void SetOutputScalarTypeToFloat() { this->SetOutputScalarType(VTK_FLOAT); }
  void SetOutputScalarTypeToUnsignedChar() { this->SetOutputScalarType(VTK_UNSIGNED_CHAR); }
  ///@}

  ///@{
  /**
   * Standard deviation of the elevation profile, mm, across the grid's z slices. Default 0: the field itself.
   * Negative: the one the field was trained under.
   */
  vtkSetMacro(ElevationSigma, double);
  vtkGetMacro(ElevationSigma, double);
  ///@}

  ///@{
  /**
   * The most by which a voxel's intensity may be off because Gaussians too faint to matter are left out, 0 to
   * 1, default 1e-4. 0 evaluates every Gaussian at every voxel.
   */
  vtkSetMacro(Tolerance, double);
  vtkGetMacro(Tolerance, double);
  ///@}

  ///@{
  /**
   * The most voxels one update may ask for; more is an error before anything is allocated. Default 2^29 (2
   * GiB of float), at least 1. A larger output can be streamed.
   */
  vtkSetClampMacro(MaximumOutputPixels, vtkIdType, 1, VTK_ID_MAX);
  vtkGetMacro(MaximumOutputPixels, vtkIdType);
  ///@}

  ///@{
  /**
   * Which engine renders: "auto" (default), "cpu", "cpu-double", "reference", or the name of a plug-in.
   */
  vtkSetStringMacro(Engine);
  vtkGetStringMacro(Engine);
  ///@}

  /** What rendered the last output, for example "CPU (AVX2, 2 threads)"; empty before. */
  const char* GetDevice() const;

protected:
  vtkBigusVoxelizer();
  ~vtkBigusVoxelizer() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;
  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  double OutputSpacing[3] = {1, 1, 1};
  double OutputOrigin[3] = {0, 0, 0};
  int OutputDimensions[3] = {1, 1, 1};
  double OutputDirection[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  bool ComputeOutputSpacing = true;
  bool ComputeOutputOrigin = true;
  bool ComputeOutputDimensions = true;
  int MaximumDimension = 256;
  int OutputMode = Intensity;
  int OutputScalarType = VTK_FLOAT;
  double ElevationSigma = 0;
  double Tolerance = 1e-4;
  vtkIdType MaximumOutputPixels = vtkIdType(1) << 29;
  char* Engine = nullptr;

private:
  vtkBigusVoxelizer(const vtkBigusVoxelizer&) = delete;
  void operator=(const vtkBigusVoxelizer&) = delete;

  std::unique_ptr<bigus::FieldRenderer> Renderer;
};

#endif
