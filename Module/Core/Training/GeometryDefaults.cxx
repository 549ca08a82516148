// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/GeometryDefaults.h"

#include <algorithm>
#include <cmath>

namespace bigus
{
namespace
{

// "E2" and the like are experiments, listed in Testing/Benchmarks/experiments.

/// mm, standard deviation across the plane of a usual beam. Speckle says 1.0 mm on the spine sweep, 1.4 to 1.6 mm on the
/// brain sweep and 1.8 to 2.2 mm on the liver sweep. At this distance the intensities of two planes' speckle correlate
/// by exp(-1/2) = 0.61. The sweeps that the defaults were found on lie on both sides: the liver sweep at 0.48 mm and,
/// with half its frames, 0.95 mm; the spine sweep at 1.64 and the brain sweep at 1.68 mm.
constexpr double kUsualBeam = 1.0;

/// Pixels: planes nearer than this are sampled about as finely across as within, whatever the unit of length.
constexpr double kNearPixels = 2.0;

/// Lit pixels recorded for one Gaussian: with a byte each, the field is as large as the sweep that it explains.
constexpr std::size_t kPixelsPerGaussian = GaussianField::kBytesOfGaussian;
/// The fewest that are chosen for one: pixels are samples, and footprints finer than a few of them tell nothing of what lies
/// between.
constexpr std::size_t kPixelsOfFinest = 4;
/// The same where the frames' speckle is to be kept: a grain of it covers about as many pixels.
constexpr std::size_t kPixelsPerGrain = 8;
/// Fewer take no time; more are for deciding to choose.
constexpr std::size_t kFewestGaussians = 1000, kMostGaussians = 300000;

/// mm, the beam that the field is trained under: none. Frames that lie side by side fit a thick beam as well as a thin
/// one, and planes across them are blurred by it (liver volume, every 4th plane: 8 dB for 1.7 mm).
constexpr double kThinBeam = 0;

/// Virtual planes in every gap, so many that all planes lie about a pixel apart: then the field is sampled as finely
/// across the frames as within them. At least two, because the second gains 0.0 to 1.2 dB on dense sweeps as well. At
/// most seven, because training takes a time proportional to the planes.
constexpr double kSamePixel = 0.01;  // pixels that a gap may be wider and still need no further plane
constexpr int kFewestPlanes = 2, kMostPlanes = 7;

/// Recorded pixels for one Gaussian from which the first stage trains on frames of half the sides. Footprints are then
/// so large that fewer pixels save time: half of it for 350 pixels (liver sweep, full size, 100,000 Gaussians), a tenth
/// for 90 (half size).
constexpr double kManyPixels = 100;
/// Pixels of the shorter side that must be left.
constexpr int kLeastCoarseSide = 32;

/// As many planes as passes over frames and virtual planes have, each once. Sparse sweeps gain next to nothing from more:
/// what they lack is frames (Measured.md).
constexpr double kSparsePasses = 30, kDensePasses = 80;
/// Optimizer steps at the least, so that a few frames are learned too.
constexpr int kFewestIterations = 200;

/// Pixels: limits of a Gaussian's scales. A Gaussian of scale s has exp(-pi^2 s^2 / 2) of its amplitude left at the highest
/// frequency that pixels hold: 0.29 for half a pixel, 0.73 for a quarter. Of a narrower one pixels do not tell what
/// lies between them (Measured.md). Above 48 its footprint takes as long as hundreds of others.
constexpr double kSmallestScale = 0.5, kLargestScale = 48;

std::size_t LitPixels(const Sweep& sweep)
{
  return sweep.mask
             ? sweep.PixelsPerFrame() - static_cast<std::size_t>(std::count(sweep.mask->begin(), sweep.mask->end(), 0))
             : sweep.PixelsPerFrame();
}

std::size_t UsualGaussians(const Sweep& sweep, const std::vector<int>& frames, bool keepContrast)
{
  std::vector<float> image(sweep.PixelsPerFrame());
  std::size_t lit = 0;
  for (int frame : frames)
  {
    sweep.CopyFrame(frame, image.data());
    for (std::size_t p = 0; p < image.size(); ++p)
    {
      lit += image[p] > 0 && sweep.IsLit(p);
    }
  }
  return std::clamp(lit / (keepContrast ? kPixelsPerGrain : kPixelsPerGaussian), kFewestGaussians, kMostGaussians);
}

/// The most that are chosen where no one said how many.
std::size_t MostGaussians(const Sweep& sweep, std::size_t frames)
{
  return std::max(kFewestGaussians, LitPixels(sweep) * frames / kPixelsOfFinest);
}

}  // namespace

int PlanesPerGap(const SweepGeometry& geometry)
{
  const double pixels = std::ceil(geometry.usualSpacing / geometry.pixelSize - kSamePixel);
  return static_cast<int>(std::clamp(pixels - 1, double(kFewestPlanes), double(kMostPlanes)));
}

bool IsSparse(const SweepGeometry& geometry)
{
  return geometry.usualSpacing > std::max(kUsualBeam, kNearPixels * geometry.pixelSize);
}

TrainingPlan PlanByGeometry(const TrainerOptions& options, const Sweep& sweep, const std::vector<int>& frames)
{
  const SweepGeometry geometry = MeasureGeometry(sweep, frames);
  const bool sparse = IsSparse(geometry), contrast = options.preset == Preset::Texture;
  TrainingPlan plan;
  static_cast<TrainingSettings&>(plan) = options;
  plan.sparse = sparse;
  // Counting looks at every pixel, so it is done only where the number is used.
  const bool isUsed = !options.gaussians || (contrast && !options.maximumGaussians);
  const std::size_t usual = isUsed ? UsualGaussians(sweep, frames, contrast) : 0;
  // The texture preset asks for a Gaussian a grain, which is more than the sweep's size.
  plan.maximumGaussians = options.maximumGaussians.value_or(contrast ? usual : MostGaussians(sweep, frames.size()));
  plan.gaussians = options.gaussians.value_or(std::min(usual, plan.maximumGaussians));
  plan.elevationSigma = options.elevationSigma.value_or(kThinBeam);
  plan.probeElevationSigma = options.probeElevationSigma.value_or(0);
  plan.virtualPlanes = options.virtualPlanes.value_or(PlanesPerGap(geometry));
  plan.interpolation = options.interpolation.value_or(FrameInterpolation{});
  plan.interpolation.keepContrast = contrast;
  plan.loss = options.loss.value_or(contrast ? Loss::Parse("l1+30*contrast") : Loss{});
  plan.iterations = IterationsByGeometry(options, frames.size(), plan);
  ScaleToPixels(geometry.pixelSize, plan);
  return plan;
}

bool CanReduce(const Sweep& sweep)
{
  return std::min(sweep.width, sweep.height) >= kLeastCoarseSide * kReduction;
}

int FirstCoarseness(const Sweep& sweep, std::size_t frames, std::size_t gaussians)
{
  const double pixels = static_cast<double>(LitPixels(sweep)) * static_cast<double>(frames);
  return CanReduce(sweep) && pixels >= kManyPixels * static_cast<double>(gaussians) ? kReduction : 1;
}

std::size_t GaussiansOfSweepsSize(const Sweep& sweep, std::size_t frames)
{
  return std::max(kFewestGaussians, LitPixels(sweep) * frames / kPixelsPerGaussian);
}

int StepsForPasses(double passes, std::size_t frames, int perGap, int batch)
{
  const std::size_t planes = frames + (frames > 1 ? (frames - 1) * static_cast<std::size_t>(perGap) : 0);
  return static_cast<int>(passes * static_cast<double>(planes) /
                          static_cast<double>(std::min<std::size_t>(batch, planes)));
}

int IterationsByGeometry(const TrainerOptions& options, std::size_t frames, const TrainingPlan& plan)
{
  return options.iterations.value_or(
      std::max(kFewestIterations,
               StepsForPasses(plan.sparse ? kSparsePasses : kDensePasses, frames, plan.virtualPlanes, options.batch)));
}

void ScaleToPixels(double pixelSize, TrainingPlan& plan)
{
  plan.pixelSize = pixelSize;
  plan.minimumScale = kSmallestScale * pixelSize;
  plan.maximumScale = kLargestScale * pixelSize;
}

}  // namespace bigus
