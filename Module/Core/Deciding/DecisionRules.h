// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The numbers by which decisions are made, each with what it rests on. "E2" and the like are experiments, listed in
// Testing/Benchmarks/experiments. Private to Core.
#pragma once

#include <cstddef>

namespace bigus
{

// ---- what a trial is ----

/// Frames to train on, below which nothing is compared: of 8 frames 6 are trained on and 2 validate. With fewer there
/// is hardly a sweep, or one validation frame and no standard error.
constexpr std::size_t kFewestFrames = 8;

/// Frames that trials look at. They lie in the middle of the sweep, because its ends show least. With 8 of them for
/// validation, half of the published gains have a standard error of at most 0.05 dB.
constexpr std::size_t kTrialFrames = 32;

/// One in this many of them validates.
constexpr int kValidationEvery = 4;

/// Pixels of a trial's frame; the sides of larger ones are divided by a whole number, the liver sweep's by 3. It
/// bounds the time of a trial; its value was chosen, not measured.
constexpr double kTrialPixels = 8e4;

/// Passes of a trial over its frames and virtual planes. A full training takes 30 or 80.
constexpr double kTrialPasses = 10;

/// Optimizer steps of a trial at the least: 6 frames would make it 10.
constexpr int kFewestTrialSteps = 40;

/// Passes of a trial about the number of Gaussians on a dense sweep. What many Gaussians can do shows late: on the liver
/// sweep 10 passes gave +0.00 dB to 676,000 instead of 338,000, and 40 passes gave +0.2 dB, as the full training.
constexpr double kLongTrialPasses = 40;

/// dB that a frame of a trial can reach: 8-bit frames have no more to say, and a frame met exactly must not make a mean
/// infinite.
constexpr double kMostPsnr = 100;

// ---- when a choice is taken ----

/// dB that something costly or unusual must gain. Half of the published gains have a standard error of up to 0.05 dB, so
/// smaller ones say nothing.
constexpr double kLeastGain = 0.03;

/// Standard errors of the gain that it must gain as well. Half a one, and not two: both choices are sound, so a wrong
/// one costs little, while the few validation frames leave a large standard error.
constexpr double kLeastStandardErrors = 0.5;

/// dB that the probe's path may lose in a trial, with one standard error to its advantage. It is tried only where it
/// predicts frames better, which is evidence of its own and has no chance in it: on the spine sweep 0.3 dB, where trials
/// say +0.00 +- 0.06 dB or +0.36 +- 0.01, and frames held out gain 0.1 or 0.3 dB. So a trial that cannot tell is no
/// reason against it.
constexpr double kPathMayLose = 0.05;

/// dB that a choice may lose on planes across the frames. The same that counts as nothing along them.
constexpr double kAcrossMayLose = kLeastGain;

/// mm, standard deviation: the beams tried where sweeps cross and the probe's is not known. Each is twice the one
/// before, from about a pixel to what no diagnostic probe exceeds at its focus.
constexpr double kCrossingBeams[] = {0.4, 0.8, 1.6, 3.2};

/// dB that twice the Gaussians may lose amid gaps, where they gain less than that at a plane at random. A trial's gaps are
/// twice as wide as the sweep's, and more Gaussians lose there what they do not lose in training: on every 2nd plane of the
/// liver volume trials say -0.14 dB for 181,500 instead of 90,750, and the trained fields +0.06 dB.
constexpr double kMoreMayLose = 0.1;

/// Share of a doubling's gain that the next one has: 0.52 in the median of 27, of the sweeps and
/// volumes that README.md names. After gains of 0.1 to 0.2 dB the next had -0.01 to 0.11.
constexpr double kOfGainBefore = 0.5;

/// dB that half the Gaussians may lose and still be taken. A trial is too short to show all that a Gaussian is worth,
/// so fewer must lose next to nothing.
constexpr double kFewerMayLose = 0.02;

/// The share of what smoothing changes in poses that pictures must confirm, less standard errors as above. The
/// share is 1 when the smoothed path is the true one and 0 when the recorded poses are; above 0.5 smoothing helps. Liver,
/// wire phantom and noisy phantom show 0.95 to 1.05, the brain sweep, whose steps are irregular, 0.3.
constexpr double kLeastConfirmed = 0.5;

/// Gaussians below which no half is tried: they take no time any more.
constexpr std::size_t kFewestToHalve = 1000;

}  // namespace bigus
