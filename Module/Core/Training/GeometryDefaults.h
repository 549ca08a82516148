// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Every default that follows from the geometry of a sweep, without looking at results. Private to Core.
#pragma once

#include <vector>

#include "Core/Model/Sweep.h"
#include "Core/Training/TrainingPlan.h"

namespace bigus
{

/// Optimizer steps for so many passes over `frames` frames and `perGap` virtual planes in each of their gaps.
int StepsForPasses(double passes, std::size_t frames, int perGap, int batch);

/// The plan that `options` ask for; what they leave open follows from the geometry of `frames`.
TrainingPlan PlanByGeometry(const TrainerOptions& options, const Sweep& sweep, const std::vector<int>& frames);

/// Sets what the plan counts in pixels (mm each): the pixel itself and the limits of a Gaussian's scales.
void ScaleToPixels(const TrainerOptions& options, double pixelSize, TrainingPlan& plan);

}  // namespace bigus
