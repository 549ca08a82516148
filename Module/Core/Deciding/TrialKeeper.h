// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What of trials outlives the program that made them. Private to Core.
#pragma once

#include <string>
#include <vector>

#include "Core/Training/TrainingLoop.h"

namespace bigus
{

/// PSNRs of a trial, dB: of validation frames, of planes across the frames, and of the frames trained on.
struct TrialScores
{
  std::vector<double> frames, across, seen;
};

/// Remembers finished trials and the one that is under way, each by a name that says all that trials differ in.
class TrialKeeper
{
public:
  virtual ~TrialKeeper() = default;

  /// Null where the trial was not finished.
  virtual const TrialScores* FindTrial(const std::string& name) const = 0;
  virtual void NoteTrial(const std::string& name, const TrialScores& scores) = 0;

  /// The state that the trial's loop was in; "" for one that begins.
  virtual std::string TakeTrial(const std::string& name) = 0;
  virtual Keeping KeepingOfTrial(const std::string& name) = 0;
};

}  // namespace bigus
