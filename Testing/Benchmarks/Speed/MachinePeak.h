// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What this machine can do at best, measured: the roof that engines' speeds are held against.
#pragma once

namespace bigus::bench
{

struct MachinePeak
{
  double multiplyAddsPerSecond = 0;  ///< float, one multiply-add of one lane counts 1
  double bytesPerSecond = 0;         ///< read and written by a triad of arrays of 64 MiB
};

/// The best of `repeats` tries with as many threads at once.
MachinePeak MeasurePeak(int threads, int repeats);

}  // namespace bigus::bench
