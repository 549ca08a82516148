// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/GeometryDefaults.h"

#include <algorithm>

namespace bigus
{
namespace
{

// "E2" and the like are experiments, listed in Testing/Benchmarks/experiments.

/// mm, standard deviation across the plane of a thin beam. Speckle says 1.0 mm on the spine sweep, 1.4 to 1.6 mm on the
/// brain sweep and 1.8 to 2.2 mm on the liver sweep. At this distance the intensities of two planes' speckle correlate
/// by exp(-1/2) = 0.61. The sweeps that the defaults were found on lie on both sides: the liver sweep at 0.48 mm and,
/// with half its frames, 0.95 mm; the spine sweep at 1.64 and the brain sweep at 1.68 mm.
constexpr double kThinBeam = 1.0;

/// Pixels: planes nearer than this are sampled about as finely across as within, whatever the unit of length.
constexpr double kNearPixels = 2.0;

/// Lit pixels recorded for one Gaussian: where the search for the right number starts. E2 ends between a quarter of
/// that number (spine) and four times that number (brain, liver).
constexpr std::size_t kPixelsPerGaussian = 50;
/// The same where the frames' speckle is to be kept: a grain of it covers about as many pixels.
constexpr std::size_t kPixelsPerGrain = 8;
/// Fewer take no time; more are for deciding to choose.
constexpr std::size_t kFewestGaussians = 1000, kMostGaussians = 300000;

/// mm, the field's beam. The field's Gaussians have a thickness too, so it is thinner than the probe's. Sparse: on the
/// brain sweep 0.8 gains 0.08 to 0.09 dB over a beam without thickness (E4), and 0.4 and 1.6 lose 0.05 to 0.09 dB in
/// trials (E2). Dense: on the liver sweep 0.3 is worth 0.0 dB (E4) and 0.6 loses 0.4 dB in trials (E2). A thick beam
/// smooths what lies between frames: less error, less speckle; so where speckle is to be kept it is the thin one.
constexpr double kSparseBeam = 0.8, kDenseBeam = 0.3;

/// In every gap. Without one sparse sweeps lose 1.1 to 2.2 dB (E2: brain, spine). On dense sweeps they gain as well,
/// but make training twice as long, so there it is left to deciding. Where speckle is to be kept there are two, because
/// without planes that keep contrast the loss alone would ask for grains where no frame says where.
constexpr int kSparsePlanes = 1, kDensePlanes = 0, kContrastPlanes = 2;

/// Conjugate-gradient steps on r before training. On sparse sweeps they gained nothing on frames not trained on.
constexpr int kSparseSolve = 0, kDenseSolve = 8;

/// Passes over frames and virtual planes. Sparse sweeps gain nothing from more passes: what they lack is frames.
constexpr double kSparsePasses = 60, kDensePasses = 80;
/// Optimizer steps at the least, so that a few frames are learned too.
constexpr int kFewestIterations = 200;

/// Pixels: limits of a Gaussian's scales. Below a quarter of a pixel nothing is seen of it; above 48 its footprint
/// takes as long as hundreds of others.
constexpr double kSmallestScale = 0.25, kLargestScale = 48;

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

}  // namespace

bool IsSparse(const SweepGeometry& geometry)
{
  return geometry.medianSpacing > std::max(kThinBeam, kNearPixels * geometry.pixelSize);
}

TrainingPlan PlanByGeometry(const TrainerOptions& options, const Sweep& sweep, const std::vector<int>& frames)
{
  const SweepGeometry geometry = MeasureGeometry(sweep, frames);
  const bool sparse = IsSparse(geometry), contrast = options.preset == Preset::Texture;
  TrainingPlan plan;
  static_cast<TrainingSettings&>(plan) = options;
  plan.sparse = sparse;
  plan.gaussians = options.gaussians ? *options.gaussians
                                     : std::min(UsualGaussians(sweep, frames, contrast), options.maximumGaussians);
  plan.elevationSigma = options.elevationSigma.value_or(sparse && !contrast ? kSparseBeam : kDenseBeam);
  plan.virtualPlanes = options.virtualPlanes.value_or(contrast ? kContrastPlanes
                                                      : sparse ? kSparsePlanes
                                                               : kDensePlanes);
  plan.interpolation = options.interpolation.value_or(FrameInterpolation{});
  plan.interpolation.keepContrast = contrast;
  plan.loss = options.loss.value_or(contrast ? Loss::Parse("l1+30*contrast") : Loss{});
  plan.solveIterations = options.solveIterations.value_or(sparse ? kSparseSolve : kDenseSolve);
  plan.iterations = IterationsByGeometry(options, frames.size(), plan);
  ScaleToPixels(geometry.pixelSize, plan);
  return plan;
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
