// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/Phantom.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <new>
#include <string>

#include "Core/Model/Error.h"
#include "Core/Model/PixelMemory.h"
#include "Core/Numerics/Constants.h"
#include "Core/Phantom/Aperture.h"
#include "Core/Phantom/Echo.h"

namespace bigus
{
namespace
{

SlicePlane PlaneOf(const Eigen::Matrix4d& pose, const PhantomOptions& options)
{
  return SlicePlane::FromImageToReference(pose, options.width, options.height);
}

}  // namespace

Phantom::Phantom(const PhantomOptions& options) : options_(options)
{
  options_.Validate();
  const bool convex = options_.probe == ProbeKind::Convex;
  if (options_.width == 0)
  {
    options_.width = options_.probe == ProbeKind::Linear ? 256 : 384;
  }
  if (options_.probeRadius == 0)
  {
    options_.probeRadius = convex ? 25 : 4;
  }
  if (options_.halfAngle == 0)
  {
    options_.halfAngle = convex ? 32 : 44;
  }
  poses_ = TrackHand(options_);
  Aperture(options_, TruePlane(0));  // throws for a frame too large to make
}

double Phantom::ScatterersPerResolutionCell() const
{
  return options_.scattererDensity * std::pow(2 * kPi, 1.5) * options_.axialSigma * options_.lateralSigma *
         options_.elevationSigma;
}

SlicePlane Phantom::TruePlane(int frame) const
{
  return PlaneOf(poses_.truth.at(frame), options_);
}

SlicePlane Phantom::RecordedPlane(int frame) const
{
  return PlaneOf(poses_.recorded.at(frame), options_);
}

void Phantom::Frame(const SlicePlane& plane, std::uint8_t* image) const
{
  const Aperture aperture(options_, plane);
  std::vector<std::complex<float>> echoes(plane.NumberOfPixels());
  ScanConvert(aperture, SumEchoes(options_, aperture), echoes.data());
  const float white = static_cast<float>(options_.whiteLevel);
  const float range = static_cast<float>(options_.dynamicRange);
  for (std::size_t i = 0; i < echoes.size(); ++i)
  {
    // An echo of exactly 0 (outside the fan, or far from every scatterer) has no logarithm: black.
    const float intensity = std::norm(echoes[i]);
    const float level = intensity > 0 ? 1 + (10 * std::log10(intensity) - white) / range : 0;
    image[i] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(level, 0.0f, 1.0f)));
  }
}

void Phantom::Echo(const SlicePlane& plane, std::complex<float>* image) const
{
  const Aperture aperture(options_, plane);
  ScanConvert(aperture, SumEchoes(options_, aperture), image);
}

std::vector<std::uint8_t> Phantom::Mask(const SlicePlane& plane) const
{
  const Aperture aperture(options_, plane);
  std::vector<std::uint8_t> mask(plane.NumberOfPixels());
  for (int j = 0; j < plane.height; ++j)
  {
    for (int i = 0; i < plane.width; ++i)
    {
      mask[static_cast<std::size_t>(j) * plane.width + i] = aperture.IsLit(aperture.PixelToBeam(i, j)) ? 1 : 0;
    }
  }
  return mask;
}

std::vector<std::uint8_t> Phantom::Labels(const SlicePlane& plane) const
{
  std::vector<std::uint8_t> labels = Mask(plane);
  tbb::parallel_for(0, plane.height,
                    [&](int j)
                    {
                      for (int i = 0; i < plane.width; ++i)
                      {
                        std::uint8_t& label = labels[static_cast<std::size_t>(j) * plane.width + i];
                        const Tissue tissue = TissueAt(plane.Point(i, j));
                        const int value = tissue == Tissue::Vessel                               ? 1
                                          : tissue == Tissue::Cyst                               ? 2
                                          : tissue == Tissue::Bone || tissue == Tissue::Boundary ? 3
                                          : tissue == Tissue::Tumour                             ? 4
                                                                                                 : 0;
                        label = static_cast<std::uint8_t>(label * value);
                      }
                    });
  return labels;
}

Sweep Phantom::MakeSweep(const std::function<bool(double)>& progress) const
{
  const std::size_t frameSize = static_cast<std::size_t>(options_.width) * options_.height;
  std::shared_ptr<std::uint8_t> pixels;
  try
  {
    pixels = AllocatePixels<std::uint8_t>(frameSize * options_.frames);
  }
  catch (const std::bad_alloc&)
  {
    throw Error("phantom: no memory for " + std::to_string(frameSize * options_.frames) +
                " pixels; ask for fewer or smaller frames.");
  }

  // Frames are independent, so any grouping gives the same bits. Groups as large as the pool keep progress on the
  // calling thread.
  const int group = std::max(1, tbb::this_task_arena::max_concurrency());
  for (int first = 0; first < options_.frames; first += group)
  {
    if (progress && !progress(static_cast<double>(first) / options_.frames))
    {
      return {};
    }
    tbb::parallel_for(first, std::min(first + group, options_.frames),
                      [&](int k) { Frame(TruePlane(k), pixels.get() + k * frameSize); });
  }
  if (progress && !progress(1.0))
  {
    return {};
  }

  Sweep sweep;
  sweep.width = options_.width;
  sweep.height = options_.height;
  sweep.pixels = pixels;
  sweep.imageToReference = poses_.recorded;
  sweep.timestamps = poses_.timestamps;
  if (options_.probe != ProbeKind::Linear)
  {
    sweep.mask = std::make_shared<const std::vector<std::uint8_t>>(Mask(TruePlane(0)));
  }
  return sweep;
}

Sweep Phantom::MakeTruth(const SlicePlane& plane) const
{
  Aperture(options_, plane);  // throws before anything is allocated
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(plane.NumberOfPixels());
  Frame(plane, pixels->data());
  Sweep sweep;
  sweep.width = plane.width;
  sweep.height = plane.height;
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  sweep.imageToReference = {plane.ImageToReference()};
  if (options_.probe != ProbeKind::Linear)
  {
    sweep.mask = std::make_shared<const std::vector<std::uint8_t>>(Mask(plane));
  }
  return sweep;
}

Tissue Phantom::TissueAt(const Eigen::Vector3d& point) const
{
  return options_.scene == PhantomScene::Organ ? OrganAt(point) : Tissue::Parenchyma;
}

}  // namespace bigus
