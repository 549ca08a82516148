// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusReslice
 * @brief   The ultrasound image that a Gaussian field predicts at any plane
 *
 * The input is a field: a vtkPolyData whose points are Gaussians (see vtkBigusTrainer for its arrays). The
 * output is what the probe would have shown with its image plane there: every pixel is the sum of all
 * Gaussians seen through the beam's elevation profile, passed through the transfer function of the display.
 * The plane is placed exactly as in vtkImageReslice, whose names are kept where the meaning is the same, so
 * this filter can stand in its place. For an output index (i, j, k)
 *
 *     x = ResliceTransform( ResliceAxes * (OutputOrigin + OutputSpacing * (i, j, k)) )
 *
 * is its place in the field's frame, mm. A 3-D output is a stack of planes, each seen through the beam on its
 * own.
 *
 * Output 0 is the image, output 1 the coverage (float): the summed weight of all footprints at the pixel with
 * reflectivity left out. It falls to 0 beside the probe's fan and before and behind the sweep, so a viewer can grey
 * that out. It does not tell gaps between frames, because the trainer fills them. Output 2, filled when
 * GenerateStencilOutput is on, is a vtkImageStencilData of the pixels whose coverage exceeds CoverageThreshold.
 * Output 3, filled when RecordedFrames is set, tells gaps: it holds how far every pixel lies from the nearest frame.
 * Output 4, filled when GenerateStandardErrorOutput is on, tells how far a recorded frame there may be from the image; of a
 * slab it is that of its middle plane.
 * Output 5, filled when GenerateLabelOutput is on, tells which label each pixel has.
 *
 * Any part of the output may be asked for, whole or streamed: each pixel comes out with the same bits.
 * A plane that misses the field, and a field without Gaussians, give a background image. The uploaded field
 * is kept between updates, so moving the plane is cheap; it is uploaded again when the input changes.
 *
 * @sa vtkBigusVoxelizer vtkImageReslice
 */
#ifndef vtkBigusReslice_h
#define vtkBigusReslice_h

#include <memory>

#include "vtkBigusFieldToImage.h"
#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkMath.h"                // for ClampValue

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkAbstractImageInterpolator;
class vtkAbstractTransform;
class vtkAlgorithmOutput;
class vtkImageStencilData;
class vtkMatrix4x4;
class vtkPolyData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{
struct Seen;
}

class VTKBIGUSFILTERS_EXPORT vtkBigusReslice : public vtkBigusFieldToImage
{
public:
  static vtkBigusReslice* New();
  vtkTypeMacro(vtkBigusReslice, vtkBigusFieldToImage);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The plane's pose: columns 0 and 1 are the directions of the output's x and y axes, column 2 the direction
   * in which the slices of a 3-D output follow each other, column 3 their origin, mm. Null (default) is the
   * identity. The matrix is used by reference: a change to it is seen at the next update.
   */
  virtual void SetResliceAxes(vtkMatrix4x4* axes);
  vtkMatrix4x4* GetResliceAxes() const { return this->ResliceAxes; }
  ///@}

  ///@{
  /**
   * The first three columns of ResliceAxes: the x, y and z axes of the output in the field's frame. Makes the
   * matrix when there is none.
   */
  void SetResliceAxesDirectionCosines(double x0, double x1, double x2, double y0, double y1, double y2, double z0,
                                      double z1, double z2);
  void SetResliceAxesDirectionCosines(const double x[3], const double y[3], const double z[3]);
  void SetResliceAxesDirectionCosines(const double xyz[9]);
  void GetResliceAxesDirectionCosines(double x[3], double y[3], double z[3]);
  void GetResliceAxesDirectionCosines(double xyz[9]);
  ///@}

  ///@{
  /**
   * The last column of ResliceAxes: where the output's coordinate (0, 0, 0) lies in the field's frame, mm.
   * Makes the matrix when there is none.
   */
  void SetResliceAxesOrigin(double x, double y, double z);
  void SetResliceAxesOrigin(const double origin[3]);
  void GetResliceAxesOrigin(double origin[3]);
  ///@}

