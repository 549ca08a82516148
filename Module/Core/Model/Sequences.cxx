// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/Sequences.h"

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

Neighbourhood NeighbourhoodOf(const Sweep& sweep, const std::vector<int>& frames, std::size_t k)
{
  const auto isOfSame = [&](std::size_t other)
  { return sweep.SequenceOf(frames[other]) == sweep.SequenceOf(frames[k]); };
  Neighbourhood around;
  if (k > 0 && isOfSame(k - 1))
  {
    around.before = k - 1;
  }
  if (k + 1 < frames.size() && isOfSame(k + 1))
  {
    around.after = k + 1;
  }
  return around;
}

}  // namespace bigus
