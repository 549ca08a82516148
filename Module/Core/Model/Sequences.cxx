// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/Sequences.h"

#include <algorithm>
#include <utility>

namespace bigus
{

std::vector<Sequence> SequencesOf(const Sweep& sweep, const std::vector<int>& named)
{
  std::vector<Sequence> sequences;
  for (const std::vector<int>& all : BySequence(sweep, AllFrames(sweep)))
  {
    Sequence sequence{all.front(), sweep.Range(all.front(), static_cast<int>(all.size())), {}};
    for (const int frame : named)
    {
      if (frame >= all.front() && frame <= all.back())
      {
        sequence.frames.push_back(frame - all.front());
      }
    }
    sequences.push_back(std::move(sequence));
  }
  return sequences;
}

Neighbours NeighboursOf(const Sweep& sweep, const std::vector<int>& frames, int frame)
{
  const auto [at, next] = std::equal_range(frames.begin(), frames.end(), frame);
  Neighbours around;
  if (at != frames.begin() && sweep.SequenceOf(*(at - 1)) == sweep.SequenceOf(frame))
  {
    around.before = *(at - 1);
  }
  if (next != frames.end() && sweep.SequenceOf(*next) == sweep.SequenceOf(frame))
  {
    around.after = *next;
  }
  return around;
}

}  // namespace bigus