  ///@{
  /**
   * A transform from resliced coordinates to the field's frame, applied after ResliceAxes. Null (default) is
   * none. It must keep planes flat and evenly spaced (vtkTransform, vtkMatrixToLinearTransform, ...): with a
   * perspective or a nonlinear transform the update fails with an error.
   */
  virtual void SetResliceTransform(vtkAbstractTransform* transform);
  vtkAbstractTransform* GetResliceTransform() const { return this->ResliceTransform; }
  ///@}

  /**
   * Makes the output the image of a tracked frame: pixel (i, j) lies at `imageToReference` (i, j, 0, 1), mm in the field's
   * frame. Sets ResliceAxes to the matrix (by reference), OutputSpacing to 1, OutputOrigin to 0, OutputExtent to one slice
   * of `width` x `height` pixels and OutputDimensionality to 2.
   */
  void SetOutputToFrame(vtkMatrix4x4* imageToReference, int width, int height);

  ///@{
  /**
   * An image from which the default OutputSpacing, OutputOrigin and OutputExtent are derived, turned to the
   * output's axes as in vtkImageReslice. Null (default): a grid over the field's bounds stands in for it,
   * with cubic voxels, 256 along the longest side. The field's bounds hold every Gaussian to 3 standard
   * deviations, but for one in 1000 that reach farthest on each side. Using that grid updates the input when the output information is asked for.
   */
  virtual void SetInformationInput(vtkImageData* image);
  vtkImageData* GetInformationInput() const { return this->InformationInput; }
  ///@}

  ///@{
  /**
   * Whether default OutputSpacing, OutputOrigin and OutputExtent are turned to ResliceAxes (on, default) or are those of
   * InformationInput or of the grid over the field as they stand (off).
   */
  vtkSetMacro(TransformInputSampling, vtkTypeBool);
  vtkGetMacro(TransformInputSampling, vtkTypeBool);
  vtkBooleanMacro(TransformInputSampling, vtkTypeBool);
  ///@}

  ///@{
  /**
   * Whether a default OutputExtent and OutputOrigin hold all of InformationInput, or without one all of the field,
   * whichever way ResliceAxes and ResliceTransform turn. Default: off.
   */
  vtkSetMacro(AutoCropOutput, vtkTypeBool);
  vtkGetMacro(AutoCropOutput, vtkTypeBool);
  vtkBooleanMacro(AutoCropOutput, vtkTypeBool);
  ///@}

  ///@{
  /**
   * Thick slices: each slice of the output is joined from SlabNumberOfSlices parallel planes (1 to 4096, default 1), which
   * lie SlabSliceSpacingFraction (default 1) times the output's spacing along z apart, half of them on either side. Each
   * is seen through the beam. SlabMode is VTK_IMAGE_SLAB_MIN, MAX, MEAN (default) or SUM of what a pixel holds in them;
   * with SlabTrapezoidIntegration (default off) the first and last plane count half in MEAN and SUM. The coverage is the
   * largest of the planes'. One plane costs as much as a slice of its own: for a slice that is seen through a thicker
   * beam ElevationSigma costs nothing.
   */
  vtkSetClampMacro(SlabNumberOfSlices, int, 1, 4096);
  vtkGetMacro(SlabNumberOfSlices, int);
  vtkSetClampMacro(SlabMode, int, VTK_IMAGE_SLAB_MIN, VTK_IMAGE_SLAB_SUM);
  vtkGetMacro(SlabMode, int);
  void SetSlabModeToMin() { this->SetSlabMode(VTK_IMAGE_SLAB_MIN); }
  void SetSlabModeToMax() { this->SetSlabMode(VTK_IMAGE_SLAB_MAX); }
  void SetSlabModeToMean() { this->SetSlabMode(VTK_IMAGE_SLAB_MEAN); }
  void SetSlabModeToSum() { this->SetSlabMode(VTK_IMAGE_SLAB_SUM); }
  const char* GetSlabModeAsString();
  vtkSetMacro(SlabSliceSpacingFraction, double);
  vtkGetMacro(SlabSliceSpacingFraction, double);
  vtkSetMacro(SlabTrapezoidIntegration, vtkTypeBool);
  vtkGetMacro(SlabTrapezoidIntegration, vtkTypeBool);
  vtkBooleanMacro(SlabTrapezoidIntegration, vtkTypeBool);
  ///@}

