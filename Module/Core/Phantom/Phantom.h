// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A synthetic tracked sweep with exact truth at any plane: a scattering world, a probe, and a hand that moves it.
#pragma once

#include <Eigen/Dense>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"
#include "Core/Phantom/PhantomOptions.h"
#include "Core/Phantom/Tracker.h"
#include "Core/Phantom/World.h"

namespace bigus
{

/// Every image is a pure function of its plane and the options. The plane fixes the probe: the axial direction is
/// rowStep, the probe's face is centred on the middle of the first row, and beams attenuate and cast shadows along the
/// lines of that pose. A linear probe is as wide and deep as the plane; a fan keeps the size that fills the sweep's own
/// frames, whatever the plane's size. So a frame of the sweep is Frame(TruePlane(k)), and the exact truth at any other
/// plane is Frame(plane).
///
/// The echo at a point is the coherent sum over scatterers a exp(-i 2 k range) exp(-axial^2 / (2 axialSigma^2) -
/// lateral^2 / (2 lateralSigma^2) - elevation^2 / (2 elevationSigma^2)), so elevationSigma is the standard deviation of
/// the two-way amplitude profile: a point target's envelope fades as exp(-z^2 / (2 elevationSigma^2)) when the plane
/// moves z away, and the correlation of the speckle's complex echo falls as exp(-z^2 / (4 elevationSigma^2)).
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

  /// Where frame k of the sweep was taken, and where the tracker says it was (equal without tracking errors).
  SlicePlane TruePlane(int frame) const;
  SlicePlane RecordedPlane(int frame) const;

  /// [frames] seconds: when each frame was taken.
  const std::vector<double>& Timestamps() const { return poses_.timestamps; }

  /// 8-bit image, width * height: 255 (1 + 20 log10(envelope / white) / dynamicRange), clamped and rounded; 0 outside
  /// the fan. The plane's rows and columns must be orthogonal; throws Error for one that is not, or that is too large.
  void Frame(const SlicePlane& plane, std::uint8_t* image) const;

  /// The same before compression: complex echo at every pixel, demodulated; parenchyma has root mean square 1.
  void Echo(const SlicePlane& plane, std::complex<float>* image) const;

  /// width * height, 1 where a beam passes, 0 outside the fan.
  std::vector<std::uint8_t> Mask(const SlicePlane& plane) const;

  /// The whole sweep, with recorded poses, timestamps and (convex, sector) mask. `progress` gets the done share and may
  /// return false to stop: the result is then empty. It is called by the calling thread.
  Sweep MakeSweep(const std::function<bool(double)>& progress = {}) const;

  /// A sweep of the one frame at `plane`, with its pose and (convex, sector) mask.
  Sweep MakeTruth(const SlicePlane& plane) const;

  /// width * height, what a person would draw on the plane's frame: 1 vessel, 2 cyst, 3 bone, 4 tumour; else 0.
  std::vector<std::uint8_t> Labels(const SlicePlane& plane) const;

  /// What is at a point of the world.
  Tissue TissueAt(const Eigen::Vector3d& point) const;

private:
  PhantomOptions options_;
  TrackedPoses poses_;
};

}  // namespace bigus
