// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a phantom is made of: its scene, probe, hand and tracker.
#pragma once

#include <array>
#include <cstdint>

namespace bigus
{

enum class ProbeKind
{
  Linear,  ///< parallel lines, the whole image is lit
  Convex,  ///< lines from an arc of large radius
  Sector   ///< lines from an arc of small radius (phased array)
};

enum class PhantomScene
{
  Organ,    ///< parenchyma with vessels, a cyst, a tumour and a bone with its bright boundary and shadow
  Speckle,  ///< parenchyma everywhere: fully developed speckle
  Points    ///< nothing but point scatterers, 10 mm apart at (10 a, 10 b + 5, 10 c): shows the point-spread function
};

/// World frame: x to the right, y away from the skin (depth), z along an unrotated sweep; mm. The skin is y = 0. A
/// stepper motor's sweep has exactly equal steps: speedVariation, tilt and wander 0.
struct PhantomOptions
{
  PhantomScene scene = PhantomScene::Organ;
  std::int64_t seed =
      1;  ///< places the scatterers, moves the hand and the tracker's noise; the anatomy stays; 0 to 2^53

  ProbeKind probe = ProbeKind::Linear;
  int frames = 64;         ///< 1 to 100000
  int width = 0;           ///< pixels, 8 to 8192; 0 = 256 (linear) or 384 (convex, sector)
  int height = 256;        ///< pixels, 8 to 8192
  double pixelSize = 0.2;  ///< mm, 0.01 to 5
  double probeRadius = 0;  ///< mm, convex and sector: lines start on an arc of this radius, 2 to 500; 0 = 25 or 4
  double halfAngle = 0;    ///< degrees, convex and sector: the fan reaches this far to each side, 1 to 80; 0 = 32 or 44

  double frequency = 5;          ///< MHz, 0.5 to 50; the axial carrier, at 1540 m/s
  double axialSigma = 0.2;       ///< mm, 0.02 to 5; standard deviation of the amplitude envelope along the beam
  double lateralSigma = 0.4;     ///< mm, 0.02 to 5; the same across the beam, at every depth
  double elevationSigma = 0.8;   ///< mm, 0.05 to 10; the same out of plane, at every depth: the known thickness
  double scattererDensity = 40;  ///< per mm^3 of parenchyma, 1 to 1000
  double attenuation = 0.5;      ///< dB / (cm MHz) in parenchyma, one way, 0 to 3; compensated for parenchyma (TGC)
  double dynamicRange = 50;      ///< dB between black and white, 10 to 120
  double whiteLevel = 24;        ///< dB above the parenchyma's root-mean-square echo that is shown white, -40 to 100

  double frameSpacing = 0.5;    ///< mm of travel between frames on average, 0 to 20
  double speedVariation = 0.4;  ///< the spacing varies smoothly by at most this share, 0 to 0.95
  double tilt = 3;              ///< degrees, 0 to 45; each of the probe's three angles wanders within this bound
  double wander = 0.5;          ///< mm, 0 to 20; sideways and in depth the hand wanders within this bound
  double sweepAngle = 0;        ///< degrees, -360 to 360; turns probe and travel about the depth axis
  int passes = 1;    ///< 1 to 100; the hand goes there and back so often, and slows down where it turns round
  double shake = 0;  ///< mm, 0 to 10; standard deviation on each axis by which the probe itself shakes about its path
  double shakeRotation = 0;     ///< degrees, 0 to 20; the same of its angles, about the middle of the first row
  double shakeCorrelation = 0;  ///< pictures, 0 to 1000; as noiseCorrelation
  double frameRate = 20;        ///< frames a second, 0.1 to 10000
  double droppedShare =
      0;  ///< 0 to 0.9 of the pictures taken are lost; `frames` are kept, and timestamps show the gaps

  // Errors of the tracker. They move the recorded poses and nothing else.
  double trackingNoise = 0;          ///< mm, 0 to 10; standard deviation of the recorded position, each axis
  double trackingRotationNoise = 0;  ///< degrees, 0 to 20; standard deviation of the recorded rotation, each axis
  /// frames, 0 to 1000: the noise of frames so far apart is correlated by 1/e, as an autoregressive process of first order
  /// has it, and as strong in every frame; 0: each frame errs by itself. Outliers stay what they are.
  double noiseCorrelation = 0;
  double trackingDrift = 0;  ///< mm, 0 to 100; the position wanders within this bound on each axis, slower than a sweep
  double trackingRotationDrift = 0;    ///< degrees, 0 to 20; the same of the rotation
  double outlierShare = 0;             ///< 0 to 0.5 of the frames are recorded outlierSize away, in any direction
  double outlierSize = 2;              ///< mm, 0 to 100
  double trackingDelay = 0;            ///< seconds, -1 to 1; a frame is given the pose of so long before it was taken
  double trackingQuantum = 0;          ///< mm, 0 to 10; recorded positions are rounded to multiples; 0: not rounded
  double trackingRotationQuantum = 0;  ///< degrees, 0 to 20; so are the three components of the rotation vector
  /// The image's place on the probe is wrong by the same rigid motion in every frame, in the image's own axes and about
  /// its centre, as Moved (Core/Poses/Alignment.h) takes it: along its rows, down, along its normal.
  std::array<double, 3> calibrationShift{};     ///< mm, each -100 to 100
  std::array<double, 3> calibrationRotation{};  ///< degrees, each -45 to 45; axis times angle

  /// Throws Error naming the option, its value and its range.
  void Validate() const;
};

}  // namespace bigus
