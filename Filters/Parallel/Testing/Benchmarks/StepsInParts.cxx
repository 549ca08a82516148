// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How long a training step of several processes takes, and what of it is computing and what exchange:
//
//     mpirun -np 2 bigus-parallel-bench GAUSSIANS SIDE FRAMES BATCH STEPS
//
// A made-up volume of FRAMES planes of SIDE x SIDE pixels, 0.2 mm wide and 0.5 mm apart, filled evenly with Gaussians of the
// sizes that training seeds; pixels are random. Each process has one thread. Prints a line of the first process: medians
// over the steps and, since other work on the machine disturbs them less, lower quartiles. Computing is the processor's
// time; all else is that of the clock.
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <vector>

#include "ProcessExchange.h"
#include "Support/Random.h"
#include "Support/Sweeps.h"
#include "vtkMPIController.h"
#include "vtkNew.h"

namespace
{

constexpr double kPixel = 0.2, kGap = 0.5;  // mm

bigus::GaussianField Field(std::size_t gaussians, int side, int frames)
{
  bigus::test::Random random(1);
  const double width = kPixel * side, length = kGap * frames;
  const double across = 1.6 * kGap;
  const double within = 0.8 * std::sqrt(width * width * length / static_cast<double>(gaussians) / (8 * across));
  bigus::GaussianField field;
  field.Resize(gaussians);
  field.transfer.gamma = 0.5;
  for (std::size_t i = 0; i < gaussians; ++i)
  {
    field.means[i] = {random.Uniform(-width / 2, width / 2), random.Uniform(-width / 2, width / 2),
                      random.Uniform(-length / 2, length / 2)};
    field.scales[i] = {within, within, across};
    field.rotations[i] = {1, 0, 0, 0};
    field.reflectivities[i] = random.Uniform(0, 0.5);
  }
  return field;
}

double ProcessorSeconds()
{
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

/// MPI spends the processor's time on waiting.
class MeasuredExchange final : public bigus::ProcessExchange
{
public:
  using bigus::ProcessExchange::ProcessExchange;
  double processorSeconds = 0;

protected:
  void GatherToAll(const char* mine, std::size_t bytes, char* all) override
  {
    const double begin = ProcessorSeconds();
    ProcessExchange::GatherToAll(mine, bytes, all);
    processorSeconds += ProcessorSeconds() - begin;
  }
  void Swap(int other, const char* mine, std::size_t bytes, char* theirs) override
  {
    const double begin = ProcessorSeconds();
    ProcessExchange::Swap(other, mine, bytes, theirs);
    processorSeconds += ProcessorSeconds() - begin;
  }
};

/// Milliseconds at a share of the sorted times, in seconds.
double At(double share, std::vector<double> times)
{
  std::sort(times.begin(), times.end());
  return 1000 * times[static_cast<std::size_t>(share * static_cast<double>(times.size() - 1))];
}

void Measure(std::size_t gaussians, int side, int frames, int batch, int steps, MeasuredExchange* exchange)
{
  const auto engine = (exchange ? *exchange : bigus::Exchange::Alone()).CreateEngine("cpu");
  {
    const auto sweep = bigus::test::BlackSweep(frames, side, side, kPixel, kGap);
    bigus::test::Random random(2);
    std::generate_n(bigus::test::Pixels(*sweep), sweep->PixelsPerFrame() * frames,
                    [&] { return static_cast<float>(random.Uniform(0, 1)); });
    engine->SetFrames(sweep);
  }
  engine->SetAccuracy({1e-4, true});
  engine->SetField(Field(gaussians, side, frames));
  bigus::ParameterLimits limits;
  limits.minimumScale = kPixel / 4;
  limits.maximumScale = 48 * kPixel;
  std::vector<double> whole, computing, waiting, sending;
  const bigus::Exchange::Traffic none;
  std::uint64_t bytes = 0;
  for (int step = 0; step < steps + 2; ++step)  // the first two find their memory
  {
    std::vector<int> batchFrames;
    for (int k = 0; k < batch; ++k)
    {
      batchFrames.push_back((37 * (step * batch + k)) % frames);
    }
    const bigus::Exchange::Traffic before = exchange ? exchange->Sent() : none;
    const auto computed = [&] { return ProcessorSeconds() - (exchange ? exchange->processorSeconds : 0); };
    const double computedBefore = computed();
    const auto begin = std::chrono::steady_clock::now();
    engine->TrainStep(batchFrames, bigus::Loss{}, {0.01, 0.01, 0.01, 0.01}, limits);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    const bigus::Exchange::Traffic after = exchange ? exchange->Sent() : none;
    if (step >= 2)
    {
      whole.push_back(seconds);
      waiting.push_back(after.waiting - before.waiting);
      sending.push_back(after.sending - before.sending);
      computing.push_back(computed() - computedBefore);
      bytes = after.bytes - before.bytes;
    }
  }
  if (!exchange || exchange->Rank() == 0)
  {
    std::printf(
        "%d processes, %zu Gaussians, %d x %d x %d pixels a step, %.3f MB sent a step, engine of the first %.1f "
        "MB; ms, median (lower quartile): step %.1f (%.1f), computing %.1f (%.1f), waiting %.2f (%.2f), "
        "exchange %.2f (%.2f)\n",
        exchange ? exchange->Size() : 1, gaussians, batch, side, side, static_cast<double>(bytes) / 1e6,
        static_cast<double>(engine->MemoryUse()) / 1e6, At(0.5, whole), At(0.25, whole), At(0.5, computing),
        At(0.25, computing), At(0.5, waiting), At(0.25, waiting), At(0.5, sending), At(0.25, sending));
  }
}

}  // namespace

int main(int argumentCount, char** arguments)
{
  const tbb::global_control oneThreadEach(tbb::global_control::max_allowed_parallelism, 1);
  vtkNew<vtkMPIController> controller;
  controller->Initialize(&argumentCount, &arguments);
  int numbers[5] = {};  // GAUSSIANS SIDE FRAMES BATCH STEPS
  for (int k = 0; k < 5; ++k)
  {
    numbers[k] = k + 1 < argumentCount ? std::atoi(arguments[k + 1]) : 0;
  }
  int status = 0;
  if (*std::min_element(numbers, numbers + 5) < 1)
  {
    std::fprintf(stderr, "usage: bigus-parallel-bench GAUSSIANS SIDE FRAMES BATCH STEPS\n");
    status = 2;
  }
  else
  {
    const auto measure = [&](MeasuredExchange* exchange)
    { Measure(static_cast<std::size_t>(numbers[0]), numbers[1], numbers[2], numbers[3], numbers[4], exchange); };
    try
    {
      MeasuredExchange exchange(controller);
      controller->GetNumberOfProcesses() > 1 ? exchange.Together([&] { measure(&exchange); }) : measure(nullptr);
    }
    catch (const std::exception& error)
    {
      std::fprintf(stderr, "%s\n", error.what());
      status = 1;
    }
  }
  controller->Finalize();
  return status;
}