  ///@{
  /**
   * First and last index along each axis. Default: from InformationInput.
   */
  virtual void SetOutputExtent(int x0, int x1, int y0, int y1, int z0, int z1);
  virtual void SetOutputExtent(const int extent[6]);
  vtkGetVector6Macro(OutputExtent, int);
  void SetOutputExtentToDefault();
  ///@}

  ///@{
  /**
   * Number of axes along which the output has an extent, 0 to 3, default 3. As in vtkImageReslice the
   * remaining ones get extent (0, 0) and origin 0: with 2 the output is the single slice at z = 0 of the
   * axes.
   */
  vtkSetClampMacro(OutputDimensionality, int, 0, 3);
  vtkGetMacro(OutputDimensionality, int);
  ///@}

  ///@{
  /**
   * A pixel counts as seen where its coverage exceeds this, at least 0, default 0. Pixels not seen get
   * BackgroundLevel and are left out of the stencil. At 0 the border lies where Tolerance ends the outermost
   * Gaussians; a few hundredths of a typical coverage give a border that means more.
   */
  vtkSetMacro(CoverageThreshold, double);
  vtkGetMacro(CoverageThreshold, double);
  ///@}

  ///@{
  /**
   * Value of pixels not seen, in units of the output scalars (0 to 255 for 8-bit output). Default 0.
   */
  vtkSetMacro(BackgroundLevel, double);
  vtkGetMacro(BackgroundLevel, double);
  ///@}

  ///@{
  /**
   * BackgroundLevel by the name for coloured images: the first component, because the image is grey.
   */
  void SetBackgroundColor(double grey, double, double, double) { this->SetBackgroundLevel(grey); }
  void SetBackgroundColor(const double color[4]) { this->SetBackgroundLevel(color[0]); }
  ///@}

  ///@{
  /**
   * Whether output 1 is filled, default on. Off saves some of the time; output 1 is then empty.
   */
  vtkSetMacro(GenerateCoverageOutput, vtkTypeBool);
  vtkGetMacro(GenerateCoverageOutput, vtkTypeBool);
  vtkBooleanMacro(GenerateCoverageOutput, vtkTypeBool);
  ///@}

  ///@{
  /**
   * Whether output 2, the stencil of seen pixels, is filled. Default off.
   */
  vtkSetMacro(GenerateStencilOutput, vtkTypeBool);
  vtkGetMacro(GenerateStencilOutput, vtkTypeBool);
  vtkBooleanMacro(GenerateStencilOutput, vtkTypeBool);
  ///@}

  ///@{
  /**
   * The sweep that the field was trained on, as vtkBigusTrainer takes it. Output 3 is then filled: a float for every
   * pixel, the distance to the nearest frame in mm. A frame counts as the whole rectangle of its pixels; rejected frames
   * do not count. Its pixels are not read. It costs 0.3 s of one thread for 400 x 300 pixels and 1,000 frames. Default:
   * none, and output 3 is empty.
   */
  virtual void SetRecordedFrames(vtkImageData* sweep);
  vtkImageData* GetRecordedFrames() const { return this->RecordedFrames; }
  ///@}

  ///@{
  /**
   * Whether output 5 is filled: an unsigned char for every pixel, the value of the label that has the largest share there,
   * or 0 where what has none is more. Names and colours are in its field data, as in the field (Data/LabelData.h). Of a slab
   * it is that of its middle plane. The field must have labels (vtkBigusFieldLabeler), and must be whole. Four labels
   * take one or two times as long as the image. Default off.
   */
  vtkSetMacro(GenerateLabelOutput, vtkTypeBool);
  vtkGetMacro(GenerateLabelOutput, vtkTypeBool);
  vtkBooleanMacro(GenerateLabelOutput, vtkTypeBool);
  ///@}

