// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Rows shared among threads. Private to Core.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace bigus
{

constexpr int kGrain = 16;  // rows a task takes at least: its buffers and tables should be worth making

/// body(first, last) for ranges of [0, count). What a row gets must not depend on its range.
template <class Body>
void ForRanges(int count, Body&& body)
{
  tbb::parallel_for(tbb::blocked_range<int>(0, count, kGrain),
                    [&](const tbb::blocked_range<int>& range) { body(range.begin(), range.end()); });
}

}  // namespace bigus
