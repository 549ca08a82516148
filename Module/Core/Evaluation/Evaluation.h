// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How well a field, or a plain baseline, predicts frames it has not seen.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "Core/Metrics/BackscatterFidelity.h"
#include "Core/Metrics/Texture.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/Sweep.h"
#include "Core/Model/ViewDependence.h"
#include "Core/Poses/Alignment.h"

namespace bigus
{

/// Scores over a set of frames: each metric per frame, then mean and (population) standard deviation over frames. A
/// frame met exactly makes the mean PSNR infinite; its standard deviation is then given as 0.
struct FrameScores
{
  std::vector<int> frames;
  double psnr = 0, psnrStd = 0;  ///< dB
  double ssim = 0, ssimStd = 0;  ///< valid windows
  BackscatterFidelity bfs;       ///< term by term, mean over frames
  TextureComparison texture;     ///< number by number, mean over frames
};

/// Scores what `predict(frame, image)` writes against the frames themselves: whole frames, black where the sweep's mask
/// says that the probe lights nothing (see Sweep::LitBy). It is called for one frame after another. Throws Error when
/// there is no frame to score, or frames are below 11 x 11.
FrameScores ScoreFrames(const Sweep& sweep, const std::vector<int>& frames,
                        const std::function<void(int, float*)>& predict);

/// Scores the field rendered at the frames' poses in the sweep, with its view dependence unless that is null.
FrameScores ScoreField(const GaussianField& field, const Sweep& sweep, const std::vector<int>& frames,
                       const std::string& engine = "auto", const ViewDependence* view = nullptr);

/// A diagnostic, not a prediction: the frame itself chose the pose it is scored at. What it gains over ScoreField is
/// the share of the error that tracking (or tissue that moved as a whole) explains; what remains is the model's.
struct AlignedScores
{
  FrameScores scores;                                  ///< at the aligned poses
  double meanTranslation = 0, largestTranslation = 0;  ///< mm, of the motions found, over frames
  double meanRotation = 0, largestRotation = 0;        ///< degrees
};

/// Scores the field at poses rigidly aligned to it, frame by frame (see Alignment.h), each with the reflectivities of the
/// frame's own pose.
AlignedScores ScoreFieldAligned(const GaussianField& field, const Sweep& sweep, const std::vector<int>& frames,
                                const std::string& engine = "auto", const ViewDependence* view = nullptr);

/// What the predictors of Baselines.h reach on the same frames. Nearest and compounding are given the held-out pose;
/// neighbour average and pose interpolation the held-out frame's place in the sequence.
struct BaselineScores
{
  FrameScores nearest, neighbourAverage, poseInterpolation, compounding;
  double compoundingVoxelSize = 0;  ///< mm
};
BaselineScores ScoreBaselines(const Sweep& sweep, const std::vector<int>& training, const std::vector<int>& heldOut);

}  // namespace bigus
