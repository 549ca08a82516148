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
 * Several sweeps of one patient in one reference frame train one field: AddInputConnection() or AddInputData(), once for
 * each. Their frames have one size; pixels may differ in mm. HoldOut and Validation count, and poses are corrected, in
 * each by itself. Frames are numbered on from one sweep to the next, in the order of the inputs, and so are the tuples
 * of GetCorrectedPoses().
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
 * | `ProbeElevationSigma` [1] | field data | that of the probe, mm; only where it is known |
 * | `TrainedNormals` [3] | field data | normals of the planes trained on; only with a known probe |
 * | `FormatVersion` [1] | field data | 1 |
 * | `Provenance` | field data | strings key=value: every option, `decision.<what>` = choice and evidence, `poses`, and of several sweeps `sequences` and `poses.sequence1` ... |
 *
 * Output 1 is the training log, a vtkTable with the columns Iteration, Seconds, Loss, ValidationPSNR (dB, NaN
 * where not measured), Gaussians and Rate (share of the first learning rate).
 *
 * Input 1, optional, is a field to continue from instead of seeding a new one; its Gamma stays.
 *
 * Options left open (their default) are chosen from evidence when Automatic is on: short trainings on a part of
 * the sweep are scored on frames set aside from those to train on, never on those that HoldOut keeps. What
 * was chosen, why and what finding out cost is in GetDecisions(). An option that is set is not questioned.
 *
 * Training reports progress, with a line of text in GetProgressText(), and stops soon after AbortExecute is
 * set; the output is then the best field so far and GetAborted() is true. The same sweep, options and Seed
 * give the same field on the same machine with any number of threads, unless TimeLimit cuts it short. With a Controller
 * they do so with the same number of processes.
 */
#ifndef vtkBigusTrainer_h
#define vtkBigusTrainer_h

#include <map>     // for the options
#include <memory>  // for the checkpoints
#include <string>  // for their values

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkPolyDataAlgorithm.h"
#include "vtkSmartPointer.h"  // for the lists of frames and decisions

namespace bigus
{
struct Checkpoints;
class Exchange;
struct Sweep;
struct TrainingResult;
}  // namespace bigus
#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkDoubleArray;
class vtkIntArray;
class vtkMultiProcessController;
class vtkTable;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

// The property of an option: a number (of a switch 1 or 0), or a text. A negative number leaves a choice open.
// clang-format off
#define vtkBigusNumberOptionMacro(name, type)                                                \
  virtual void Set##name(type value) { this->SetNumber(#name, static_cast<double>(value)); } \
  virtual type Get##name() { return static_cast<type>(this->GetNumber(#name)); }
#define vtkBigusSwitchOptionMacro(name)           \
  vtkBigusNumberOptionMacro(name, vtkTypeBool)    \
  virtual void name##On() { this->Set##name(1); } \
  virtual void name##Off() { this->Set##name(0); }
#define vtkBigusTextOptionMacro(name)                                          \
  virtual void Set##name(const char* value) { this->SetOption(#name, value); } \
  virtual const char* Get##name() { return this->GetOption(#name); }