  ///@{
  /**
   * The coverage, float.
   */
  vtkAlgorithmOutput* GetCoverageOutputPort() { return this->GetOutputPort(1); }
  vtkImageData* GetCoverageOutput();
  ///@}

  ///@{
  /**
   * The stencil of seen pixels.
   */
  vtkAlgorithmOutput* GetStencilOutputPort() { return this->GetOutputPort(2); }
  vtkImageStencilData* GetStencilOutput();
  /** The object that the stencil is written into, as vtkImageReslice has it; null: one of the filter's own. */
  void SetStencilOutput(vtkImageStencilData* stencil);
  ///@}

  ///@{
  /**
   * The distance to the nearest recorded frame, float, mm.
   */
  vtkAlgorithmOutput* GetDistanceOutputPort() { return this->GetOutputPort(3); }
  vtkImageData* GetDistanceOutput();
  ///@}

  /**
   * The standard error of the mean intensity of the slices that output 4 is of, over pixels where `where` is not 0 (null:
   * all): an image of unsigned char of the same dimensions. It is more than that of as many pixels that are independent of
   * each other (Core/StandardError). Not a number where the training frames do not tell, and of fields of releases that did
   * not keep it. An error, and not a number, unless output 4 is filled and `where` fits it.
   */
  double GetStandardErrorOfMean(vtkImageData* where = nullptr);

  ///@{
  /**
   * The labels, unsigned char.
   */
  vtkAlgorithmOutput* GetLabelOutputPort() { return this->GetOutputPort(5); }
  vtkImageData* GetLabelOutput();
  ///@}

  ///@{
  /**
   * How vtkImageReslice reads between voxels and at the border of its volume. A field has a value at every point and no
   * border, so all of these give the same image and setting one does not make the filter run again. They are kept so that
   * code written for vtkImageReslice runs.
   */
  virtual void SetInterpolationMode(int mode)
  {
    this->InterpolationMode = vtkMath::ClampValue(mode, VTK_NEAREST_INTERPOLATION, VTK_CUBIC_INTERPOLATION);
  }
  vtkGetMacro(InterpolationMode, int);
  void SetInterpolationModeToNearestNeighbor() { this->SetInterpolationMode(VTK_NEAREST_INTERPOLATION); }
  void SetInterpolationModeToLinear() { this->SetInterpolationMode(VTK_LINEAR_INTERPOLATION); }
  void SetInterpolationModeToCubic() { this->SetInterpolationMode(VTK_CUBIC_INTERPOLATION); }
  const char* GetInterpolationModeAsString();
  void SetInterpolate(int linear) { this->SetInterpolationMode(linear ? VTK_LINEAR_INTERPOLATION : 0); }
  int GetInterpolate() { return this->InterpolationMode != VTK_NEAREST_INTERPOLATION; }
  void InterpolateOn() { this->SetInterpolate(1); }
  void InterpolateOff() { this->SetInterpolate(0); }
  virtual void SetBorder(vtkTypeBool border) { this->Border = border; }
  vtkGetMacro(Border, vtkTypeBool);
  vtkBooleanMacro(Border, vtkTypeBool);
  virtual void SetBorderThickness(double thickness) { this->BorderThickness = thickness; }
  vtkGetMacro(BorderThickness, double);
  virtual void SetOptimization(vtkTypeBool optimization) { this->Optimization = optimization; }
  vtkGetMacro(Optimization, vtkTypeBool);
  vtkBooleanMacro(Optimization, vtkTypeBool);
  ///@}

