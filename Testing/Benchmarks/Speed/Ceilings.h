// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a CUDA device can do at most, measured: what speeds are to be compared with.
#pragma once

namespace bigus::bench
{

struct Ceilings
{
  double multiplyAddsPerSecond;  ///< in float, all lanes together
  double bytesPerSecond;         ///< read and written, of device memory
};

/// Of the first device, in about half a second. Throws Error.
Ceilings MeasureCeilings();

}  // namespace bigus::bench
