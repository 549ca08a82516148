// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Every default that follows from the geometry of a sweep, without looking at results. Private to Core.
#pragma once

#include <vector>

#include "Core/Model/Sweep.h"
#include "Core/Model/SweepGeometry.h"
#include "Core/Training/TrainingPlan.h"

namespace bigus
{

/// Whether planes lie so far apart that neighbours share little: farther than the beam is thick, and farther than two
/// pixels. The beam is that of kUsualBeam, since a sweep does not tell its own.
bool IsSparse(const SweepGeometry& geometry);

/// Virtual planes for every gap of such a sweep, so that planes lie about a pixel apart: 2 to 7.
int PlanesPerGap(const SweepGeometry& geometry);

/// The plan that `options` ask for; what they leave open follows from the geometry of `frames`.
TrainingPlan PlanByGeometry(const TrainerOptions& options, const Sweep& sweep, const std::vector<int>& frames);

/// Optimizer steps for so many passes over `frames` frames and `perGap` virtual planes in each of their gaps.
int StepsForPasses(double passes, std::size_t frames, int perGap, int batch);

/// What the sides of frames are divided by where training begins on fewer pixels, and whether they are long enough.
constexpr int kReduction = 2;
bool CanReduce(const Sweep& sweep);

/// By how much the sides of frames are divided while a training of so many Gaussians begins: 1 or kReduction.
int FirstCoarseness(const Sweep& sweep, std::size_t frames, std::size_t gaussians);

/// As many Gaussians as fill the memory of the lit pixels of so many frames, at least 1000.
std::size_t GaussiansOfSweepsSize(const Sweep& sweep, std::size_t frames);

/// The optimizer steps that `options` ask for; else those for the plan's virtual planes.
int IterationsByGeometry(const TrainerOptions& options, std::size_t frames, const TrainingPlan& plan);

/// Sets what the plan counts in pixels (mm each): the pixel itself and the limits of a Gaussian's scales.
void ScaleToPixels(double pixelSize, TrainingPlan& plan);

}  // namespace bigus
