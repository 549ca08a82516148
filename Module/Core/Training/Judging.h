// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How near an engine's field comes to frames. Private to Core.
#pragma once

#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"

namespace bigus
{

/// PSNR of the engine's field on each of the frames, and their mean.
std::vector<double> FramePsnrs(Engine& engine, const Sweep& sweep, const std::vector<int>& frames);
double MeanPsnr(Engine& engine, const Sweep& sweep, const std::vector<int>& frames);

/// A few of the frames, evenly spread, which tell what of two fields a caller gets.
std::vector<int> Judges(const std::vector<int>& frames);

/// Of two fields the one that shows the judges among the frames better, `a` where both are as good. The engine has
/// another field then.
GaussianField Nearer(Engine& engine, const Sweep& sweep, const std::vector<int>& frames, GaussianField a,
                     const GaussianField& b);

}  // namespace bigus
