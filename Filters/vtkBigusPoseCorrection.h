// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusPoseCorrection
 * @brief   Takes the tracker's noise out of a sweep's poses
 *
 * The input is a sweep as vtkBigusTrainer takes it: an image stack (x, y, frame) with the field data `ImageToReference`.
 * The output is the same sweep, pixels shared, whose `ImageToReference` follows a smooth path of the probe. No field
 * is trained. What uses poses gains by it: a reconstruction of a volume, a compounding, a training.
 *
 * The noise is estimated from the poses alone. Whether and how strongly it is taken out is chosen by how well frames
 * predict their neighbours at the changed poses. Where the probe comes back, frames are then aligned to others, if
 * frames that took no part in it are predicted better. Poses that are exact, move in equal steps, or are not confirmed by
 * pictures pass bit for bit, and so do frames that `Status` rejects. Core/Poses and Core/Deciding tell how. What an
 * inspection finds wrong with the sweep (vtkBigusSweepInspection) is a warning; nothing is done about it.
 *
 * The output's field data hold, besides all that the input's do:
 *
 * | array | tuples | meaning |
 * |---|---|---|
 * | `ImageToReference` [16] | frames | corrected; pixel indices (i, j, 0, 1) to mm, row by row |
 * | `RecordedImageToReference` [16] | frames | as they came |
 * | `PoseDisplacement` [1] | frames | mm that the image's corners moved, mean of four |
 * | `PoseRotation` [1] | frames | degrees between the recorded and the corrected orientation |
 * | `PoseOutlier` [1] | frames | 1: recorded so far off that the pose follows from its neighbours |
 * | `PoseStroke` [1] | frames | number of the continuous motion that the frame belongs to, from 0; -1: rejected |
 * | `TrackerNoise` [3] | 1 | Translation (mm), Rotation (degrees): standard deviation on each axis; Corner (mm): see below |
 * | `PoseStrength` [1] | 1 | how strongly noise was taken out, in units of what was found; 0: not at all |
 * | `ConstantErrors` [7] | 3 | Delay (s), ShiftX, Y, Z (mm), RotationX, Y, Z (degrees): see below |
 * | `ConfirmedSteps` [3] | 4 | of the delay, of the calibration, and of the alignment of frames to each other where the probe comes back: Share, ShareError, Gain (dB), Taken: see below |
 * | `ConstantErrorsApplied` [1] | 1 | 1: one of these steps was taken |
 * | `PoseDecision` | 2 strings | what was chosen, and the evidence (it begins with "given" where Strength was set) |
 * | `Provenance` | strings | one more line, `sweep.poses` = what was chosen, which a field trained on the output keeps |
 *
 * Corner is the distance that both kinds of noise make at the image's corners, root mean square. Noise is not a number
 * where it is unknown, which is where fewer than 8 poses lie on one path. Constant errors are the
 * same in every frame: how long the tracker lags behind the pictures, and how the image must move on the probe, in its
 * own axes (along its rows, down, along its normal) and about its centre. They are known only where the sweep sees
 * places twice. The first tuple holds estimates, the second their standard errors (infinite: unknown), the third 1 where
 * pictures tell the number apart from the other six. Results are the same for every number of threads.
 *
 * Frames that had no part in finding the delay, the six numbers of the calibration or the alignment confirm a share of each,
 * as of the steps below. It is not a number where nothing was asked: where no number differs from 0, or the probe never comes
 * back.
 *
 * Output 1 is a vtkTable with a row for every step from one strength to another that was judged, in this order; it has none
 * where Strength is given:
 *
 * | column | type | meaning |
 * |---|---|---|
 * | `From`, `To` | double | strengths; 0: as recorded |
 * | `Share`, `ShareError` | double | of what the step changes in poses, that pictures confirm, and its standard error |
 * | `Gain`, `GainError` | double | dB by which frames predict their neighbours better |
 * | `RevisitShare`, `RevisitError` | double | of the step, what frames of other times at the same places confirm; NaN for few |
 * | `Taken` | int | 1: it was taken |
 */
#ifndef vtkBigusPoseCorrection_h
#define vtkBigusPoseCorrection_h

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkImageAlgorithm.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkTable;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSFILTERS_EXPORT vtkBigusPoseCorrection : public vtkImageAlgorithm
{
public:
  static vtkBigusPoseCorrection* New();
  vtkTypeMacro(vtkBigusPoseCorrection, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * How strongly noise is taken out, 0 (not at all) to 1000, in units of the noise found: 1 assumes what was found, 2
   * twice that. Negative (default): chosen by evidence, and 0 where there is none, as with fewer than 8 frames. A given 0
   * keeps every pose, bit for bit; constant errors are not looked for then.
   */
  vtkSetMacro(Strength, double);
  vtkGetMacro(Strength, double);
  ///@}

  ///@{
  /**
   * The pixels of frames with index % HoldOut == HoldOut / 2, of those not rejected, are not looked at, so that a
   * training with the same HoldOut can be judged by them; at least 2. 0 (default): all are looked at.
   */
  vtkSetMacro(HoldOut, int);
  vtkGetMacro(HoldOut, int);
  ///@}

  /** Output 1: a row a step. */
  vtkTable* GetSteps();

  /** Strength as the last update chose it; 0: no noise is taken out. */
  vtkGetMacro(ChosenStrength, double);

protected:
  vtkBigusPoseCorrection();
  ~vtkBigusPoseCorrection() override = default;

  int FillOutputPortInformation(int port, vtkInformation* info) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  double Strength = -1;
  int HoldOut = 0;
  double ChosenStrength = 0;

private:
  vtkBigusPoseCorrection(const vtkBigusPoseCorrection&) = delete;
  void operator=(const vtkBigusPoseCorrection&) = delete;
};

#endif
