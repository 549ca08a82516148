// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the caller of a training loop hears and answers, and the clock that its processes go by. Private to Core.
#pragma once

#include <utility>

#include "Core/Engine/Exchange.h"
#include "Core/Training/Stopwatch.h"
#include "Core/Training/TrainingPlan.h"
#include "Core/Training/TrainingProgress.h"

namespace bigus
{

class Report
{
public:
  /// `progress` may be empty. What is referred to must outlive this; the plan may change.
  Report(const TrainingPlan& plan, ProgressCallback progress, Exchange& exchange)
      : plan_(plan), progress_(std::move(progress)), exchange_(exchange)
  {
  }

  /// Since this was made. With a time limit what is done depends on them, so processes go by the clock of the first.
  double Seconds() const
  {
    const double seconds = watch_.Seconds();
    return plan_.timeLimit > 0 ? exchange_.OfFirst(seconds) : seconds;
  }

  /// The caller said stop.
  bool IsAborted() const { return isAborted_; }

  /// What is told next: the last line, the seconds left.
  TrainingProgress& Now() { return now_; }

  /// False from when the caller first said stop.
  bool Proceed(TrainingProgress::Phase phase, double fraction)
  {
    now_.phase = phase;
    now_.fraction = fraction;
    now_.record.seconds = Seconds();
    isAborted_ = isAborted_ || (progress_ && !progress_(now_));
    return !isAborted_;
  }
  /// While nothing but time passes.
  bool Proceed() { return Proceed(now_.phase, now_.fraction); }

private:
  const TrainingPlan& plan_;
  ProgressCallback progress_;
  Exchange& exchange_;
  Stopwatch watch_;
  TrainingProgress now_;
  bool isAborted_ = false;
};

}  // namespace bigus
