// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Trainer/KeptError.h"

#include <algorithm>
#include <vector>

#include "Core/StandardError/StandardError.h"

namespace bigus
{
namespace
{

/// Whether measuring the standard error takes at most a tenth of the time limit, at 2 million pixels a second (one core of
/// an AMD EPYC). The same for equal runs, however busy the machine is.
bool IsInTime(const Sweep& sweep, double timeLimit)
{
  const double pixels = static_cast<double>(sweep.PixelsPerFrame()) * sweep.NumberOfFrames();
  return timeLimit == 0 || pixels / 2e6 <= 0.1 * timeLimit;
}

}  // namespace

std::string MeasureStandardError(const TrainingResult& result, const Sweep& recorded, double timeLimit)
{
  if (result.aborted || !IsInTime(recorded, timeLimit))
  {
    return {};
  }
  std::vector<int> shown = result.trainingFrames;
  shown.insert(shown.end(), result.validationFrames.begin(), result.validationFrames.end());
  std::sort(shown.begin(), shown.end());
  // Where each sequence was smoothed by a strength of its own it is the one that noise itself tells.
  const bool isCorrected = result.imageToReference != recorded.imageToReference;
  const double strength = isCorrected ? result.settled.poseSmoothing.value_or(1) : 0;
  Sweep trained = recorded.LitBy(shown);  // held-out frames have no say in what the probe lights, either
  trained.imageToReference = result.imageToReference;
  return StandardError(result.field, trained, shown, TrackerNoise(recorded, strength), result.settled.engine,
                       result.view ? &*result.view : nullptr)
      .ToBytes();
}

}  // namespace bigus