  ///@{
  /**
   * What a field cannot do. Each is an error that says what to use instead and changes nothing, unless it sets what is
   * the case anyway.
   */
  void SetWrap(vtkTypeBool wrap);
  vtkTypeBool GetWrap() { return 0; }
  void WrapOn() { this->SetWrap(1); }
  void WrapOff() { this->SetWrap(0); }
  void SetMirror(vtkTypeBool mirror);
  vtkTypeBool GetMirror() { return 0; }
  void MirrorOn() { this->SetMirror(1); }
  void MirrorOff() { this->SetMirror(0); }
  void SetInterpolator(vtkAbstractImageInterpolator* interpolator);
  vtkAbstractImageInterpolator* GetInterpolator() { return nullptr; }
  void SetScalarShift(double shift);
  double GetScalarShift() { return 0; }
  void SetScalarScale(double scale);
  double GetScalarScale() { return 1; }
  void SetStencilData(vtkImageStencilData* stencil);
  vtkImageStencilData* GetStencil() { return nullptr; }
  ///@}

  /**
   * How much of what the field knows of directions the last update's slice saw: 1 near a recorded frame, falling to 0 from
   * two to four steps between frames away, in angle or along the normal; the most of several slices. Negative where the
   * field knows nothing of directions.
   */
  double GetViewNearness() const { return this->NearnessOfView(); }

  /**
   * The mean coverage of the last update's field: of thin slices, averaged over the box of its Gaussians. Where slices are
   * shown, pixels with less than a tenth of it count as unseen. Where the field lies on several processes all must call this.
   */
  double GetMeanCoverage() const { return this->MeanOfCoverage(); }

  /** Follows ResliceAxes, ResliceTransform, InformationInput and RecordedFrames. */
  vtkMTimeType GetMTime() override;

protected:
  vtkBigusReslice();
  ~vtkBigusReslice() override;

  int FillOutputPortInformation(int port, vtkInformation* info) override;
  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  bigus::OutputGrid ComputeGrid(bigus::GivenGrid given) override;
  void ComputeIndexToWorld(const double spacing[3], const double origin[3], double matrix[16]) override;
  void AllocateOutputs(vtkInformationVector* outputs, const int extent[6]) override;
  bigus::Slab ComputeSlab() override;
  bool NeedsCoverage() override;
  bool SeesDirections() override { return true; }
  bool KeepsIntensities() override;
  void StoreBand(const bigus::PixelBand& band, vtkInformationVector* outputs) override;
  bool CompleteOutputs(const bigus::GridPart& grid, const std::function<bool(const int*, float*)>& render,
                       vtkInformationVector* outputs) override;

  vtkMatrix4x4* ResliceAxes = nullptr;
  vtkAbstractTransform* ResliceTransform = nullptr;
  vtkImageData* InformationInput = nullptr;
  vtkImageData* RecordedFrames = nullptr;
  int OutputExtent[6] = {0, 0, 0, 0, 0, 0};
  bool ComputeOutputExtent = true;
  int OutputDimensionality = 3;
  vtkTypeBool TransformInputSampling = 1;
  vtkTypeBool AutoCropOutput = 0;
  int SlabNumberOfSlices = 1;
  int SlabMode = VTK_IMAGE_SLAB_MEAN;
  double SlabSliceSpacingFraction = 1;
  vtkTypeBool SlabTrapezoidIntegration = 0;
  int InterpolationMode = VTK_NEAREST_INTERPOLATION;
  vtkTypeBool Border = 1;
  double BorderThickness = 0.5;
  vtkTypeBool Optimization = 1;
  double CoverageThreshold = 0;
  double BackgroundLevel = 0;
  vtkTypeBool GenerateCoverageOutput = 1;
  vtkTypeBool GenerateStencilOutput = 0;
  vtkTypeBool GenerateLabelOutput = 0;

private:
  vtkBigusReslice(const vtkBigusReslice&) = delete;
  void operator=(const vtkBigusReslice&) = delete;

  void Refuse(const char* what, const char* instead);
  bigus::Seen GetSeen() const;
  void FillDistance(vtkInformationVector* outputs, const int extent[6]);

  struct Recorded;
  std::unique_ptr<Recorded> Sweep;  // RecordedFrames as read last
};

#endif
