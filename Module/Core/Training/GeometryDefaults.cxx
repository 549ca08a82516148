// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/GeometryDefaults.h"

#include <algorithm>

#include "Core/Model/SweepGeometry.h"

namespace bigus
{
namespace
{

constexpr std::size_t kFewestGaussians = 1000;
constexpr double kSparsePasses = 60, kDensePasses = 80;
constexpr int kFewestIterations = 200;

/// A Gaussian for every 50 lit pixels recorded: where the search for the right number starts. Speckle's own grains need
/// one for every 8.
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
  return std::clamp<std::size_t>(lit / (keepContrast ? 8 : 50), kFewestGaussians, 300000);
}

}  // namespace

int StepsForPasses(double passes, std::size_t frames, int perGap, int batch)
{
  const std::size_t planes = frames + (frames > 1 ? (frames - 1) * static_cast<std::size_t>(perGap) : 0);
  return static_cast<int>(passes * static_cast<double>(planes) /
                          static_cast<double>(std::min<std::size_t>(batch, planes)));
}

TrainingPlan PlanByGeometry(const TrainerOptions& options, const Sweep& sweep, const std::vector<int>& frames)
{
  const SweepGeometry geometry = MeasureGeometry(sweep, frames);
  const bool sparse = geometry.IsSparse(), contrast = options.keepContrast;
  TrainingPlan plan;
  static_cast<TrainingSettings&>(plan) = options;
  plan.gaussians = options.gaussians ? *options.gaussians
                                     : std::min(UsualGaussians(sweep, frames, contrast), options.maximumGaussians);
  // A thick beam smooths what is between frames: less error, less speckle.
  plan.elevationSigma = options.elevationSigma.value_or(sparse && !contrast ? 0.8 : 0.3);
  // Without planes that keep contrast the loss alone would ask for grains where no frame says where.
  plan.virtualPlanes = options.virtualPlanes.value_or(contrast ? 2 : sparse ? 1 : 0);
  plan.interpolation = options.interpolation.value_or(FrameInterpolation{});
  plan.interpolation.keepContrast = contrast;
  plan.solveIterations = options.solveIterations.value_or(sparse ? 0 : 8);
  // Sparse sweeps gain nothing from more passes: what they lack is frames.
  plan.iterations = options.iterations.value_or(std::max(
      kFewestIterations,
      StepsForPasses(sparse ? kSparsePasses : kDensePasses, frames.size(), plan.virtualPlanes, options.batch)));
  ScaleToPixels(options, geometry.pixelSize, plan);
  return plan;
}

void ScaleToPixels(const TrainerOptions& options, double pixelSize, TrainingPlan& plan)
{
  plan.pixelSize = pixelSize;
  plan.minimumScale = options.minimumScale.value_or(0.25 * pixelSize);
  plan.maximumScale = std::max(options.maximumScale.value_or(48 * pixelSize), plan.minimumScale);
}

}  // namespace bigus
