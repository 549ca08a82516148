// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Processes that have one field together: what they tell each other. Core knows no MPI; who has it derives from this.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace bigus
{

/// All processes make the same calls in the same order. Every call begins with a few bytes by which each hears whether
/// the others are well and in the same call; if not, all of them throw Error, and nobody waits. An Exchange is used by one
/// thread at a time. Processes are of one kind of machine, because numbers travel as their bytes.
class Exchange
{
public:
  virtual ~Exchange() = default;

  virtual int Rank() const = 0;  ///< of this process, from 0
  virtual int Size() const = 0;  ///< processes

  /// Does this process's share of what all do together. When it throws, all throw: this one what it threw, the others an
  /// Error with its words. All other calls are made inside.
  void Together(const std::function<void()>& work);

  /// values[k] becomes the sum over all processes, added in the order of their ranks, so that all have the same bits.
  void Sum(float* values, std::size_t count) { SumOf(values, count); }
  void Sum(double* values, std::size_t count) { SumOf(values, count); }

  /// The bytes of every process, by rank; they may differ in length.
  std::vector<std::string> Gather(const std::string& mine);

  /// Whether one of them says so.
  bool Any(bool here);

  /// The number that the first process has: of a clock, say.
  double OfFirst(double here);

  /// What was exchanged so far.
  struct Traffic
  {
    std::uint64_t calls = 0;
    std::uint64_t bytes = 0;  ///< that this process sent
    double waiting = 0;       ///< s, for the last process to make the call, and for the few bytes that tell of it
    double sending = 0;       ///< s, for all other bytes
  };
  const Traffic& Sent() const { return sent_; }

protected:
  /// `all` gets `bytes` from every process, by rank. Throws Error when it cannot.
  virtual void GatherToAll(const char* mine, std::size_t bytes, char* all) = 0;
  /// `theirs` gets `bytes` from another process, which calls this with the rank of this one.
  virtual void Swap(int other, const char* mine, std::size_t bytes, char* theirs) = 0;

private:
  enum class Call : std::int32_t
  {
    Failed,
    Done,
    SumFloats,
    SumDoubles,
    Gather,
    Any,
    OfFirst
  };
  struct Message
  {
    Call call;
    std::int32_t unused = 0;
    std::uint64_t count = 0;
    double value = 0;
  };

  /// What all say. Throws Error unless all are in the same call.
  std::vector<Message> Meet(Call call, std::uint64_t count, double value);
  void Tell(const std::string& words);
  std::vector<std::string> Words(const std::string& mine);
  template <class Real>
  void SumOf(Real* values, std::size_t count);

  Traffic sent_;
  bool isOver_ = false;  // the others know that this process, or another, has failed
};

}  // namespace bigus
