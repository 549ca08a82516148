// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The sequences that a sweep was joined from, each as a sweep of its own, and which frames follow each other in one.
#pragma once

#include <optional>
#include <vector>

#include "Core/Model/Sweep.h"

namespace bigus
{

/// A sequence by itself.
struct Sequence
{
  int first = 0;            ///< of its frames, as the whole sweep numbers them
  Sweep sweep;              ///< its frames, pixels shared
  std::vector<int> frames;  ///< those of it that were named, as its own sweep numbers them
};

/// All sequences of the sweep that have frames, in their order. `named` frames may be of any.
std::vector<Sequence> SequencesOf(const Sweep& sweep, const std::vector<int>& named = {});

struct Neighbours
{
  std::optional<int> before, after;  ///< empty where there is no frame of the same sequence
};

/// Those of `frames`, which are in the order of the sweep, next to a frame, which need not be one of them.
Neighbours NeighboursOf(const Sweep& sweep, const std::vector<int>& frames, int frame);

}  // namespace bigus
