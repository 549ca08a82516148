// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusLiveTrainer
 * @brief   A Gaussian field that follows the probe
 *
 * Frames are handed over one by one, or a sweep at a time, by AddFrame and AddSweep. A thread of its own trains on them.
 * Update() gives the field so far, as vtkBigusTrainer's output; it has no point before the eighth frame
 * that shows anything. RenderSlice gives a picture at any plane at any moment, without a copy of the field.
 *
 * With FinishTime above 0 the update first trains on all frames together for so many seconds, with the tracker's noise
 * taken out of their poses: what to ask for when the probe was lifted. It reports progress and stops soon after
 * AbortExecute is set, with what it has. Frames may come again afterwards.
 *
 * The field changes by itself, which a pipeline cannot know: call Modified() before Update(), as for
 * vtkWindowToImageFilter, to get it as it is now. Equal frames do not give equal bits, because how much is learned between
 * two of them is a matter of time.
 *
 * A sweep may be connected as input instead (optional), for programs that play one, such as ParaView. Its frames' times
 * are the output's time steps, and an update hands over the frames up to the time that it is for, all where none is asked
 * for. An earlier time, another sweep or a changed option begins anew. FinishTime then counts once the last frame is there.
 * Use either the input or AddFrame and AddSweep.
 *
 * An image has one component of unsigned char, a matrix takes its indices (i, j, 0, 1) to mm, and times, in seconds,
 * increase. A black frame, and one whose time is not after the last, is passed over. One of another size than the first,
 * or with an unsound pose, is refused. What became of frames is counted.
 *
 * Once frames were added by a call, a change of an option takes effect with Reset().
 */
#ifndef vtkBigusLiveTrainer_h
#define vtkBigusLiveTrainer_h

#include <functional>  // for what is told on the way
#include <memory>      // for the session
#include <string>      // for texts
#include <tuple>       // for options
#include <vector>      // for times

#include "vtkBigusLiveModule.h"  // for the export macro
#include "vtkPolyDataAlgorithm.h"

namespace bigus
{
class LiveSession;
struct Sweep;
}  // namespace bigus
#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkImageData;
class vtkMatrix4x4;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSLIVE_EXPORT vtkBigusLiveTrainer : public vtkPolyDataAlgorithm
{
public:
  static vtkBigusLiveTrainer* New();
  vtkTypeMacro(vtkBigusLiveTrainer, vtkPolyDataAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  /**
   * Hands over a copy of a frame of one slice, taken at `seconds`. False, with an error, for what is no such image, or when
   * training failed.
   */
  bool AddFrame(vtkImageData* image, vtkMatrix4x4* imageToReference, double seconds);

  /**
   * Hands over all usable frames of a sweep (see vtkBigusTrainer), in order, as fast as they are trained on. Frames without
   * a Timestamp follow the last one by a second each. Returns when no frame waits.
   */
  bool AddSweep(vtkImageData* sweep);

  /**
   * The picture of the field so far at the plane of width x height pixels whose pixel (i, j) lies at
   * imageToReference (i, j, 0, 1), mm: float, at its place as vtkBigusReslice's output. Black before there is a field.
   * Returns within about an optimizer step, some milliseconds. False, with an error, for a plane that cannot be.
   */
  bool RenderSlice(vtkMatrix4x4* imageToReference, int width, int height, vtkImageData* slice);

  /** Forgets all frames and the field. */
  void Reset();

  ///@{
  /** Seconds above 0 that the next update trains on all frames together. 0 (default): it gives the field so far. */
  vtkSetClampMacro(FinishTime, double, 0, 1e6);
  vtkGetMacro(FinishTime, double);
  ///@}

  ///@{
  /** What computes; see vtkBigusTrainer. Default "auto". */
  vtkSetStringMacro(Engine);
  vtkGetStringMacro(Engine);
  ///@}

  ///@{
  /** Of random numbers, 0 to 2^31 - 1, default 1. */
  vtkSetClampMacro(Seed, int, 0, VTK_INT_MAX);
  vtkGetMacro(Seed, int);
  ///@}

  ///@{
  /** Newest frames, which steps learn from, 8 to 1024, default 64. */
  vtkSetClampMacro(Window, int, 8, 1024);
  vtkGetMacro(Window, int);
  ///@}

  ///@{
  /** Frames that are kept to finish with, from the window to 10^6, default 2000. */
  vtkSetClampMacro(MaximumFrames, int, 8, 1000000);
  vtkGetMacro(MaximumFrames, int);
  ///@}

  ///@{
  /** Gaussians beyond which no more are added, 1000 to 2^26, default 1000000. */
  vtkSetClampMacro(MaximumGaussians, int, 1000, 67108864);
  vtkGetMacro(MaximumGaussians, int);
  ///@}

  ///@{
  /** GB that pixels of frames may take, 0.001 to 10^6, default 4: then fewer frames are kept, and too large ones refused. */
  vtkSetClampMacro(MemoryLimit, double, 0.001, 1e6);
  vtkGetMacro(MemoryLimit, double);
  ///@}

  ///@{
  /**
   * What became of the frames: kept to train on; passed over because they were black, repeated or late; dropped because
   * too many waited; refused as unsound, and why the last of those was; handed over and not yet looked at.
   */
  vtkIdType GetNumberOfFrames();
  vtkIdType GetNumberOfPassedOverFrames();
  vtkIdType GetNumberOfDroppedFrames();
  vtkIdType GetNumberOfRefusedFrames();
  const char* GetLastRefusal();
  vtkIdType GetNumberOfWaitingFrames();
  ///@}

  ///@{
  /** Of the field so far, and optimizer steps that were taken. */
  vtkIdType GetNumberOfGaussians();
  vtkIdType GetNumberOfSteps();
  ///@}

protected:
  vtkBigusLiveTrainer();
  ~vtkBigusLiveTrainer() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;
  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

private:
  vtkBigusLiveTrainer(const vtkBigusLiveTrainer&) = delete;
  void operator=(const vtkBigusLiveTrainer&) = delete;

  bigus::LiveSession& Session();
  int HandOver(const bigus::Sweep& sweep, const std::vector<double>& times, int first, int last,
               const std::function<bool(double)>& goOn = {});
  bool FollowInput(vtkImageData* input, double until);
  void EndSession();

  double FinishTime = 0;
  char* Engine = nullptr;
  int Seed = 1;
  int Window = 64;
  int MaximumFrames = 2000;
  int MaximumGaussians = 1000000;
  double MemoryLimit = 4;  // GB
  std::string LastRefusal;
  double LastTime = 0;  // s

  // What the session has had of the input.
  using Options = std::tuple<std::string, int, int, int, int, double>;
  Options UsedOptions;
  vtkMTimeType InputTime = 0;
  int HandedFrames = 0;

  std::unique_ptr<bigus::LiveSession> Live;
};

#endif
