// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The elevation profile of the probe: how thick the slice is that one image sees.
#pragma once

namespace bigus
{

/// Gaussian elevation profile, normalised to unit area: N(z; 0, elevationSigma^2).
/// elevationSigma = 0 is the infinitely thin plane, reached exactly.
struct Beam
{
  double elevationSigma = 0.3;  ///< standard deviation out of plane, mm, >= 0
};

}  // namespace bigus
