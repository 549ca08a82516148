// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How fast and how exact this build is on this machine, beside what one would use otherwise. Workloads.md has the
// definitions.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "Console.h"

namespace bigus::bench
{

struct SpeedOptions
{
  std::vector<std::string> workloads;  ///< machine, evaluation, render, train-pass, frontier; empty: all
  bool quick = false;                  ///< fewer rounds, fields and frames
  int repeats = 0;                     ///< rounds of which medians are taken; 0: 9, or 3 if quick
  double share = 1;                    ///< of all numbers of Gaussians
  bool frontier = false;               ///< measure the frontier whatever `workloads` says
};

struct SpeedReport
{
  std::string frontierCsv;  ///< a table; empty unless the frontier was measured
};

/// Measures and tells the console line by line; `json` gets all numbers. Throws command::Interrupted, and Error when results
/// that must be equal are not.
SpeedReport MeasureSpeed(const SpeedOptions& options, command::Console& console, nlohmann::ordered_json& json);

}  // namespace bigus::bench
