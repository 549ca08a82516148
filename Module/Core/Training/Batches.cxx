// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/Batches.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace bigus
{

Batches::Batches(std::vector<int> frames, int size, std::uint64_t seed)
    : frames_(std::move(frames)), size_(std::min<std::size_t>(size, frames_.size())), random_(seed)
{
}

std::vector<int> Batches::Next()
{
  std::vector<int> batch;
  while (batch.size() < size_)
  {
    if (at_ == 0)
    {
      Deal();
    }
    batch.push_back(dealt_[at_]);
    at_ = (at_ + 1) % dealt_.size();
  }
  return batch;
}

void Batches::Skip(int batches)
{
  for (int taken = 0; taken < batches; ++taken)
  {
    Next();
  }
}

void Batches::Deal()
{
  const std::size_t stride = (frames_.size() + size_ - 1) / size_, phase = random_() % frames_.size();
  std::vector<std::size_t> firsts(stride);
  std::iota(firsts.begin(), firsts.end(), std::size_t(0));
  for (std::size_t i = stride; i > 1; --i)  // Fisher-Yates; std::shuffle differs between libraries
  {
    std::swap(firsts[i - 1], firsts[random_() % i]);
  }
  dealt_.clear();
  for (const std::size_t first : firsts)
  {
    for (std::size_t k = first; k < frames_.size(); k += stride)
    {
      dealt_.push_back(frames_[(k + phase) % frames_.size()]);
    }
  }
}

}  // namespace bigus
