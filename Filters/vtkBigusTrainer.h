// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusTrainer
 * @brief   Learns a Gaussian field from a tracked ultrasound sweep
 *
 * Input 0 is the sweep, as vtkBigusSequenceReader and vtkBigusPhantomSource give it: an image stack (x, y,
 * frame) with the field data `ImageToReference`, 16 components row by row for each frame, that takes pixel
 * indices (i, j, 0, 1) to mm. `Status` (0 = frame rejected) is honoured; `Mask` marks pixels never lit.
 * Pixels are unsigned char, unsigned short or float in [0, 1].
 *
 * Output 0 is the field, a vtkPolyData with one point (mm, the sweep's reference frame) for each Gaussian and
 *
 * | array | where | meaning |
 * |---|---|---|
 * | `Scale` [3] | points | standard deviations along the Gaussian's own axes, mm |
 * | `Rotation` [4] | points | quaternion w, x, y, z that turns these axes into the reference frame |
 * | `Reflectivity` [1] | points, active scalars | signed, dimensionless |
 * | `Gamma` [1] | field data | display compression: I = 1 - exp(-Gamma max(S, 0)) |
 * | `ElevationSigma` [1] | field data | standard deviation of the elevation profile trained under, mm |
 * | `FormatVersion` [1] | field data | 1 |
 * | `Provenance` | field data | strings key=value: how the field came about, and `decision.<what>` = choice
 * and evidence |
 *
 * Output 1 is the training log, a vtkTable with the columns Iteration, Seconds, Loss, ValidationPSNR (dB, NaN
 * where not measured), Gaussians and Rate (share of the first learning rate).
 *
 * Input 1, optional, is a field to continue from instead of seeding a new one; its Gamma stays.
 *
 * Choices left open (their default) are made from evidence when Automatic is on: short trainings on a part of
 * the sweep are scored on frames set aside from those to train on, never on those that HoldOut keeps. What
 * was chosen, why and what finding out cost is in GetDecisions(). A choice that is set is not questioned.
 *
 * Training reports progress, with a line of text in GetProgressText(), and stops soon after AbortExecute is
 * set; the output is then the best field so far and GetAborted() is true. The same sweep, options and Seed
 * give the same field on the same machine with any number of threads, unless TimeLimit cuts it short.
 */
#ifndef vtkBigusTrainer_h
#define vtkBigusTrainer_h

#include <string>  // for the device

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkPolyDataAlgorithm.h"
#include "vtkSmartPointer.h"  // for the lists of frames and decisions

class vtkIntArray;
class vtkTable;

class VTKBIGUSFILTERS_EXPORT vtkBigusTrainer : public vtkPolyDataAlgorithm
{
public:
  static vtkBigusTrainer* New();
  vtkTypeMacro(vtkBigusTrainer, vtkPolyDataAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The field to continue from (input 1). None (default): seed a new one.
   */
  void SetInitialFieldConnection(vtkAlgorithmOutput* port) { this->SetInputConnection(1, port); }
  void SetInitialFieldData(vtkDataObject* field) { this->SetInputData(1, field); }
  ///@}

  ///@{
  /**
   * Which engine trains: "auto" (default, the fastest present), "cpu", "cpu-double", "reference" (double
   * precision, for tests), or the name of a plug-in.
   */
  vtkSetStringMacro(Engine);
  vtkGetStringMacro(Engine);
  ///@}

  /** Where the first Gaussians are put. */
  enum
  {
    Harris = 0,          ///< more at corners of the image (Harris response)
    IntensityBased = 1,  ///< more where the image is bright, evenly spread
    Random = 2           ///< uniformly in the swept volume
  };

  ///@{
  /**
   * Where the first Gaussians are put, default IntensityBased. Without effect when continuing from a field.
   */
  vtkSetClampMacro(Seeding, int, Harris, Random);
  vtkGetMacro(Seeding, int);
  void SetSeedingToHarris() { this->SetSeeding(Harris); }
  void SetSeedingToIntensityBased() { this->SetSeeding(IntensityBased); }
  void SetSeedingToRandom() { this->SetSeeding(Random); }
  ///@}

  ///@{
  /**
   * Whether open choices are made from evidence. On (default): by short trainings compared on validation
   * frames, which takes about as long as the training itself; with fewer than 8 frames nothing can be
   * compared. Off: from the sweep's geometry, at once. Without effect when continuing from a field.
   */
  vtkSetMacro(Automatic, vtkTypeBool);
  vtkGetMacro(Automatic, vtkTypeBool);
  vtkBooleanMacro(Automatic, vtkTypeBool);
  ///@}

  ///@{
  /**
   * Gaussians to seed, 1 to 2^26. 0 (default): open; by geometry, one for every 50 lit pixels to train on,
   * 1000 to 300000. Without effect when continuing from a field.
   */
  vtkSetMacro(NumberOfGaussians, vtkIdType);
  vtkGetMacro(NumberOfGaussians, vtkIdType);
  ///@}

  ///@{
  /**
   * The most Gaussians that are chosen while NumberOfGaussians is open, 1 to 2^26, default 2000000.
   */
  vtkSetMacro(MaximumNumberOfGaussians, vtkIdType);
  vtkGetMacro(MaximumNumberOfGaussians, vtkIdType);
  ///@}

  ///@{
  /**
   * What twice the Gaussians must gain on validation frames to be chosen, dB of PSNR, 0 to 100, default 0.1.
   */
  vtkSetMacro(Price, double);
  vtkGetMacro(Price, double);
  ///@}

  ///@{
  /**
   * Standard deviation of the probe's elevation profile, mm, 0 (an infinitely thin plane) to 1000. Negative
   * (default -1): open; by geometry 0.3 mm, or 0.8 mm when planes lie more than 1 mm apart; when continuing,
   * the field's own.
   */
  vtkSetMacro(ElevationSigma, double);
  vtkGetMacro(ElevationSigma, double);
  void SetElevationSigmaToAutomatic() { this->SetElevationSigma(-1); }
  ///@}

  ///@{
  /**
   * Every HoldOut-th frame, those with index % HoldOut == HoldOut / 2, is kept out of training to score the
   * field with; 0 (default) keeps none, 1 is refused. Indices count the frames that are not rejected.
   */
  vtkSetMacro(HoldOut, int);
  vtkGetMacro(HoldOut, int);
  ///@}

  ///@{
  /**
   * Of the remaining frames every Validation-th, by the same rule, decides when to stop; 0 (default) keeps
   * none and training runs to its end, 1 is refused.
   */
  vtkSetMacro(Validation, int);
  vtkGetMacro(Validation, int);
  ///@}

  ///@{
  /**
   * Evaluations on the validation frames without a better PSNR before training stops, at least 1, default 10.
   */
  vtkSetMacro(Patience, int);
  vtkGetMacro(Patience, int);
  ///@}

  ///@{
  /**
   * Optimizer steps, 0 (seeding only) to 10^7. Negative (default -1): open; by geometry 80 passes over the
   * frames trained on and their virtual planes, 60 when planes lie more than 1 mm apart, at least 200.
   */
  vtkSetMacro(Iterations, int);
  vtkGetMacro(Iterations, int);
  ///@}

  ///@{
  /**
   * Seconds, decisions and seeding included, 0 (default) for no limit. The schedule of learning rates is
   * fitted to it.
   */
  vtkSetMacro(TimeLimit, double);
  vtkGetMacro(TimeLimit, double);
  ///@}

  ///@{
  /**
   * Frames in one optimizer step, 1 to 4096, default 8.
   */
  vtkSetMacro(Batch, int);
  vtkGetMacro(Batch, int);
  ///@}

  ///@{
  /**
   * Seed of everything random, default 1.
   */
  vtkSetMacro(Seed, vtkTypeUInt64);
  vtkGetMacro(Seed, vtkTypeUInt64);
  ///@}

  ///@{
  /**
   * What the field is for, default "fidelity": the least error. "texture": speckle as strong as in the
   * frames, at a price in error. A preset chooses the loss; a Loss that is set wins.
   */
  vtkSetStringMacro(Preset);
  vtkGetStringMacro(Preset);
  void SetPresetToFidelity() { this->SetPreset("fidelity"); }
  void SetPresetToTexture() { this->SetPreset("texture"); }
  ///@}

  ///@{
  /**
   * What training makes small. Null or empty (default): the preset's, "l1" for fidelity. Else a sum of the
   * terms l1 (absolute difference of intensities), l2 (squared difference), dssim (1 - SSIM), ffl (focal
   * frequency loss) and contrast (difference of the windows' standard deviations, squared), each with a
   * factor if wanted: "0.8*l1+0.2*dssim".
   */
  vtkSetStringMacro(Loss);
  vtkGetStringMacro(Loss);
  ///@}

  ///@{
  /**
   * The loss at the end of training; its weights are reached linearly from those of Loss. Null or empty
   * (default): Loss stays as it is.
   */
  vtkSetStringMacro(FinalLoss);
  vtkGetStringMacro(FinalLoss);
  ///@}

  ///@{
  /**
   * Whether a Gaussian may have negative reflectivity and so darken others: 1 or 0. -1 (default): open; by
   * geometry 1.
   */
  vtkSetClampMacro(SignedReflectivity, int, -1, 1);
  vtkGetMacro(SignedReflectivity, int);
  vtkBooleanMacro(SignedReflectivity, int);
  ///@}

  ///@{
  /**
   * Whether every frame to train on gets a gain and an offset of its own, which are removed from it: 1 or 0.
   * For sweeps whose frames differ in brightness. -1 (default): open; by geometry 0.
   */
  vtkSetClampMacro(FrameGains, int, -1, 1);
  vtkGetMacro(FrameGains, int);
  vtkBooleanMacro(FrameGains, int);
  ///@}

  ///@{
  /**
   * Whether frames to train on are aligned rigidly to the field twice on the way: 1 or 0. For sweeps whose
   * tracking is worse than their pixels. -1 (default): open; by geometry 0.
   */
  vtkSetClampMacro(PoseRefinement, int, -1, 1);
  vtkGetMacro(PoseRefinement, int);
  vtkBooleanMacro(PoseRefinement, int);
  ///@}

  ///@{
  /**
   * How far a tracked pose is trusted by PoseRefinement: standard deviations of a position, mm, above 0 to
   * 1000, and of an orientation, degrees, above 0 to 45; default 0.3 each.
   */
  vtkSetMacro(TrackerTranslation, double);
  vtkGetMacro(TrackerTranslation, double);
  vtkSetMacro(TrackerRotation, double);
  vtkGetMacro(TrackerRotation, double);
  ///@}

  ///@{
  /**
   * Whether all pixels are left out of the loss that the sweep's Mask marks, or no training frame lights. Default
   * off: only those within 5 pixels of lit ones are, where frames contradict each other; the rest is learned as
   * black, so that slices end where the sweep does.
   */
  vtkSetMacro(IgnoreMasked, vtkTypeBool);
  vtkGetMacro(IgnoreMasked, vtkTypeBool);
  vtkBooleanMacro(IgnoreMasked, vtkTypeBool);
  ///@}

  ///@{
  /**
   * How much cutting off one Gaussian's footprint may change a pixel's intensity during training, 0 to 1,
   * default 1e-4.
   */
  vtkSetMacro(Tolerance, double);
  vtkGetMacro(Tolerance, double);
  ///@}

  ///@{
  /**
   * First step size of the Gaussians' centres, in pixels, at least 0, default 0.3. 0 freezes them.
   */
  vtkSetMacro(MeanRate, double);
  vtkGetMacro(MeanRate, double);
  ///@}

  ///@{
  /**
   * First step size of the logarithm of the scales and of the rotation (radian), at least 0, default 0.08.
   */
  vtkSetMacro(ShapeRate, double);
  vtkGetMacro(ShapeRate, double);
  ///@}

  ///@{
  /**
   * First step size of the reflectivities, in units of their mean magnitude, at least 0, default 0.15.
   */
  vtkSetMacro(ReflectivityRate, double);
  vtkGetMacro(ReflectivityRate, double);
  ///@}

  ///@{
  /**
   * The share of the step sizes that is left at the end of training, above 0 to 1, default 0.05.
   */
  vtkSetMacro(FinalRate, double);
  vtkGetMacro(FinalRate, double);
  ///@}

  ///@{
  /**
   * Conjugate-gradient steps on the reflectivities before training. Negative (default -1): automatic, 8, or 0
   * when planes lie more than 1 mm apart.
   */
  vtkSetMacro(SolveIterations, int);
  vtkGetMacro(SolveIterations, int);
  ///@}

  ///@{
  /**
   * Planes added to the training in every gap between neighbouring frames, with the image interpolated there
   * from the two: 0 to 8. Negative (default -1): open; by geometry 1 when planes lie more than 1 mm apart,
   * else none.
   */
  vtkSetMacro(VirtualPlanes, int);
  vtkGetMacro(VirtualPlanes, int);
  ///@}

  ///@{
  /**
   * How virtual planes are interpolated. "normals": between points on a line along the frames' mean normal,
   * which trusts the tracked poses; "probe": between points of the same pixel, which trusts the smoothness of
   * the probe's path more; "normals+flow", "probe+flow": the same, averaged with the image along the optical
   * flow. "auto" (default), null or empty: open; by geometry "normals".
   */
  vtkSetStringMacro(Interpolation);
  vtkGetStringMacro(Interpolation);
  ///@}

  ///@{
  /**
   * Bounds of the scales, mm. Negative (default -1): automatic, 0.25 and 48 pixels.
   */
  vtkSetMacro(MinimumScale, double);
  vtkGetMacro(MinimumScale, double);
  vtkSetMacro(MaximumScale, double);
  vtkGetMacro(MaximumScale, double);
  ///@}

  ///@{
  /**
   * Iterations between restructurings of the field, which add Gaussians where the error stays and remove idle
   * ones; 0 (default) never.
   */
  vtkSetMacro(DensificationInterval, int);
  vtkGetMacro(DensificationInterval, int);
  ///@}

  ///@{
  /**
   * Gaussians whose error score lies above this percentile are densified, 0 to 100, default 95.
   */
  vtkSetMacro(DensificationPercentile, double);
  vtkGetMacro(DensificationPercentile, double);
  ///@}

  ///@{
  /**
   * No growth beyond this many Gaussians; 0 (default) is twice the first number.
   */
  vtkSetMacro(DensificationCap, vtkIdType);
  vtkGetMacro(DensificationCap, vtkIdType);
  ///@}

  ///@{
  /**
   * What the last training did: optimizer steps, seconds, what computed, and whether it was stopped from
   * outside.
   */
  vtkGetMacro(IterationsDone, int);
  vtkGetMacro(Seconds, double);
  const char* GetDevice() const { return this->Device.c_str(); }
  vtkGetMacro(Aborted, bool);
  ///@}

  ///@{
  /**
   * Frames of the last training, by index in the image's third axis.
   */
  vtkIntArray* GetTrainingFrames();
  vtkIntArray* GetValidationFrames();
  vtkIntArray* GetHeldOutFrames();
  ///@}

  /** Output 1, the training log. */
  vtkTable* GetLog();

  /**
   * What the last training rested on: the string columns Decision, Choice and Evidence ("given" where the
   * property was set) and the column Seconds, what finding out cost. Empty when nothing was decided: with
   * Automatic off, when continuing from a field, and without iterations.
   */
  vtkTable* GetDecisions();

protected:
  vtkBigusTrainer();
  ~vtkBigusTrainer() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;
  int FillOutputPortInformation(int port, vtkInformation* info) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  char* Engine = nullptr;
  int Seeding = IntensityBased;
  vtkTypeBool Automatic = 1;
  vtkIdType NumberOfGaussians = 0;
  vtkIdType MaximumNumberOfGaussians = 2000000;
  double Price = 0.1;
  double ElevationSigma = -1;
  int HoldOut = 0;
  int Validation = 0;
  int Patience = 10;
  int Iterations = -1;
  double TimeLimit = 0;
  int Batch = 8;
  vtkTypeUInt64 Seed = 1;
  char* Preset = nullptr;
  char* Loss = nullptr;
  char* FinalLoss = nullptr;
  int SignedReflectivity = -1;
  int FrameGains = -1;
  int PoseRefinement = -1;
  double TrackerTranslation = 0.3;
  double TrackerRotation = 0.3;
  vtkTypeBool IgnoreMasked = 0;
  double Tolerance = 1e-4;
  double MeanRate = 0.3;
  double ShapeRate = 0.08;
  double ReflectivityRate = 0.15;
  double FinalRate = 0.05;
  int SolveIterations = -1;
  int VirtualPlanes = -1;
  char* Interpolation = nullptr;
  double MinimumScale = -1;
  double MaximumScale = -1;
  int DensificationInterval = 0;
  double DensificationPercentile = 95;
  vtkIdType DensificationCap = 0;

  int IterationsDone = 0;
  double Seconds = 0;
  std::string Device;
  bool Aborted = false;
  vtkSmartPointer<vtkIntArray> TrainingFrames;
  vtkSmartPointer<vtkIntArray> ValidationFrames;
  vtkSmartPointer<vtkIntArray> HeldOutFrames;
  vtkSmartPointer<vtkTable> Decisions;

private:
  vtkBigusTrainer(const vtkBigusTrainer&) = delete;
  void operator=(const vtkBigusTrainer&) = delete;
};

#endif
