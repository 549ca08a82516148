// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Everything that a caller of the trainer can set.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "Core/Engine/Loss.h"
#include "Core/Inspection/Inspection.h"
#include "Core/Training/Densification.h"
#include "Core/Training/FrameInterpolation.h"
#include "Core/Training/Seeding.h"

namespace bigus
{

/// What a field is for. Where the place of speckle cannot be known, the least error is a smooth picture.
enum class Preset
{
  Fidelity,  ///< the least error: the loss is l1
  /// Speckle as strong as in the frames, which costs error: the loss, l1+30*contrast, asks for grains of the right
  /// strength wherever they lie, and virtual planes keep the contrast of frames.
  Texture
};

/// What has a plain default, which does not depend on the sweep.
struct TrainingSettings
{
  std::string engine = "auto";
  std::uint64_t seed = 1;
  SeedPlacement seeding = SeedPlacement::Intensity;
  bool signedReflectivity = true;  ///< false: r >= 0
  /// A gain and an offset for every frame to train on, removed from it: images of one place that differ in brightness
  /// otherwise contradict each other.
  bool frameGains = false;
  int patience = 10;               ///< evaluations without a better validation PSNR before stopping, >= 1
  double timeLimit = 0;            ///< seconds, all included, 0 = none; the rate schedule is fitted to it
  int batch = 8;                   ///< frames a step, 1 to 4096
  bool ignoreMasked = false;       ///< true: no pixel never lit counts in the loss; false: those far from lit are black
  double tolerance = 1e-4;         ///< on I, of each splat: Accuracy::perSplat
  double meanRate = 0.3;           ///< Adam step for means, pixels
  double shapeRate = 0.08;         ///< Adam step for log-scales and rotation (radian)
  double reflectivityRate = 0.15;  ///< Adam step for r, in units of mean |r|
  double finalRate = 0.1;          ///< rates decay to this share, and further in more than some 300 passes
  DensificationOptions densification;
};

/// The settings and the choices. An empty optional is a choice left open: some are decided from evidence where
/// `automatic` is set (Deciding/Decisions.h); the rest follow from the sweep's geometry (GeometryDefaults.h).
struct TrainerOptions : TrainingSettings
{
  Preset preset = Preset::Fidelity;
  std::optional<Loss> loss;  ///< what is made small; the preset's
  bool automatic = true;     ///< decide by short trainings scored on validation frames
  KeptKinds keep;            ///< findings of the inspection that nothing is done about
  int holdOut = 0;           ///< frames with index % K == K / 2 are kept for the final score; 0 or >= 2
  int validation = 0;        ///< of the remaining frames, the same rule with this K serves early stop; 0 or >= 2

  std::optional<double> poseSmoothing;   ///< strength, 0 to 1000, in units of the tracker's noise; 0: none; decided
  std::optional<std::size_t> gaussians;  ///< seeds, 1 to 2^26; decided
  std::optional<std::size_t> maximumGaussians;  ///< the most that `automatic` chooses, 1 to 2^26; one for 4 lit pixels
  double price = 0.1;                         ///< dB at a plane at random that twice the Gaussians must gain, 0 to 100
  std::optional<double> elevationSigma;       ///< mm, 0 to 1000: Beam::elevationSigma
  std::optional<double> probeElevationSigma;  ///< mm, 0 to 1000: Beam::probeElevationSigma; measured where it can be
  /// Echoes that change with the direction they are seen from (Model/ViewDependence.md); decided by recorded frames
  std::optional<bool> viewDependence;
  std::optional<int> virtualPlanes;                 ///< planes added in every gap, 0 to 8; decided
  std::optional<FrameInterpolation> interpolation;  ///< what virtual planes show; decided. Its keepContrast is not read
  std::optional<int> iterations;                    ///< optimizer steps, 0 (seeding only) to 10^7; by geometry

  /// Throws Error naming the option, its value and its range, which OptionList.h lists.
  void Validate() const;
};

}  // namespace bigus
