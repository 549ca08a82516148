// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Scores over frames: what is averaged, what the baselines are given, and that a rendered field is scored as
// rendered.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Evaluation/Baselines.h"
#include "Core/Evaluation/Compounding.h"
#include "Core/Evaluation/Evaluation.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Model/Error.h"

using bigus::Engine;
using bigus::Error;
using bigus::FrameScores;
using bigus::GaussianField;
using bigus::ScoreBaselines;
using bigus::ScoreField;
using bigus::ScoreFrames;
using bigus::Sweep;

namespace
{

/// Parallel frames 0.7 mm apart of something smooth.
Sweep MakeSweep(int frames, int width = 40, int height = 30)
{
  Sweep sweep;
  sweep.width = width;
  sweep.height = height;
  sweep.pixelType = Sweep::PixelType::Float32;
  auto pixels = std::make_shared<std::vector<float>>();
  for (int k = 0; k < frames; ++k)
  {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose(0, 0) = pose(1, 1) = 0.4;
    pose(2, 3) = 0.7 * k;
    sweep.imageToReference.push_back(pose);
    for (int p = 0; p < width * height; ++p)
    {
      const Eigen::Vector3d x = sweep.Plane(k).Point(p % width, p / width);
      pixels->push_back(static_cast<float>(0.5 + 0.3 * std::sin(x[0]) * std::cos(0.8 * x[1] + 0.6 * x[2])));
    }
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return sweep;
}

/// A few broad Gaussians in the sweep's volume.
GaussianField MakeField()
{
  GaussianField field;
  field.Resize(5);
  for (int k = 0; k < 5; ++k)
  {
    field.means[k] = Eigen::Vector3d(2.0 + 3 * k, 8 - k, 0.8 * k);
    field.scales[k] = Eigen::Vector3d(1.5, 2.0, 0.7 + 0.2 * k);
    field.reflectivities[k] = k % 2 ? -0.4 : 1.0;
  }
  field.transfer.gamma = 0.7;
  return field;
}

void ExpectSame(const FrameScores& a, const FrameScores& b, double tolerance)
{
  EXPECT_EQ(a.frames, b.frames);
  EXPECT_NEAR(a.psnr, b.psnr, tolerance);
  EXPECT_NEAR(a.psnrStd, b.psnrStd, tolerance);
  EXPECT_NEAR(a.ssim, b.ssim, tolerance);
  EXPECT_NEAR(a.ssimStd, b.ssimStd, tolerance);
  EXPECT_NEAR(a.bfs.score, b.bfs.score, tolerance);
  EXPECT_NEAR(a.bfs.meanContrast, b.bfs.meanContrast, tolerance);
  EXPECT_NEAR(a.bfs.contrastDistribution, b.bfs.contrastDistribution, tolerance);
  EXPECT_NEAR(a.bfs.rayleigh, b.bfs.rayleigh, tolerance);
}

}  // namespace

TEST(ScoreFrames, IsMeanAndDeviationOfEachFramesScores)
{
  const Sweep sweep = MakeSweep(6);
  const std::vector<int> frames = {1, 4, 5};
  std::vector<int> asked;
  const auto predict = [&](int frame, float* image)
  {
    asked.push_back(frame);
    sweep.CopyFrame(frame - 1, image);
  };
  const FrameScores scores = ScoreFrames(sweep, frames, predict);
  EXPECT_EQ(asked, frames);
  EXPECT_EQ(scores.frames, frames);

  double psnr[3], ssim[3], bfs[3], contrast[3], highFrequencyPower[3];
  std::vector<float> image(1200), truth(1200);
  for (int k = 0; k < 3; ++k)
  {
    sweep.CopyFrame(frames[k] - 1, image.data());
    sweep.CopyFrame(frames[k], truth.data());
    psnr[k] = bigus::Psnr(image.data(), truth.data(), 1200);
    ssim[k] = bigus::Ssim(image.data(), truth.data(), 40, 30);
    bfs[k] = bigus::Bfs(image.data(), truth.data(), 40, 30).score;
    const bigus::TextureComparison texture = bigus::CompareTexture(image.data(), truth.data(), 40, 30);
    contrast[k] = texture.image.contrast.mean;
    highFrequencyPower[k] = texture.highFrequencyPower;
  }
  const auto mean = [](const double* v) { return (v[0] + v[1] + v[2]) / 3; };
  const auto deviation = [&](const double* v)
  { return std::sqrt((v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) / 3 - mean(v) * mean(v)); };
  EXPECT_NEAR(scores.psnr, mean(psnr), 1e-10);
  EXPECT_NEAR(scores.psnrStd, deviation(psnr), 1e-6);
  EXPECT_NEAR(scores.ssim, mean(ssim), 1e-12);
  EXPECT_NEAR(scores.ssimStd, deviation(ssim), 1e-6);
  EXPECT_NEAR(scores.bfs.score, mean(bfs), 1e-12);
  EXPECT_NEAR(scores.texture.image.contrast.mean, mean(contrast), 1e-12);
  EXPECT_NEAR(scores.texture.highFrequencyPower, mean(highFrequencyPower), 1e-12);
  EXPECT_NEAR(scores.bfs.score,
              0.4 * scores.bfs.meanContrast + 0.4 * scores.bfs.contrastDistribution + 0.2 * scores.bfs.rayleigh, 1e-12);
}

TEST(ScoreFrames, OfTheTruthIsPerfect)
{
  const Sweep sweep = MakeSweep(3);
  const FrameScores scores = ScoreFrames(sweep, {0, 2}, [&](int f, float* image) { sweep.CopyFrame(f, image); });
  EXPECT_EQ(scores.psnr, std::numeric_limits<double>::infinity());
  EXPECT_EQ(scores.psnrStd, 0);
  EXPECT_NEAR(scores.ssim, 1, 1e-12);
  EXPECT_NEAR(scores.bfs.score, 1, 1e-12);
}

TEST(ScoreFrames, PredictionsAreBlackWhereTheProbeLightsNothing)
{
  const Sweep sweep = MakeSweep(3);
  const std::size_t unlit = sweep.PixelsPerFrame() / 3;
  for (int frame = 0; frame < 3; ++frame)
  {
    std::fill_n(static_cast<float*>(const_cast<void*>(sweep.pixels.get())) + frame * sweep.PixelsPerFrame(), unlit,
                0.0f);
  }
  const auto brightOutside = [&](int frame, float* image)
  {
    sweep.CopyFrame(frame, image);
    std::fill_n(image, unlit, 0.5f);
  };
  EXPECT_NEAR(ScoreFrames(sweep, {1}, brightOutside).psnr, 10 * std::log10(3 / 0.25), 1e-6);
  const Sweep lit = sweep.LitBy({0, 2});
  EXPECT_TRUE(std::isinf(ScoreFrames(lit, {1}, brightOutside).psnr));
}

TEST(ScoreFrames, NeedsFramesOfAUsefulSize)
{
  const auto predict = [](int, float*) {};
  EXPECT_THROW(ScoreFrames(MakeSweep(3), {}, predict), Error);
  EXPECT_THROW(ScoreFrames(MakeSweep(3), {3}, predict), Error);
  EXPECT_THROW(ScoreFrames(MakeSweep(3, 10, 30), {1}, predict), Error);
}

TEST(ScoreField, ScoresWhatAnEngineRendersAtTheTrackedPoses)
{
  const Sweep sweep = MakeSweep(5);
  const GaussianField field = MakeField();
  const auto engine = Engine::Create("reference");
  engine->SetField(field);
  const FrameScores expected = ScoreFrames(
      sweep, {1, 3},
      [&](int frame, float* image) { engine->Render(sweep.Plane(frame), bigus::ViewOutput::Intensity, image); });
  ExpectSame(ScoreField(field, sweep, {1, 3}, "reference"), expected, 0);
  ExpectSame(ScoreField(field, sweep, {1, 3}), expected, 0.05);  // whichever is fastest, truncated
  EXPECT_THROW(ScoreField(field, sweep, {1}, "no such engine"), Error);
}

TEST(ScoreField, OfAFieldThatMadeTheFramesIsAlmostPerfect)
{
  Sweep sweep = MakeSweep(3);
  const GaussianField field = MakeField();
  const auto engine = Engine::Create("reference");
  engine->SetField(field);
  auto pixels = std::make_shared<std::vector<float>>(3 * sweep.PixelsPerFrame());
  for (int k = 0; k < 3; ++k)
  {
    engine->Render(sweep.Plane(k), bigus::ViewOutput::Intensity, pixels->data() + k * sweep.PixelsPerFrame());
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  EXPECT_GT(ScoreField(field, sweep, {0, 1, 2}).psnr, 75);
}

TEST(ScoreFieldAligned, TellsTrackingErrorFromModellingError)
{
  // Frames the field made exactly, at poses that are a little off: all error is the tracker's.
  Sweep sweep = MakeSweep(3);
  const GaussianField field = MakeField();
  const auto engine = Engine::Create("reference");
  engine->SetField(field);
  auto pixels = std::make_shared<std::vector<float>>(3 * sweep.PixelsPerFrame());
  const double shifts[] = {0, 0.2, 0.1};
  for (int k = 0; k < 3; ++k)
  {
    engine->Render(sweep.Plane(k), bigus::ViewOutput::Intensity, pixels->data() + k * sweep.PixelsPerFrame());
    sweep.imageToReference[k].block<3, 1>(0, 3) += Eigen::Vector3d(0.6, -0.8, 0) * shifts[k];
  }
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  const FrameScores tracked = ScoreField(field, sweep, {1, 2});
  const bigus::AlignedScores aligned = bigus::ScoreFieldAligned(field, sweep, {1, 2});
  EXPECT_EQ(aligned.scores.frames, tracked.frames);
  EXPECT_LT(tracked.psnr, 45);
  EXPECT_GT(aligned.scores.psnr, 65);
  EXPECT_NEAR(aligned.meanTranslation, 0.15, 0.01);
  EXPECT_NEAR(aligned.largestTranslation, 0.2, 0.01);
  EXPECT_LT(aligned.largestRotation, 0.2);
  EXPECT_LE(aligned.meanRotation, aligned.largestRotation);
}

TEST(ScoreBaselines, GivesEachPredictorTheTrainingFramesOnly)
{
  const Sweep sweep = MakeSweep(9);
  const auto [training, heldOut] = bigus::SplitHoldOut(9, 4);
  ASSERT_EQ(heldOut, (std::vector<int>{2, 6}));
  const bigus::BaselineScores scores = ScoreBaselines(sweep, training, heldOut);
  const auto expect = [&, &training = training, &heldOut = heldOut](const FrameScores& found, auto predict)
  {
    ExpectSame(found, ScoreFrames(sweep, heldOut, predict), 0);
    EXPECT_LT(found.psnr, 60) << "the held-out frame was seen";
    EXPECT_GT(found.psnr, 15);
  };
  expect(scores.nearest, [&, &training = training](int frame, float* image)
         { bigus::PredictNearest(sweep, training, sweep.Plane(frame), image); });
  expect(scores.neighbourAverage, [&, &training = training](int frame, float* image)
         { bigus::PredictNeighbourAverage(sweep, training, frame, image); });
  expect(scores.poseInterpolation, [&, &training = training](int frame, float* image)
         { bigus::PredictPoseInterpolation(sweep, training, frame, image); });
  const bigus::Compounding volume(sweep, training);
  expect(scores.compounding, [&](int frame, float* image) { volume.Predict(sweep.Plane(frame), image); });
  EXPECT_EQ(scores.compoundingVoxelSize, volume.VoxelSize());

  // With equal steps and no tilt, averaging the neighbours and interpolating between their poses are the
  // same.
  EXPECT_NEAR(scores.neighbourAverage.psnr, scores.poseInterpolation.psnr, 0.01);
  EXPECT_GT(scores.poseInterpolation.psnr, scores.nearest.psnr);
}
