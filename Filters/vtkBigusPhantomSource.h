// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusPhantomSource
 * @brief   A synthetic tracked ultrasound sweep, with the exact image of any other plane
 *
 * A world of sub-resolution scatterers (parenchyma, vessels, a cyst, a tumour, a bone with its bright
 * boundary and shadow) is seen by a probe with a complex point-spread function: axial carrier and Gaussian
 * envelope, Gaussian lateral and elevation profiles. Echoes add up coherently; the envelope is compressed to
 * 8 bits.
 *
 * The output is a sweep: a stack (column, row, frame) of unsigned char with origin 0 and spacing 1, and the
 * field data `ImageToReference` (16 components, row-major, one tuple a frame: pixel (i, j, 0, 1) to
 * millimetres as recorded by the tracker), `TrueImageToReference` (the same without the tracker's errors),
 * `Timestamp` (seconds) and, for convex and sector probes, `Mask` (0 = outside the fan). The whole sweep is
 * made, whatever part of it is asked for.
 *
 * ComputeTruth() gives the exact image of any plane: the very function that makes the frames.
 *
 * In the world, x points to the right, y into the body (the skin is y = 0) and z along an unrotated sweep,
 * whose middle is the origin; millimetres. The same seed gives the same bits for any number of threads. An
 * option out of range is reported when the source executes.
 */
#ifndef vtkBigusPhantomSource_h
#define vtkBigusPhantomSource_h

#include <memory>

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkImageAlgorithm.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkImageData;
class vtkMatrix4x4;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{
struct PhantomOptions;
}

// The property of a number, of Core/Phantom/PhantomOptionList.h.
// clang-format off
#define vtkBigusNumberOptionMacro(name, type)                                                \
  virtual void Set##name(type value) { this->SetNumber(#name, static_cast<double>(value)); } \
  virtual type Get##name() { return static_cast<type>(this->GetNumber(#name)); }
// clang-format on

class VTKBIGUSFILTERS_EXPORT vtkBigusPhantomSource : public vtkImageAlgorithm
{
public:
  static vtkBigusPhantomSource* New();
  vtkTypeMacro(vtkBigusPhantomSource, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  enum Probes
  {
    LINEAR = 0,
    CONVEX = 1,
    SECTOR = 2
  };

  enum Scenes
  {
    ORGAN = 0,
    SPECKLE = 1,
    POINTS = 2
  };

  ///@{
  /**
   * The shape of the image: LINEAR (parallel lines, everything lit), CONVEX (lines from an arc of large
   * radius) or SECTOR (lines from an arc of small radius). Default: LINEAR.
   */
  vtkSetClampMacro(Probe, int, LINEAR, SECTOR);
  vtkGetMacro(Probe, int);
  void SetProbeToLinear() { this->SetProbe(LINEAR); }
  void SetProbeToConvex() { this->SetProbe(CONVEX); }
  void SetProbeToSector() { this->SetProbe(SECTOR); }
  const char* GetProbeAsString();
  ///@}

  ///@{
  /**
   * What the probe looks at: ORGAN, SPECKLE (homogeneous parenchyma) or POINTS (point targets 10 mm apart in
   * empty space, at (10 a, 10 b + 5, 10 c) mm). Default: ORGAN.
   */
  vtkSetClampMacro(Scene, int, ORGAN, POINTS);
  vtkGetMacro(Scene, int);
  void SetSceneToOrgan() { this->SetScene(ORGAN); }
  void SetSceneToSpeckle() { this->SetScene(SPECKLE); }
  void SetSceneToPoints() { this->SetScene(POINTS); }
  const char* GetSceneAsString();
  ///@}

  /**
   * Places the scatterers, moves the hand and draws the tracker's errors; the anatomy stays. 0 to 2^53, as
   * vtkBigusTrainer's. Default: 1.
   */
  vtkBigusNumberOptionMacro(Seed, vtkTypeInt64);

  ///@{
  /**
   * Number of frames, 1 to 100000. Default: 64.
   */
  vtkSetMacro(NumberOfFrames, int);
  vtkGetMacro(NumberOfFrames, int);
  ///@}

  ///@{
  /**
   * Width and height of a frame in pixels, each 8 to 8192; a width of 0 means 256 for a linear probe and 384
   * for the others. Default: 0, 256.
   */
  vtkSetVector2Macro(FrameSize, int);
  vtkGetVector2Macro(FrameSize, int);
  ///@}

  /**
   * Side of a (square) pixel in mm, 0.01 to 5. Default: 0.2.
   */
  vtkBigusNumberOptionMacro(PixelSize, double);

  /**
   * Radius in mm of the arc from which the lines of a convex or sector probe start, 2 to 500; 0 means 25
   * (convex) or 4 (sector). Default: 0.
   */
  vtkBigusNumberOptionMacro(ProbeRadius, double);

  /**
   * Degrees to each side that a convex or sector probe reaches, 1 to 80; 0 means 32 (convex) or 44 (sector).
   * Default: 0.
   */
  vtkBigusNumberOptionMacro(HalfAngle, double);

  /**
   * Carrier frequency in MHz (at 1540 m/s), 0.5 to 50. Default: 5.
   */
  vtkBigusNumberOptionMacro(Frequency, double);

  ///@{
  /**
   * Standard deviations in mm of the two-way amplitude point-spread function along the beam and across it (in
   * the plane), the same at every depth; each 0.02 to 5. Default: 0.2 and 0.4.
   */
  vtkBigusNumberOptionMacro(AxialSigma, double);
  vtkBigusNumberOptionMacro(LateralSigma, double);
  ///@}

  /**
   * The known slice thickness: standard deviation in mm of the two-way amplitude profile out of plane, the
   * same at every depth; 0.05 to 10. A point target's envelope fades as exp(-z^2 / (2 ElevationSigma^2)) when
   * the plane moves z away. Default: 0.8.
   */
  vtkBigusNumberOptionMacro(ElevationSigma, double);

  /**
   * Scatterers in a cubic millimetre of parenchyma, 1 to 1000. Fully developed speckle needs 10 or more in a
   * resolution cell of (2 pi)^(3/2) AxialSigma LateralSigma ElevationSigma. Default: 40.
   */
  vtkBigusNumberOptionMacro(ScattererDensity, double);

  /**
   * Attenuation of parenchyma in dB / (cm MHz), one way, 0 to 3. Time gain compensates parenchyma exactly, so
   * fluid brightens what lies behind it. Default: 0.5.
   */
  vtkBigusNumberOptionMacro(Attenuation, double);

  /**
   * Decibels between black and white, 10 to 120. Default: 50.
   */
  vtkBigusNumberOptionMacro(DynamicRange, double);

  /**
   * The echo shown white, in dB above the root-mean-square echo of parenchyma, -40 to 100. Default: 24.
   */
  vtkBigusNumberOptionMacro(WhiteLevel, double);

  /**
   * Mean travel between frames in mm, 0 to 20. Default: 0.5.
   */
  vtkBigusNumberOptionMacro(FrameSpacing, double);

  /**
   * Uneven speed: the spacing varies smoothly by at most this share of its mean, 0 to 0.95. Default: 0.4.
   */
  vtkBigusNumberOptionMacro(SpeedVariation, double);

  ///@{
  /**
   * Freehand motion: bound in degrees (0 to 45) within which each of the probe's three angles wanders, and
   * bound in mm (0 to 20) within which it wanders sideways and in depth. Default: 3 and 0.5.
   */
  vtkBigusNumberOptionMacro(Tilt, double);
  vtkBigusNumberOptionMacro(Wander, double);
  ///@}

  /**
   * Turns probe and travel about the depth axis, in degrees, -360 to 360. Two sources that differ only in
   * this make crossing sweeps of one world. Default: 0.
   */
  vtkBigusNumberOptionMacro(SweepAngle, double);

  ///@{
  /**
   * The probe itself shakes about its path: standard deviations of its position in mm (0 to 10) and of its angles in
   * degrees (0 to 20), for each axis, about the middle of the image's first row; frames show it. ShakeCorrelation, in
   * pictures (0 to 1000), is as NoiseCorrelation. Default: 0, 0 and 0.
   */
  vtkBigusNumberOptionMacro(Shake, double);
  vtkBigusNumberOptionMacro(ShakeRotation, double);
  vtkBigusNumberOptionMacro(ShakeCorrelation, double);
  ///@}

  /**
   * Frames a second, 0.1 to 10000; sets the timestamps. Default: 20.
   */
  vtkBigusNumberOptionMacro(FrameRate, double);

  /**
   * How often the hand goes over its path, there and back, 1 to 100; with several it slows down where it turns round.
   * Default: 1.
   */
  vtkBigusNumberOptionMacro(Passes, int);

  /**
   * Share of the pictures taken that are lost, 0 to 0.9. NumberOfFrames are kept, and the timestamps show the gaps.
   * Default: 0.
   */
  vtkBigusNumberOptionMacro(DroppedShare, double);

  ///@{
  /**
   * Tracking noise: standard deviations of the recorded position in mm (0 to 10) and rotation in degrees (0
   * to 20), for each axis, about the middle of the image's first row. Frames stay where they truly were.
   * Default: 0 and 0.
   */
  vtkBigusNumberOptionMacro(TrackingNoise, double);
  vtkBigusNumberOptionMacro(TrackingRotationNoise, double);
  /** In frames (0 to 1000): noise of frames so far apart is correlated by 1/e; 0 (default): each frame errs by itself. */
  vtkBigusNumberOptionMacro(NoiseCorrelation, double);
  ///@}

  ///@{
  /**
   * Drift of the tracker: the recorded position wanders within this bound in mm (0 to 100) on each axis, the rotation
   * in degrees (0 to 20), more slowly than a sweep takes. Default: 0 and 0.
   */
  vtkBigusNumberOptionMacro(TrackingDrift, double);
  vtkBigusNumberOptionMacro(TrackingRotationDrift, double);
  ///@}

  ///@{
  /**
   * Outliers of the tracker: this share of the frames (0 to 0.5) is recorded OutlierSize mm (0 to 100) away, in any
   * direction. Default: 0 and 2.
   */
  vtkBigusNumberOptionMacro(OutlierShare, double);
  vtkBigusNumberOptionMacro(OutlierSize, double);
  ///@}

  /**
   * A frame is given the pose of so many seconds (-1 to 1) before it was taken. Default: 0.
   */
  vtkBigusNumberOptionMacro(TrackingDelay, double);

  ///@{
  /**
   * Recorded positions are rounded to multiples of so many mm (0 to 10), the components of the rotation vector to
   * multiples of so many degrees (0 to 20); 0 does not round. Default: 0 and 0.
   */
  vtkBigusNumberOptionMacro(TrackingQuantum, double);
  vtkBigusNumberOptionMacro(TrackingRotationQuantum, double);
  ///@}

  ///@{
  /**
   * Error of the image-to-probe calibration, the same in every frame: a shift in mm (each -100 to 100) along the
   * image's rows, down and along its normal, and a rotation about the image's centre in degrees (axis times angle, each
   * -45 to 45) in the same axes. Default: 0, 0, 0 and 0, 0, 0.
   */
  vtkSetVector3Macro(CalibrationShift, double);
  vtkGetVector3Macro(CalibrationShift, double);
  vtkSetVector3Macro(CalibrationRotation, double);
  vtkGetVector3Macro(CalibrationRotation, double);
  ///@}

  /**
   * Mean number of scatterers of parenchyma in a resolution cell; see ScattererDensity. Reports an error and returns 0
   * when an option is out of range.
   */
  double GetScatterersPerResolutionCell();

  /**
   * Writes into `truth` the exact image of the plane whose pixel (i, j) lies at `imageToReference` (i, j, 0, 1),
   * in mm: one frame in the form of the output (a sweep of one, with its pose and mask). The columns of
   * the matrix must be orthogonal: the second is the direction of the beams, and the probe's face is centred
   * on the first row. A linear probe is as wide and deep as the plane; a fan keeps its size. Returns false
   * after reporting an error.
   */
  bool ComputeTruth(vtkMatrix4x4* imageToReference, int width, int height, vtkImageData* truth);

  /**
   * Writes into `labels` which tissue lies at each pixel of such a plane, as a person would draw it: 1 vessel, 2 cyst, 3
   * bone, 4 tumour, 0 anything else and beside the fan. vtkBigusFieldLabeler takes such pictures. Returns false after
   * reporting an error.
   */
  bool ComputeLabels(vtkMatrix4x4* imageToReference, int width, int height, vtkImageData* labels);

#ifndef __VTK_WRAP__
  /**
   * Sets every property.
   */
  void SetOptions(const bigus::PhantomOptions& options);
#endif

protected:
  /// Writes into `image` what `make` makes of the plane.
  template <class Make>
  bool Compute(vtkMatrix4x4* imageToReference, int width, int height, vtkImageData* image, const Make& make);

  vtkBigusPhantomSource();
  ~vtkBigusPhantomSource() override;

  int RequestInformation(vtkInformation* request, vtkInformationVector** inputVector,
                         vtkInformationVector* outputVector) override;
  int RequestData(vtkInformation* request, vtkInformationVector** inputVector,
                  vtkInformationVector* outputVector) override;

  void SetNumber(const char* name, double value);
  double GetNumber(const char* name);

  std::unique_ptr<bigus::PhantomOptions> Options;  // what has no member below; defaults of all are its
  int Probe;
  int Scene;
  int NumberOfFrames;
  int FrameSize[2];
  double CalibrationShift[3];
  double CalibrationRotation[3];

private:
  bigus::PhantomOptions GetOptions();

  vtkBigusPhantomSource(const vtkBigusPhantomSource&) = delete;
  void operator=(const vtkBigusPhantomSource&) = delete;
};

#undef vtkBigusNumberOptionMacro

#endif
