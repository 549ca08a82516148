// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Several processes that have one field together, by bytes that they send each other. Core knows no MPI; who has it derives
// from this.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "Core/Engine/Exchange.h"

namespace bigus
{

/// Every call begins with a few bytes by which each hears whether the others are well and in the same call; if not, all of
/// them throw Error, and nobody waits. Processes are of one kind of machine, because numbers travel as their bytes.
class PeerExchange : public Exchange
{
public:
  int Rank() const override = 0;
  int Size() const override = 0;

  void Together(const std::function<void()>& work) override;
  void Sum(float* values, std::size_t count) override { SumOf(values, count); }
  void Sum(double* values, std::size_t count) override { SumOf(values, count); }
  std::vector<std::string> Gather(std::string mine) override;
  bool Any(bool here) override;
  double OfFirst(double here) override;
  std::unique_ptr<Engine> CreateEngine(const std::string& name) override;
  Traffic Sent() const override { return sent_; }

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
