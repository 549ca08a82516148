// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Processes that have one field together: what they tell each other. The class itself is a process alone, which sums
// nothing and answers for itself, so nobody has to ask whether there are others.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace bigus
{

class Engine;

/// All processes make the same calls in the same order. An Exchange is used by one thread at a time, but for Alone().
class Exchange
{
public:
  virtual ~Exchange() = default;

  /// Of this process and no other.
  static Exchange& Alone();

  virtual int Rank() const { return 0; }  ///< of this process, from 0
  virtual int Size() const { return 1; }  ///< processes
  bool IsAlone() const { return Size() == 1; }

  /// Does this process's share of what all do together. When it throws, all throw: this one what it threw, the others an
  /// Error with its words. All other calls are made inside.
  virtual void Together(const std::function<void()>& work) { work(); }

  /// values[k] becomes the sum over all processes, added in the order of their ranks, so that all have the same bits.
  virtual void Sum(float*, std::size_t) {}
  virtual void Sum(double*, std::size_t) {}

  /// The bytes of every process, by rank; they may differ in length.
  virtual std::vector<std::string> Gather(std::string mine);

  /// Whether one of them says so.
  virtual bool Any(bool here) { return here; }

  /// The number that the first process has: of a clock, say.
  virtual double OfFirst(double here) { return here; }

  /// What was exchanged so far.
  struct Traffic
  {
    std::uint64_t calls = 0;
    std::uint64_t bytes = 0;  ///< that this process sent
    double waiting = 0;       ///< s, for the last process to make the call, and for the few bytes that tell of it
    double sending = 0;       ///< s, for all other bytes
  };
  virtual Traffic Sent() const { return {}; }

  /// The engine `name` for this process's part of the field. The exchange must outlive it.
  virtual std::unique_ptr<Engine> CreateEngine(const std::string& name);
};

}  // namespace bigus
