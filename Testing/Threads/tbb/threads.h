// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What Core uses of TBB, with plain threads. ThreadSanitizer cannot see how an installed TBB hands work to its threads,
// because that library is not instrumented, and calls everything a race. Of these threads it sees all. The `threads`
// preset finds this folder before TBB's.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace tbb
{

namespace plain
{

inline std::atomic<std::size_t>& Limit()
{
  static std::atomic<std::size_t> limit{std::max(2u, std::thread::hardware_concurrency())};
  return limit;
}

/// Of the thread that runs: 0 is the caller's.
inline std::size_t& Slot()
{
  thread_local std::size_t slot = 0;
  return slot;
}

inline bool& IsInside()
{
  thread_local bool inside = false;
  return inside;
}

/// body(k) for k < count, by so many threads as are allowed. What is inside another call is done by its thread. Threads
/// take turns, so that each does a share however short the work is, and share no counter, because that would order what
/// they do and so hide races.
template <class Body>
void ForEach(std::size_t count, const Body& body)
{
  const std::size_t threads = IsInside() ? 1 : std::min<std::size_t>(Limit(), count);
  if (threads <= 1)
  {
    for (std::size_t k = 0; k < count; ++k)
    {
      body(k);
    }
    return;
  }
  std::atomic<bool> stops{false};
  std::mutex faultLock;
  std::exception_ptr fault;
  const auto work = [&](std::size_t slot)
  {
    Slot() = slot;
    IsInside() = true;
    try
    {
      for (std::size_t k = slot; k < count && !stops.load(std::memory_order_relaxed); k += threads)
      {
        body(k);
      }
    }
    catch (...)
    {
      const std::lock_guard<std::mutex> lock(faultLock);
      fault = std::current_exception();
      stops = true;
    }
    IsInside() = false;
  };
  std::vector<std::thread> others;
  for (std::size_t slot = 1; slot < threads; ++slot)
  {
    others.emplace_back(work, slot);
  }
  work(0);
  for (std::thread& other : others)
  {
    other.join();
  }
  if (fault)
  {
    std::rethrow_exception(fault);
  }
}

}  // namespace plain

template <class Index>
class blocked_range
{
public:
  blocked_range(Index begin, Index end, std::size_t grain = 1) : begin_(begin), end_(end), grain_(grain) {}
  Index begin() const { return begin_; }
  Index end() const { return end_; }
  std::size_t grainsize() const { return grain_; }

private:
  Index begin_, end_;
  std::size_t grain_;
};

template <class Index, class Body>
void parallel_for(Index begin, Index end, const Body& body)
{
  plain::ForEach(begin < end ? static_cast<std::size_t>(end - begin) : 0,
                 [&](std::size_t k) { body(static_cast<Index>(begin + static_cast<Index>(k))); });
}

template <class Index, class Body>
void parallel_for(const blocked_range<Index>& range, const Body& body)
{
  const auto count = static_cast<std::size_t>(range.end() - range.begin()), grain = range.grainsize();
  plain::ForEach((count + grain - 1) / grain,
                 [&](std::size_t k)
                 {
                   const Index begin = range.begin() + static_cast<Index>(k * grain);
                   const Index end = range.begin() + static_cast<Index>(std::min(count, (k + 1) * grain));
                   body(blocked_range<Index>(begin, end, grain));
                 });
}

template <class Iterator>
void parallel_sort(Iterator begin, Iterator end)
{
  std::sort(begin, end);
}

template <class T>
class enumerable_thread_specific
{
public:
  enumerable_thread_specific() = default;
  explicit enumerable_thread_specific(std::function<T()> make) : make_(std::move(make)) {}

  T& local()
  {
    const std::lock_guard<std::mutex> lock(lock_);
    while (values_.size() <= plain::Slot())
    {
      values_.push_back(std::make_unique<T>(make_()));
    }
    return *values_[plain::Slot()];
  }

  class iterator
  {
  public:
    iterator(const std::unique_ptr<T>* at) : at_(at) {}
    const T& operator*() const { return **at_; }
    iterator& operator++()
    {
      ++at_;
      return *this;
    }
    bool operator!=(const iterator& other) const { return at_ != other.at_; }

  private:
    const std::unique_ptr<T>* at_;
  };
  iterator begin() const { return values_.data(); }
  iterator end() const { return values_.data() + values_.size(); }

private:
  std::function<T()> make_ = [] { return T(); };
  std::mutex lock_;
  std::vector<std::unique_ptr<T>> values_;
};

template <class T>
class combinable : public enumerable_thread_specific<T>
{
public:
  using enumerable_thread_specific<T>::enumerable_thread_specific;

  template <class Visit>
  void combine_each(const Visit& visit) const
  {
    for (const T& value : *this)
    {
      visit(value);
    }
  }
};

class global_control
{
public:
  enum parameter
  {
    max_allowed_parallelism
  };
  global_control(parameter, std::size_t threads) : before_(plain::Limit().exchange(threads)) {}
  ~global_control() { plain::Limit() = before_; }
  global_control(const global_control&) = delete;
  global_control& operator=(const global_control&) = delete;
  static std::size_t active_value(parameter) { return plain::Limit(); }

private:
  std::size_t before_;
};

namespace this_task_arena
{
inline int max_concurrency()
{
  return static_cast<int>(plain::Limit());
}
}  // namespace this_task_arena

namespace info
{
inline int default_concurrency()
{
  return static_cast<int>(plain::Limit());
}
}  // namespace info

}  // namespace tbb
