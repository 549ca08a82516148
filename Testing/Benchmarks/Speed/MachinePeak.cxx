// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "MachinePeak.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <thread>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Testing/Benchmarks/Speed/MachinePeak.cxx"
// foreach_target.h comes first: it compiles the rest once for every instruction set.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace bigus::bench
{
namespace HWY_NAMESPACE
{

namespace hn = hwy::HWY_NAMESPACE;

/// x = a x + b in ten chains, so that none waits for its own last result. Returns how many multiply-adds.
double MultiplyAdds(std::size_t rounds, float* sink)
{
  const hn::ScalableTag<float> d;
  const auto a = hn::Set(d, 0.999f), b = hn::Set(d, 0.001f);
  auto x0 = hn::Iota(d, 0.0f), x1 = hn::Iota(d, 1.0f), x2 = hn::Iota(d, 2.0f), x3 = hn::Iota(d, 3.0f);
  auto x4 = hn::Iota(d, 4.0f), x5 = hn::Iota(d, 5.0f), x6 = hn::Iota(d, 6.0f), x7 = hn::Iota(d, 7.0f);
  auto x8 = hn::Iota(d, 8.0f), x9 = hn::Iota(d, 9.0f);
  for (std::size_t i = 0; i < rounds; ++i)
  {
    x0 = hn::MulAdd(x0, a, b);
    x1 = hn::MulAdd(x1, a, b);
    x2 = hn::MulAdd(x2, a, b);
    x3 = hn::MulAdd(x3, a, b);
    x4 = hn::MulAdd(x4, a, b);
    x5 = hn::MulAdd(x5, a, b);
    x6 = hn::MulAdd(x6, a, b);
    x7 = hn::MulAdd(x7, a, b);
    x8 = hn::MulAdd(x8, a, b);
    x9 = hn::MulAdd(x9, a, b);
  }
  const auto sum = hn::Add(hn::Add(hn::Add(x0, x1), hn::Add(x2, x3)),
                           hn::Add(hn::Add(x4, x5), hn::Add(hn::Add(x6, x7), hn::Add(x8, x9))));
  *sink = hn::GetLane(hn::SumOfLanes(d, sum));
  return 10.0 * static_cast<double>(rounds) * static_cast<double>(hn::Lanes(d));
}

/// a = b + 3 c. Returns how many bytes were read and written (not counting that a line is read before it is
/// written).
double Triad(float* a, const float* b, const float* c, std::size_t count)
{
  const hn::ScalableTag<float> d;
  const auto three = hn::Set(d, 3.0f);
  for (std::size_t i = 0; i + hn::Lanes(d) <= count; i += hn::Lanes(d))
  {
    hn::StoreU(hn::MulAdd(three, hn::LoadU(d, c + i), hn::LoadU(d, b + i)), d, a + i);
  }
  return 12.0 * static_cast<double>(count);
}

}  // namespace HWY_NAMESPACE
}  // namespace bigus::bench
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bigus::bench
{

HWY_EXPORT(MultiplyAdds);
HWY_EXPORT(Triad);

namespace
{

/// The most work a second that `threads` threads do together; body(t) returns its work.
double BestRate(int threads, int repeats, const std::function<double(int)>& body)
{
  double best = 0;
  for (int repeat = 0; repeat < repeats; ++repeat)
  {
    std::vector<double> work(threads, 0.0);
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::thread> others;
    for (int t = 1; t < threads; ++t)
    {
      others.emplace_back([&work, &body, t] { work[t] = body(t); });
    }
    work[0] = body(0);
    for (std::thread& other : others)
    {
      other.join();
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    double sum = 0;
    for (double share : work)
    {
      sum += share;
    }
    best = std::max(best, sum / seconds);
  }
  return best;
}

}  // namespace

MachinePeak MeasurePeak(int threads, int repeats)
{
  MachinePeak peak;
  std::vector<float> sinks(threads * 16);  // far enough apart to share no cache line
  peak.multiplyAddsPerSecond = BestRate(
      threads, repeats, [&sinks](int t) { return HWY_DYNAMIC_DISPATCH(MultiplyAdds)(20000000, &sinks[t * 16]); });

  constexpr std::size_t kCount = std::size_t(1) << 24;  // 64 MiB each
  std::vector<float> a(kCount), b(kCount, 1.0f), c(kCount, 2.0f);
  peak.bytesPerSecond =
      BestRate(threads, repeats,
               [&](int t)
               {
                 const std::size_t begin = kCount * t / threads;
                 const std::size_t end = kCount * (t + 1) / threads;
                 return HWY_DYNAMIC_DISPATCH(Triad)(a.data() + begin, b.data() + begin, c.data() + begin, end - begin);
               });
  return peak;
}

}  // namespace bigus::bench
#endif  // HWY_ONCE
