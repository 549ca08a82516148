// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What all parts of the engine share: the stream, the recorded step, and what kernels report. Private to Cuda.
#pragma once

#include "Device.h"
#include "Forward.h"

namespace bigus::cuda
{

constexpr char kFewerGaussians[] = "Use fewer Gaussians";
constexpr char kFewerPixels[] = "Render fewer pixels at a time";
constexpr char kFewerFrames[] = "Use fewer frames, or frames of fewer pixels";
constexpr char kSmallerBatch[] = "Use a smaller batch, or fewer Gaussians";

/// What kernels report.
struct Results
{
  unsigned long long used;     // splats of the last FindSplats
  unsigned long long guarded;  // updates, since the state was last reset
  double loss;
};

class Stream
{
public:
  Stream() { Check(cudaStreamCreate(&stream_), "creating a stream"); }
  ~Stream() { cudaStreamDestroy(stream_); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  operator cudaStream_t() const { return stream_; }

private:
  cudaStream_t stream_ = nullptr;
};

class Workspace
{
public:
  Workspace()
  {
    Grow(results_, 1, "results", kFewerGaussians);
    results_.Clear(stream);
  }

  /// Room in an array; returns whether it has moved. A recorded step holds addresses, so it is worth nothing then.
  template <class T>
  bool Grow(DeviceArray<T>& array, std::size_t size, const char* what, const char* advice)
  {
    const bool moved = array.Resize(size, what, advice);
    if (moved)
    {
      step.Forget();
    }
    return moved;
  }

  Results ReadResults() const
  {
    Results results;
    results_.Download(&results, 0, 1, stream);
    return results;
  }

  /// Of `count` numbers on the device, always in the same order.
  double Sum(const double* values, std::size_t count)
  {
    Launch("a sum", SumInOrder, 1, 1, kSumThreads, stream, values, count, &results_.data()->loss);
    return ReadResults().loss;
  }

  Results* Reported() { return results_.data(); }
  void ClearReports() { results_.Clear(stream); }
  void SetGuarded(unsigned long long updates)
  {
    const Results results{0, updates, 0};
    results_.Upload(&results, 1, stream);
  }
  std::size_t Bytes() const { return results_.Bytes() + losses.Bytes(); }

  Stream stream;
  Recording step;              ///< of TrainStep
  DeviceArray<double> losses;  ///< what is added up, a number a thread block

private:
  DeviceArray<Results> results_;
};

}  // namespace bigus::cuda
