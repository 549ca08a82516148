// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a training tells while it runs.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>

namespace bigus
{

/// A line of the training log.
struct TrainingRecord
{
  int iteration = 0;
  double seconds = 0;
  double loss = 0;  ///< mean since the last line
  std::optional<double> validationPsnr;
  std::size_t gaussians = 0;
  double rate = 1;  ///< share of the first learning rate
};

struct TrainingProgress
{
  enum class Phase
  {
    Deciding,
    Seeding,
    Training
  };
  Phase phase = Phase::Deciding;
  double fraction = 0;     ///< of the whole job, 0 to 1
  double secondsLeft = 0;  ///< estimate; 0 while unknown
  TrainingRecord record;
};

/// Called at least every 100 ms or once an iteration; returning false stops the work.
using ProgressCallback = std::function<bool(const TrainingProgress&)>;

}  // namespace bigus