// clang-format on

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
   * Every option below by its name and as text: "VirtualPlanes", "2"; "auto" leaves a choice open; null or "" is the
   * default. What the value may be is checked by the update, which fails with one error that names the option. Names
   * are counted by GetNumberOfOptions(). What is said of each below is what Core/Training/OptionList.h says of it, and a
   * test keeps it so; where auto is a default, a negative number stands for it.
   */
  void SetOption(const char* name, const char* value);
  const char* GetOption(const char* name);
  int GetNumberOfOptions();
  const char* GetOptionName(int index);
  ///@}

  /**
   * The option as the last training settled it, and so not open. Empty before the first, and where it has no value.
   */
  const char* GetSettledOption(const char* name);

  /**
   * Decide what is left at auto by short trainings, scored on frames set aside among those to train on; off: follow the
   * sweep's geometry, at once. Values: on, off. Default: on.
   */
  vtkBigusSwitchOptionMacro(Automatic);
  /**
   * Gaussians to start with. Values: 1 to 67108864. Default: auto, begins at one for every 44 lit pixels to train on
   * (preset texture: 8), 1000 to 300000.
   */
  vtkBigusNumberOptionMacro(Gaussians, vtkIdType);
  /**
   * The most Gaussians that are chosen while Gaussians is auto. Values: 1 to 67108864. Default: auto, one for
   * every 4 lit pixels to train on.
   */
  vtkBigusNumberOptionMacro(MaximumGaussians, vtkIdType);
  /**
   * What twice the Gaussians must gain at a plane at random to be chosen, PSNR; less: more Gaussians, time and bytes.
   * Values: 0 to 100 dB. Default: 0.1.
   */
  vtkBigusNumberOptionMacro(Price, double);
  /**
   * Thickness out of plane, standard deviation, of the planes trained on; 0 is a thin plane. Values: 0 to 1000 mm.
   * Default: auto, 0, or the probe's where sweeps cross and are trained as one; the field's own when continuing.
   */
  vtkBigusNumberOptionMacro(ElevationSigma, double);
  /**
   * Thickness of the probe's beam out of plane, standard deviation, which planes across the sweep show; 0 where it is
   * not known. Values: 0 to 1000 mm. Default: auto, measured by how fast speckle changes, where it can be; the field's
   * own when continuing.
   */
  vtkBigusNumberOptionMacro(ProbeElevationSigma, double);
  /** Allow negative reflectivity, which darkens. Values: on, off. Default: on. */
  vtkBigusSwitchOptionMacro(SignedReflectivity);
  /**
   * Let reflectivities change with the direction they are seen from, near recorded frames. Values: on, off. Default: auto,
   * where recorded frames that a short training has not seen gain by it; off without Automatic, with a time limit, or when
   * continuing.
   */
  vtkBigusSwitchOptionMacro(ViewDependence);
  /**
   * Interpolated planes added in every gap between neighbouring training frames. Values: 0 to 8. Default: auto, so many
   * that planes lie about a pixel apart, 2 to 7.
   */
  vtkBigusNumberOptionMacro(VirtualPlanes, int);
  /**
   * What virtual planes show: points meet along the frames' normals (trusts poses) or at the same pixel (trusts the
   * smoothness of the probe's path), with or without optical flow; frames change smoothly along the sweep, roughly, or
   * in between. Values: normals, probe[+flow][+rough, +smooth]. Default: auto, chosen by how well frames predict each
   * other.
   */
  vtkBigusTextOptionMacro(Interpolation);
  /**
   * Findings of the inspection that nothing is done about; several are joined by +. Values: none, all, order, contact,
   * repeat, rest, overlay, tracking, fan. Default: none.
   */
  vtkBigusTextOptionMacro(Keep);
  /**
   * Remove a gain and an offset from every training frame, for sweeps whose frames differ in brightness. Values: on,
   * off. Default: off.
   */
  vtkBigusSwitchOptionMacro(FrameGains);
  /**
   * How strongly the tracker's noise is taken out of all poses, in units of the noise found in them; 0 keeps them as
   * tracked. Values: 0 to 1000. Default: auto, begins at 1, or 0 where pictures do not confirm it; 0 without Automatic.
   */
  vtkBigusNumberOptionMacro(PoseSmoothing, double);
  /**
   * Where Gaussians start: spread by brightness, at corners, or anywhere. Values: intensity, harris, random. Default:
   * intensity.
   */
  vtkBigusTextOptionMacro(Seeding);

  /**
   * Optimizer steps; 0 only seeds. Values: 0 to 10000000. Default: auto, begins at 80 passes over frames and virtual
   * planes, 30 where planes are sparse, at least 200.
   */
  vtkBigusNumberOptionMacro(Iterations, int);
  /** Time for all of it, decisions included; 0 sets no limit. Values: 0 to 1000000000 s. Default: 0. */
  vtkBigusNumberOptionMacro(TimeLimit, double);
  /** Seed of everything random: same seed, same field. Values: 0 to 9007199254740992. Default: 1. */
  vtkBigusNumberOptionMacro(Seed, vtkTypeInt64);
  /** Frames in one step. Values: 1 to 4096. Default: 8. */
  vtkBigusNumberOptionMacro(Batch, int);
  /**
   * What the field is for: least error (fidelity), or speckle as strong as in the frames, which costs error (texture).
   * Values: fidelity, texture. Default: fidelity.
   */
  vtkBigusTextOptionMacro(Preset);
  /**
   * What is made small: l1, l2, dssim, ffl, contrast or a sum such as 0.8*l1+0.2*dssim. Default: auto, the preset's:
   * l1, or l1+30*contrast for texture.
   */
  vtkBigusTextOptionMacro(Loss);
  /** What computes: auto (the fastest present) or a name from 'bigus info --devices'. Default: auto. */
  vtkBigusTextOptionMacro(Engine);

  /**
   * Keep frames with index % K == K / 2 out of everything but the final score; 0 keeps none. Values: 0 or 2 to 1000000.
   * Default: 0.
   */
  vtkBigusNumberOptionMacro(HoldOut, int);
  /** Of the other frames, keep every K-th to stop early by; 0 keeps none. Values: 0 or 2 to 1000000. Default: 0. */
  vtkBigusNumberOptionMacro(Validation, int);
  /**
   * Evaluations on validation frames without a better PSNR before training stops. Values: 1 to 1000000. Default: 10.
   */
  vtkBigusNumberOptionMacro(Patience, int);

  /** First step of the centres. Values: 0 to 100 pixels. Default: 0.3. */
  vtkBigusNumberOptionMacro(MeanRate, double);
  /** First step of the logarithm of the scales and of the rotation (radian). Values: 0 to 1. Default: 0.08. */
  vtkBigusNumberOptionMacro(ShapeRate, double);
  /** First step of the reflectivities, in units of their mean magnitude. Values: 0 to 10. Default: 0.15. */
  vtkBigusNumberOptionMacro(ReflectivityRate, double);
  /** Share of the steps that is left at the end. Values: 1e-06 to 1. Default: 0.1. */
  vtkBigusNumberOptionMacro(FinalRate, double);
  /** How much cutting off a Gaussian's footprint may change a pixel's intensity. Values: 0 to 1. Default: 0.0001. */
  vtkBigusNumberOptionMacro(Tolerance, double);
  /**
   * Leave every pixel that no training frame lights out of the loss; off: only those within 5 pixels of lit ones, the
   * rest is learned as black. Values: on, off. Default: off.
   */
  vtkBigusSwitchOptionMacro(IgnoreMasked);
  /**
   * Steps between restructurings that add Gaussians where error persists; 0 never. Values: 0 to 10000000. Default: 0.
   */
  vtkBigusNumberOptionMacro(DensificationInterval, int);
  /** Gaussians with an error score above this percentile are densified. Values: 0 to 100. Default: 95. */
  vtkBigusNumberOptionMacro(DensificationPercentile, double);
  /** No growth beyond so many Gaussians; 0 is twice the first number. Values: 0 to 67108864. Default: 0. */
  vtkBigusNumberOptionMacro(DensificationCap, vtkIdType);

  ///@{
  /**
   * Processes that train one field together, each a part of it; null (default), or a controller of one process: this one
   * trains alone. The same filter with the same input and the same options runs in every process, and each gets the whole
   * field, with the same bits. They depend on the number of processes by rounding. What fails in one process is an error in
   * all, and what stops one stops all. The engine is "cpu" or "cpu-double". The checkpoints of the
   * first process hold the state of all. Several processes need the module FiltersParallel.
   */
  virtual void SetController(vtkMultiProcessController*);
  vtkMultiProcessController* GetController() { return this->Controller; }
  ///@}

  ///@{
  /**
   * Whether the field gets what its standard error rests on (Core/StandardError), bytes in the field data's array
   * StandardError: 0.1 to 4 MB. It is measured at the end on all frames that are not held out; a training that is stopped
   * leaves it out, and so does one whose time limit is less than ten times what measuring takes (a second for 2 million
   * pixels). What hinders it is a warning. Default on.
   */
  vtkSetMacro(KeepStandardError, vtkTypeBool);
  vtkGetMacro(KeepStandardError, vtkTypeBool);
  vtkBooleanMacro(KeepStandardError, vtkTypeBool);
  ///@}

  /**
   * Seconds that measuring it took in the last training; 0 where the field has none.
   */
  vtkGetMacro(StandardErrorSeconds, double);

  ///@{
  /**
   * What the last training exchanged with other processes: bytes that this one sent, seconds that it waited until all had
   * done their share of a step, and seconds of the exchange itself.
   */
  vtkGetMacro(SentBytes, vtkTypeInt64);
  vtkGetMacro(WaitingSeconds, double);
  vtkGetMacro(SendingSeconds, double);
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

  /**
   * Whether the last training took all its steps or validation ended it. Else it was stopped or its time was up, and it
   * can go on from its last checkpoint.
   */
  vtkGetMacro(Finished, bool);

