// How well a field, or a plain baseline, predicts frames it has not seen.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "GaussianField.h"
#include "Metrics.h"
#include "Sweep.h"

namespace bigus
{

/// Scores over a set of frames: each metric per frame, then mean and standard deviation over frames.
struct FrameScores
{
  std::vector<int> frames;
  double psnr = 0, psnrStd = 0;
  double ssim = 0, ssimStd = 0;
  BackscatterFidelity bfs;  ///< term by term, mean over frames
};

/// Scores what `predict(frame, image)` writes against the frames themselves (whole frames, intensities in [0, 1]).
FrameScores ScoreFrames(const Sweep& sweep, const std::vector<int>& frames,
                        const std::function<void(int, float*)>& predict);

/// Scores the field rendered at the frames' tracked poses.
FrameScores ScoreField(const GaussianField& field, const Sweep& sweep, const std::vector<int>& frames,
                       const std::string& engine = "auto");

struct BaselineScores
{
  FrameScores nearest, neighbourAverage, poseInterpolation, compounding;
  double compoundingVoxelSize = 0;  ///< mm
};
BaselineScores ScoreBaselines(const Sweep& sweep, const std::vector<int>& training,
                              const std::vector<int>& heldOut);

}  // namespace bigus
