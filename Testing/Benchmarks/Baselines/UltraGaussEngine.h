// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The model of UltraGauss, a published method that experiments compare with, as an engine for the trainer.
#pragma once

#include <memory>

#include "Core/Engine/Engine.h"

namespace bigus
{

/// With footprints w_i of the slice as in every engine, it renders the weighted mean of reflectivities
///
///     I = S / W,   S = sum_i r_i w_i,   W = 1e-3 + sum_i w_i
///
/// without a transfer function. It is meant for r in [0, 1] and a beam without thickness. Footprints end where w falls
/// below Accuracy::tolerance; no bound on I is promised. It computes in double, on all
/// threads, without SIMD: some ten times slower than the engine "cpu".
std::unique_ptr<Engine> CreateUltraGaussEngine();

}  // namespace bigus
