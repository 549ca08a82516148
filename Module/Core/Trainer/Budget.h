// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The time that a training has taken and may take, its caller's word to stop, and what is told of the time left. Private
// to Core.
#pragma once

#include "Core/Training/Stopwatch.h"
#include "Core/Training/TrainingProgress.h"

namespace bigus
{

class Exchange;

class Budget
{
public:
  /// `limit` s, 0: none; `before` s of it are spent. `progress` may be empty. The `exchange` must outlive this, and all its
  /// processes make the same calls.
  Budget(double limit, double before, ProgressCallback progress, Exchange& exchange);

  bool IsLimited() const { return limit_ > 0; }
  /// A limit that is so short that trials would end amid the first comparison.
  bool IsTooShortToTry() const;
  double Limit() const { return limit_; }

  /// Seconds since the training began, those before a checkpoint included.
  double Seconds() const { return watch_.Seconds(); }
  /// Somebody said stop.
  bool IsAborted() const { return isAborted_; }

  /// Tells the caller, with the time left as far as it is known. False from when the caller of any process said stop.
  bool Tell(TrainingProgress now);

  /// Seconds of the limit that are left to training, above 0, with the time for trials kept back or not; 0 without a limit.
  double Left(bool areTrialsToCome) const;

  /// Trials come after what is told until OfTrials: `share` of a second for every second that is left to train after them.
  void ExpectTrials(double share) { trialsShare_ = share; }
  /// Tells what trials tell. False also when their part of a limited time is over.
  ProgressCallback OfTrials();

private:
  /// With a limit what is done depends on it, so processes go by the clock of the first.
  double Spent() const;
  double SecondsLeft(double told, double now);

  double limit_;
  ProgressCallback progress_;
  Exchange& exchange_;
  Stopwatch watch_;
  bool isAborted_ = false;
  double trialsShare_ = 0;
  double fraction_ = 0;               // of the whole, which never falls
  double lastLeft_ = 0, lastAt_ = 0;  // seconds left when that was last known, and when
};

}  // namespace bigus