#ifndef __VTK_WRAP__
  /**
   * How the next training keeps its state, and the state that it goes on from: Core/Trainer/Trainer.h. For C++ alone.
   * Default: it keeps nothing and begins.
   */
  void SetCheckpoints(const bigus::Checkpoints& checkpoints);
#endif

  ///@{
  /**
   * Frames of the last training, by index in the image's third axis; in a further sweep it goes on from the one before.
   */
  vtkIntArray* GetTrainingFrames();
  vtkIntArray* GetValidationFrames();
  vtkIntArray* GetHeldOutFrames();
  ///@}

  /**
   * The poses that the field was trained at: `ImageToReference` [16, row-major, frames of the image], as in the input's
   * field data. Frames that were rejected keep the pose they came with.
   */
  vtkDoubleArray* GetCorrectedPoses();

  /** Output 1, the training log. */
  vtkTable* GetLog();

  /**
   * What the last training rested on: the string columns Decision, Choice and Evidence ("given" where the
   * property was set) and the column Seconds, what finding out cost. Empty with Automatic off; when
   * continuing from a field and without iterations only poses are decided.
   */
  vtkTable* GetDecisions();

protected:
  vtkBigusTrainer();
  ~vtkBigusTrainer() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;
  int FillOutputPortInformation(int port, vtkInformation* info) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  vtkExecutive* CreateDefaultExecutive() override;

  void SetNumber(const char* name, double value);
  double GetNumber(const char* name);

  std::map<std::string, std::string> Options, SettledOptions;  // values by name
  int IterationsDone = 0;
  double Seconds = 0;
  vtkTypeBool KeepStandardError = 1;
  double StandardErrorSeconds = 0;
  std::string Device;
  bool Aborted = false;
  bool Finished = false;
  vtkSmartPointer<vtkIntArray> TrainingFrames;
  vtkSmartPointer<vtkIntArray> ValidationFrames;
  vtkSmartPointer<vtkIntArray> HeldOutFrames;
  vtkSmartPointer<vtkTable> Decisions;
  vtkSmartPointer<vtkDoubleArray> CorrectedPoses;
  std::unique_ptr<bigus::Checkpoints> Checkpoints;
  vtkMultiProcessController* Controller = nullptr;
  vtkTypeInt64 SentBytes = 0;
  double WaitingSeconds = 0;
  double SendingSeconds = 0;

private:
  vtkBigusTrainer(const vtkBigusTrainer&) = delete;
  void operator=(const vtkBigusTrainer&) = delete;

  void MeasureStandardError(const bigus::TrainingResult& result, const bigus::Sweep& recorded, double timeLimit,
                            vtkPolyData* output);
  void Train(vtkInformationVector** inputs, vtkInformationVector* outputs, bigus::Exchange& exchange);
  /// Tells other processes, which wait for this one, that it has no input.
  void TellOfNoInput();

  bool WasAsked = false;  // for data, by the update under way
};

#undef vtkBigusNumberOptionMacro
#undef vtkBigusSwitchOptionMacro
#undef vtkBigusTextOptionMacro

#endif
