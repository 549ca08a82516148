// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A synthetic tracked sweep with exact truth at any plane: a scattering world, a probe, and a hand that moves
// it.
#pragma once

#include <Eigen/Dense>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

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
  Points    ///< nothing but point scatterers, 10 mm apart at (10 a, 10 b + 5, 10 c): shows the point-spread
            ///< function
};

enum class Tissue
{
  Parenchyma,
  Vessel,    ///< blood: weak scatterers
  Cyst,      ///< fluid: no scatterers, no attenuation
  Boundary,  ///< the bright surface of the bone
  Bone,      ///< attenuates strongly: its shadow
  Tumour
};

/// World frame: x to the right, y away from the skin (depth), z along an unrotated sweep; mm. The skin is y =
/// 0.
struct PhantomOptions
{
  PhantomScene scene = PhantomScene::Organ;
  std::uint64_t seed = 1;  ///< places the scatterers, moves the hand and the tracker's noise; the anatomy stays

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

  double frameSpacing = 0.5;         ///< mm of travel between frames on average, 0 to 20
  double speedVariation = 0.4;       ///< the spacing varies smoothly by at most this share, 0 to 0.95
  double tilt = 3;                   ///< degrees, 0 to 45; each of the probe's three angles wanders within this bound
  double wander = 0.5;               ///< mm, 0 to 20; sideways and in depth the hand wanders within this bound
  double sweepAngle = 0;             ///< degrees, -360 to 360; turns probe and travel about the depth axis
  double frameRate = 20;             ///< frames a second, 0.1 to 10000
  double trackingNoise = 0;          ///< mm, 0 to 10; standard deviation of the recorded position, each axis
  double trackingRotationNoise = 0;  ///< degrees, 0 to 20; standard deviation of the recorded rotation, each axis

  /// Throws Error naming the option, its value and its range.
  void Validate() const;
};

/// Every image is a pure function of its plane and the options. The plane fixes the probe: the axial
/// direction is rowStep, the probe's face is centred on the middle of the first row, and beams attenuate and
/// cast shadows along the lines of that pose. A linear probe is as wide and deep as the plane; a fan keeps
/// the size that fills the sweep's own frames, whatever the plane's size. So a frame of the sweep is
/// Frame(TruePlane(k)), and the exact truth at any other plane is Frame(plane).
///
/// The echo at a point is the coherent sum over scatterers a exp(-i 2 k range) exp(-axial^2 / (2
/// axialSigma^2) - lateral^2 / (2 lateralSigma^2) - elevation^2 / (2 elevationSigma^2)), so elevationSigma is
/// the standard deviation of the two-way amplitude profile: a point target's envelope fades as exp(-z^2 / (2
/// elevationSigma^2)) when the plane moves z away, and the correlation of the speckle's complex echo falls as
/// exp(-z^2 / (4 elevationSigma^2)).
///
/// Results are the same bits for any number of threads. All functions may be called from several threads.
class Phantom
{
public:
  /// Throws Error for options out of range.
  explicit Phantom(const PhantomOptions& options);

  /// The options with the probe's defaults filled in.
  const PhantomOptions& Options() const { return options_; }

  /// Mean number of scatterers in a resolution cell, (2 pi)^(3/2) times the product of the three sigmas, in
  /// parenchyma. Fully developed speckle needs 10 or more.
  double ScatterersPerResolutionCell() const;

  /// Where frame k of the sweep was taken, and where the tracker says it was (equal without tracking noise).
  SlicePlane TruePlane(int frame) const;
  SlicePlane RecordedPlane(int frame) const;

  /// 8-bit image, width * height: 255 (1 + 20 log10(envelope / white) / dynamicRange), clamped and rounded; 0
  /// outside the fan. The plane's rows and columns must be orthogonal; throws Error for one that is not, or
  /// that is too large.
  void Frame(const SlicePlane& plane, std::uint8_t* image) const;

  /// The same before compression: complex echo at every pixel, demodulated; parenchyma has root mean
  /// square 1.
  void Echo(const SlicePlane& plane, std::complex<float>* image) const;

  /// width * height, 1 where a beam passes, 0 outside the fan.
  std::vector<std::uint8_t> Mask(const SlicePlane& plane) const;

  /// The whole sweep, with recorded poses, timestamps and (convex, sector) mask. `progress` gets the done
  /// share and may return false to stop: the result is then empty. It is called by the calling thread.
  Sweep MakeSweep(const std::function<bool(double)>& progress = {}) const;

  /// A sweep of the one frame at `plane`, with its pose and (convex, sector) mask.
  Sweep MakeTruth(const SlicePlane& plane) const;

  /// What is at a point of the world.
  Tissue TissueAt(const Eigen::Vector3d& point) const;

private:
  PhantomOptions options_;
  std::vector<Eigen::Matrix4d> truePoses_;      // [frames] ImageToReference
  std::vector<Eigen::Matrix4d> recordedPoses_;  // [frames]
};

}  // namespace bigus
