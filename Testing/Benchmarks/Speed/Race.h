// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Timing things against each other in one process.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "Console.h"

namespace bigus::bench
{

/// One thing to be timed.
struct Contender
{
  Contender(std::string itsName, int itsThreads, std::function<void()> itsRun, std::function<void()> itsPrepare = {})
      : name(std::move(itsName)), threads(itsThreads), run(std::move(itsRun)), prepare(std::move(itsPrepare))
  {
  }

  std::string name;
  int threads;                    ///< the limit on TBB while it runs
  std::function<void()> run;      ///< what is timed
  std::function<void()> prepare;  ///< before every run, not timed; may be empty
  std::vector<double> seconds;    ///< of every round

  double Seconds() const;  ///< median
  double Fastest() const;
  double Slowest() const;
};

/// Runs every contender once a round, in turn, so that what slows the machine down slows all of them; after
/// one round that does not count. What takes less than 30 ms is run several times in a row and divided.
/// Throws Interrupted.
void Race(const std::vector<Contender*>& contenders, int rounds, command::Console& console, const std::string& job);

/// Ratio of the medians, and the smallest and largest ratio of one round.
struct Ratio
{
  double value, low, high;
};

/// Both have run the same rounds.
Ratio Over(const Contender& numerator, const Contender& denominator);
Ratio Over(const std::vector<double>& numerator, const std::vector<double>& denominator);

}  // namespace bigus::bench
