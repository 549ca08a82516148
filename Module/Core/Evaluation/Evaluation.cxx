// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Evaluation/Evaluation.h"

#include <algorithm>

#include "Core/Engine/Engine.h"
#include "Core/Engine/ViewEngine.h"
#include "Core/Evaluation/Baselines.h"
#include "Core/Evaluation/Compounding.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{

FrameScores ScoreFrames(const Sweep& sweep, const std::vector<int>& frames,
                        const std::function<void(int, float*)>& predict)
{
  Require(!frames.empty(), "Scores: there is no frame to score; hold out at least one.");
  std::vector<float> image(sweep.PixelsPerFrame()), truth(sweep.PixelsPerFrame());
  std::vector<double> psnr, ssim;
  std::vector<TextureComparison> textures;
  FrameScores scores;
  scores.frames = frames;
  for (int frame : frames)
  {
    sweep.CopyFrame(frame, truth.data());
    predict(frame, image.data());
    sweep.BlackenUnlit(image.data());
    psnr.push_back(Psnr(image.data(), truth.data(), image.size()));
    ssim.push_back(Ssim(image.data(), truth.data(), sweep.width, sweep.height));
    textures.push_back(CompareTexture(image.data(), truth.data(), sweep.width, sweep.height));
    const BackscatterFidelity bfs = Bfs(image.data(), truth.data(), sweep.width, sweep.height);
    scores.bfs.score += bfs.score / static_cast<double>(frames.size());
    scores.bfs.meanContrast += bfs.meanContrast / static_cast<double>(frames.size());
    scores.bfs.contrastDistribution += bfs.contrastDistribution / static_cast<double>(frames.size());
    scores.bfs.rayleigh += bfs.rayleigh / static_cast<double>(frames.size());
  }
  scores.texture = MeanTexture(textures);
  scores.psnr = Mean(psnr);
  scores.psnrStd = Deviation(psnr);
  scores.ssim = Mean(ssim);
  scores.ssimStd = Deviation(ssim);
  return scores;
}

FrameScores ScoreField(const GaussianField& field, const Sweep& sweep, const std::vector<int>& frames,
                       const std::string& engineName, const ViewDependence* view)
{
  const std::unique_ptr<Engine> engine = Engine::Create(engineName);
  SeenField seen(*engine, field, view);
  return ScoreFrames(sweep, frames,
                     [&](int frame, float* image)
                     {
                       seen.LookFrom(sweep.Plane(frame));
                       engine->Render(sweep.Plane(frame), ViewOutput::Intensity, image);
                     });
}

AlignedScores ScoreFieldAligned(const GaussianField& field, const Sweep& sweep, const std::vector<int>& frames,
                                const std::string& engineName, const ViewDependence* view)
{
  const std::unique_ptr<Engine> engine = Engine::Create(engineName);
  SeenField seen(*engine, field, view);
  AlignedScores out;
  out.scores = ScoreFrames(sweep, frames,
                           [&](int frame, float* image)
                           {
                             seen.LookFrom(sweep.Plane(frame));
                             const RigidAlignment found = AlignFrame(*engine, sweep, frame);
                             const double share = 1 / static_cast<double>(frames.size());
                             out.meanTranslation += share * found.translation;
                             out.largestTranslation = std::max(out.largestTranslation, found.translation);
                             out.meanRotation += share * found.rotation;
                             out.largestRotation = std::max(out.largestRotation, found.rotation);
                             engine->Render(found.plane, ViewOutput::Intensity, image);
                           });
  return out;
}

BaselineScores ScoreBaselines(const Sweep& sweep, const std::vector<int>& training, const std::vector<int>& heldOut)
{
  BaselineScores scores;
  scores.nearest = ScoreFrames(
      sweep, heldOut, [&](int frame, float* image) { PredictNearest(sweep, training, sweep.Plane(frame), image); });
  scores.neighbourAverage = ScoreFrames(
      sweep, heldOut, [&](int frame, float* image) { PredictNeighbourAverage(sweep, training, frame, image); });
  scores.poseInterpolation = ScoreFrames(
      sweep, heldOut, [&](int frame, float* image) { PredictPoseInterpolation(sweep, training, frame, image); });
  const Compounding compounding(sweep, training);
  scores.compounding =
      ScoreFrames(sweep, heldOut, [&](int frame, float* image) { compounding.Predict(sweep.Plane(frame), image); });
  scores.compoundingVoxelSize = compounding.VoxelSize();
  return scores;
}

}  // namespace bigus
