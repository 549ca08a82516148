// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The training pass in PyTorch, for comparison: bench_torch.py, which is a part of the program, run by
// Python.
#pragma once

#include <string>
#include <vector>

#include "Workloads.h"

namespace bigus::bench
{

struct TorchResult
{
  std::string missing;          ///< why it did not run; empty when it did
  std::string version;          ///< of PyTorch
  std::vector<double> losses;   ///< of every step
  std::vector<double> seconds;  ///< of every repeat
};

/// Runs the pass `repeats` times with that many threads, all batches of equal size. Tries `python3`, then
/// Debian's /usr/bin/python3. Throws Interrupted, and Error when PyTorch is there but fails.
TorchResult RunTorchPass(const TrainingPass& pass, int repeats, int threads);

}  // namespace bigus::bench
