// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Race.h"

#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "Exit.h"

namespace bigus::bench
{

namespace
{

double Median(std::vector<double> values)
{
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n == 0 ? NAN : 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

double Once(const Contender& contender)
{
  if (contender.prepare)
  {
    contender.prepare();
  }
  const auto start = std::chrono::steady_clock::now();
  contender.run();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

double Contender::Seconds() const
{
  return Median(seconds);
}

double Contender::Fastest() const
{
  return *std::min_element(seconds.begin(), seconds.end());
}

double Contender::Slowest() const
{
  return *std::max_element(seconds.begin(), seconds.end());
}

void Race(const std::vector<Contender*>& contenders, int rounds, command::Console& console, const std::string& job)
{
  constexpr double kEnough = 0.03;  // seconds a clock measures well
  constexpr double kWarm = 0.3;     // seconds until a processor that was idle runs at its speed
  for (double seconds = 0; seconds < kWarm && !command::IsInterrupted();)
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, contenders[0]->threads);
    seconds += Once(*contenders[0]);
  }
  std::vector<int> runs(contenders.size(), 1);
  for (int round = -1; round < rounds; ++round)  // round -1 warms caches and sizes up the work
  {
    for (std::size_t i = 0; i < contenders.size(); ++i)
    {
      if (command::IsInterrupted())
      {
        throw command::Interrupted();
      }
      Contender& contender = *contenders[i];
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, contender.threads);
      if (contender.threads > 1 && round >= 0)
      {
        Once(contender);  // wakes the threads that a contender with fewer has sent to sleep
      }
      double seconds = 0;
      for (int k = 0; k < runs[i]; ++k)
      {
        seconds += Once(contender);
      }
      if (round < 0)
      {
        runs[i] = static_cast<int>(std::clamp(std::ceil(kEnough / std::max(seconds, 1e-6)), 1.0, 1000.0));
      }
      else
      {
        contender.seconds.push_back(seconds / runs[i]);
      }
      console.Progress(job, (round + 1 + (i + 1.0) / contenders.size()) / (rounds + 1));
    }
  }
  console.EndProgress();
}

Ratio Over(const std::vector<double>& numerator, const std::vector<double>& denominator)
{
  std::vector<double> ratios;
  for (std::size_t round = 0; round < numerator.size(); ++round)
  {
    ratios.push_back(numerator[round] / denominator[round]);
  }
  const auto [low, high] = std::minmax_element(ratios.begin(), ratios.end());
  return {Median(numerator) / Median(denominator), *low, *high};
}

Ratio Over(const Contender& numerator, const Contender& denominator)
{
  return Over(numerator.seconds, denominator.seconds);
}

}  // namespace bigus::bench
