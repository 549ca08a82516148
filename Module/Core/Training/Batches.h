// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The order in which frames are trained on. Private to Core.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

namespace bigus
{

/// Training frames in a new order every epoch, dealt in batches. The frames of a batch lie a stride apart along the
/// sweep, so that few Gaussians are seen by two of them: a step moves more Gaussians, and each is seen at more steps.
class Batches
{
public:
  /// `frames` are in their order along the sweep.
  Batches(std::vector<int> frames, int size, std::uint64_t seed);

  std::vector<int> Next();
  void Skip(int batches);

private:
  void Deal();

  std::vector<int> frames_, dealt_;
  std::size_t size_;
  std::size_t at_ = 0;
  std::mt19937_64 random_;
};

}  // namespace bigus
