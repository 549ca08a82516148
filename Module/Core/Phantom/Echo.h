// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The echoes of one plane: summed on the grid of beams, then read at its pixels.
#pragma once

#include <complex>
#include <vector>

#include "Core/Phantom/Aperture.h"

namespace bigus
{

/// Demodulated echoes at the lit lines and ranges, [ranges][lines] of the aperture's grid.
std::vector<std::complex<float>> SumEchoes(const PhantomOptions& options, const Aperture& aperture);

/// The echo at every pixel, read bilinearly before detection so that its statistics stay those of a sum of echoes.
void ScanConvert(const Aperture& aperture, const std::vector<std::complex<float>>& echoes, std::complex<float>* image);

}  // namespace bigus
