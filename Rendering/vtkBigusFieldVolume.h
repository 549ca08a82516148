// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusFieldVolume
 * @brief   A field as a cloud of grey, by VTK's own volume rendering
 *
 * The input is a field (see vtkBigusTrainer for its arrays). The prop holds a vtkBigusVoxelizer, which makes 8-bit
 * intensities of it, and VTK's vtkSmartVolumeMapper, which draws them on the graphics card, or where there is none by
 * threads. Voxels, mapper and property may be set as with any vtkVolume.
 *
 * Which intensities are opaque comes from the field, because echo differs much between sweeps. With q(p) the p-th
 * quantile of all voxels above 0, opacity for a way of OpacityLength is
 *
 *     0 up to q(0.5),   0.08 at q(0.9),   0.5 at q(0.995),   0.8 at the largest
 *
 * so that half of the tissue is seen through, and reflectors stand out. Colours run from dark to light through the
 * same quantiles. OpacityLength is 1/100 of the volume's diagonal.
 *
 * @sa vtkBigusFieldMapper vtkBigusVoxelizer
 */
#ifndef vtkBigusFieldVolume_h
#define vtkBigusFieldVolume_h

#include "vtkBigusRenderingModule.h"  // for the export macro
#include "vtkNew.h"
#include "vtkVolume.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkAlgorithmOutput;
class vtkColorTransferFunction;
class vtkImageData;
class vtkPiecewiseFunction;
class vtkPolyData;
class vtkSmartVolumeMapper;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif
class vtkBigusVoxelizer;

class VTKBIGUSRENDERING_EXPORT vtkBigusFieldVolume : public vtkVolume
{
public:
  static vtkBigusFieldVolume* New();
  vtkTypeMacro(vtkBigusFieldVolume, vtkVolume);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The field. Without one nothing is drawn.
   */
  void SetInputData(vtkPolyData* field);
  void SetInputConnection(vtkAlgorithmOutput* field);
  ///@}

  /**
   * What makes the voxels. Default: cubic voxels along the field's axes, at most 160 along the longest side, 8 bits. Its
   * geometry may be set after CropToCentersOff.
   */
  vtkBigusVoxelizer* GetVoxelizer() { return this->Voxelizer; }

  ///@{
  /**
   * Whether the volume is the box of the Gaussians' centres and three median standard deviations more. On (default) it
   * sets the voxelizer's origin, spacing and dimensions. Off: whatever the voxelizer's are; its own box holds every
   * Gaussian whole, and a few large ones beside the tissue can make that many times as large.
   */
  vtkSetMacro(CropToCenters, vtkTypeBool);
  vtkGetMacro(CropToCenters, vtkTypeBool);
  vtkBooleanMacro(CropToCenters, vtkTypeBool);
  ///@}

  ///@{
  /**
   * Whether colours, opacity and opacity's length of the property follow the field's quantiles when the voxels change. On
   * (default) they replace what was set.
   */
  vtkSetMacro(AutomaticTransfer, vtkTypeBool);
  vtkGetMacro(AutomaticTransfer, vtkTypeBool);
  vtkBooleanMacro(AutomaticTransfer, vtkTypeBool);
  ///@}

  /**
   * Fills the two functions as above from a volume of one unsigned char a voxel; returns the length in mm that the
   * opacities hold for. A volume without voxels above 0 is transparent. For those who make the volume and its property
   * themselves.
   */
  static double FillTransfer(vtkImageData* volume, vtkPiecewiseFunction* opacity, vtkColorTransferFunction* color);

  /**
   * Makes the voxels and the transfer functions unless they are up to date. Drawing does it, too.
   */
  void UpdateVolume();

  double* GetBounds() VTK_SIZEHINT(6) override;
  using vtkProp3D::GetBounds;
  int RenderVolumetricGeometry(vtkViewport* viewport) override;

protected:
  vtkBigusFieldVolume();
  ~vtkBigusFieldVolume() override;

  vtkTypeBool AutomaticTransfer = 1;
  vtkTypeBool CropToCenters = 1;

private:
  vtkBigusFieldVolume(const vtkBigusFieldVolume&) = delete;
  void operator=(const vtkBigusFieldVolume&) = delete;

  void Crop();

  vtkNew<vtkBigusVoxelizer> Voxelizer;
  vtkNew<vtkSmartVolumeMapper> SmartMapper;
  vtkMTimeType VolumeTime = 0;  // of the voxels that the property was made for
  vtkMTimeType CropTime = 0;    // of the field that the box was made for
  int CropDimension = 0;        // and of its longest side
};

#endif
