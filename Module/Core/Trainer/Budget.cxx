// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Trainer/Budget.h"

#include <algorithm>
#include <utility>

#include "Core/Engine/Exchange.h"

namespace bigus
{
namespace
{

/// The most of a limited time that trials take; training gets the larger part.
constexpr double kTrialsTime = 1.0 / 5;

/// Seconds of a time limit below which nothing is tried: a fifth of it would end amid the first comparison.
constexpr double kLeastTimeToTry = 30;

/// Seconds that a time limit leaves to training at the least, since 0 would mean no limit. So short that none is left for
/// a step of a training whose checkpoint says that the limit has passed.
constexpr double kLeastTime = 1e-9;

}  // namespace

Budget::Budget(double limit, double before, ProgressCallback progress, Exchange& exchange)
    : limit_(limit), progress_(std::move(progress)), exchange_(exchange), watch_(before)
{
}

bool Budget::IsTooShortToTry() const
{
  return IsLimited() && limit_ < kLeastTimeToTry;
}

bool Budget::Tell(TrainingProgress now)
{
  now.record.seconds = Seconds();
  now.secondsLeft = SecondsLeft(now.secondsLeft, now.record.seconds);
  if (now.secondsLeft > 0)
  {
    fraction_ = std::max(fraction_, now.record.seconds / (now.record.seconds + now.secondsLeft));
  }
  now.fraction = fraction_;
  isAborted_ = isAborted_ || (progress_ && !progress_(now));
  isAborted_ = exchange_.Any(isAborted_);
  return !isAborted_;
}

/// Of `told` seconds, 0 where that is not known, those of the whole: with the trials to come, within the limit, and from
/// the last time that it was known where it is not.
double Budget::SecondsLeft(double told, double now)
{
  double seconds = told * (1 + trialsShare_);
  if (IsLimited())
  {
    const double left = std::max(0.0, limit_ - now);
    seconds = seconds > 0 ? std::min(seconds, left) : left;
  }
  if (seconds > 0)
  {
    lastLeft_ = seconds;
    lastAt_ = now;
  }
  else if (lastLeft_ > 0)
  {
    seconds = std::max(1.0, lastLeft_ - (now - lastAt_));
  }
  return seconds;
}

double Budget::Left(bool areTrialsToCome) const
{
  const double reserved = areTrialsToCome ? kTrialsTime * limit_ : 0;
  return IsLimited() ? std::max(limit_ - Spent() - reserved, kLeastTime) : 0;
}

ProgressCallback Budget::OfTrials()
{
  const double ahead = lastLeft_, training = ahead / (1 + trialsShare_);
  trialsShare_ = 0;
  const double from = Seconds(), begun = IsLimited() ? Spent() : 0;
  return [this, ahead, training, from, begun](TrainingProgress now)
  {
    now.secondsLeft = std::max(training, ahead - (Seconds() - from));
    return Tell(now) && (!IsLimited() || Spent() - begun < kTrialsTime * limit_);
  };
}

double Budget::Spent() const
{
  return exchange_.OfFirst(Seconds());
}

}  // namespace bigus
