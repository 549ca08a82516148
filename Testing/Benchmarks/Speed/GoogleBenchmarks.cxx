// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// render, train-pass and evaluation by Google Benchmark, on the workloads of `bigus-bench`.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <memory>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Testing/Benchmarks/Speed/Workloads.h"

namespace bigus::bench
{
namespace
{

/// Only the last field is kept: benchmarks of one field come one after another.
const GaussianField& FieldOf(const benchmark::State& state)
{
  static std::vector<std::int64_t> key;
  static GaussianField field;
  const std::vector<std::int64_t> wanted{state.range(0), state.range(1), state.range(2)};
  if (key != wanted)
  {
    field = MakeField(
        FieldAround(static_cast<int>(state.range(0)), state.range(1), state.range(2) == 4 ? kFourPixels : kPixelSized));
    key = wanted;
  }
  return field;
}

void Fields(benchmark::internal::Benchmark* benchmark, const std::vector<std::int64_t>& counts, std::int64_t allThreads)
{
  benchmark->ArgNames({"width", "gaussians", "px", "threads"})->UseRealTime()->Unit(benchmark::kMillisecond);
  for (std::int64_t width : {160, 512})
  {
    for (std::int64_t gaussians : counts)
    {
      for (std::int64_t pixels : {1, 4})
      {
        benchmark->Args({width, gaussians, pixels, 1});
        benchmark->Args({width, gaussians, pixels, allThreads});
      }
    }
  }
}

/// 0: all cores.
std::unique_ptr<tbb::global_control> Limit(std::int64_t threads)
{
  return threads > 0 ? std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, threads)
                     : nullptr;
}

void Render(benchmark::State& state)
{
  const int width = static_cast<int>(state.range(0));
  const GaussianField& field = FieldOf(state);
  const auto limit = Limit(state.range(3));
  const auto engine = Engine::Create("cpu");
  engine->SetField(field);
  const SlicePlane plane = MakePlane(width, true);
  std::vector<float> image(plane.NumberOfPixels());
  for (auto _ : state)
  {
    engine->Render(plane, ViewOutput::Intensity, image.data());
    benchmark::DoNotOptimize(image.data());
  }
  PlainRenderer plain(field);
  plain.Render(plane, Accuracy().tolerance, 1, image);
  state.counters["splats"] = static_cast<double>(plain.Splats());
  state.counters["splats/s"] =
      benchmark::Counter(static_cast<double>(plain.Splats()), benchmark::Counter::kIsIterationInvariantRate);
  state.counters["pairs/s"] =
      benchmark::Counter(static_cast<double>(plain.Pairs()), benchmark::Counter::kIsIterationInvariantRate);
}

void RenderPlain(benchmark::State& state)
{
  const int width = static_cast<int>(state.range(0));
  PlainRenderer plain(FieldOf(state));
  const SlicePlane plane = MakePlane(width, true);
  std::vector<float> image;
  for (auto _ : state)
  {
    plain.Render(plane, Accuracy().tolerance, static_cast<int>(state.range(3)), image);
    benchmark::DoNotOptimize(image.data());
  }
}

void TrainPass(benchmark::State& state)
{
  const TrainingPass pass = MakeTrainingPass(state.range(0), static_cast<int>(state.range(1)), 160, 8);
  const auto limit = Limit(state.range(2));
  const auto engine = Engine::Create("cpu");
  engine->SetFrames(pass.sweep);
  engine->SetAccuracy(pass.accuracy);
  double loss = 0;
  for (auto _ : state)
  {
    state.PauseTiming();
    engine->SetField(pass.field);
    state.ResumeTiming();
    for (const std::vector<int>& batch : pass.batches)
    {
      loss = engine->TrainStep(batch, Loss(), pass.rates, pass.limits);
    }
  }
  state.counters["loss"] = loss;
  state.counters["bytes/Gaussian"] = static_cast<double>(engine->MemoryUse()) / static_cast<double>(pass.field.Size());
  state.counters["slices/s"] =
      benchmark::Counter(static_cast<double>(state.range(1)), benchmark::Counter::kIsIterationInvariantRate);
}

void Evaluation(benchmark::State& state)
{
  KernelRun run(0.1 * static_cast<double>(state.range(0)));
  for (auto _ : state)
  {
    run.Run();
  }
  state.counters["splats/s"] =
      benchmark::Counter(static_cast<double>(run.Splats()), benchmark::Counter::kIsIterationInvariantRate);
  state.counters["pairs/s"] =
      benchmark::Counter(static_cast<double>(run.Pairs()), benchmark::Counter::kIsIterationInvariantRate);
}

BENCHMARK(Evaluation)->ArgName("tenths_of_px")->Arg(10)->Arg(15)->Arg(25)->Arg(40);
BENCHMARK(Render)->Apply([](benchmark::internal::Benchmark* b) { Fields(b, {10000, 140000, 1000000, 2000000}, 0); });
BENCHMARK(RenderPlain)->Apply([](benchmark::internal::Benchmark* b) { Fields(b, {10000, 140000}, 2); });
BENCHMARK(TrainPass)
    ->ArgNames({"gaussians", "slices", "threads"})
    ->ArgsProduct({{140000}, {160}, {1, 0}})
    ->Args({10000, 16, 1})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace bigus::bench

BENCHMARK_MAIN();
