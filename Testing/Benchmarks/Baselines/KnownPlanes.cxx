// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "KnownPlanes.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "Core/Metrics/Metrics.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

/// Gaussian mean over the pixels that count: (G * (m I)) / (G * m), with 0 beyond the image.
class Smoother
{
public:
  explicit Smoother(const KnownPlane& known) : known_(known), weight_(known.plane.height, known.plane.width, CV_32F)
  {
    std::copy(known.scored.begin(), known.scored.end(), weight_.begin<float>());
    Blur(weight_);
  }

  /// `image` where it counts, smoothed.
  std::vector<float> ScoredPixels(const float* image) const
  {
    cv::Mat masked(weight_.size(), CV_32F);
    auto* pixels = masked.ptr<float>();
    for (std::size_t p = 0; p < known_.scored.size(); ++p)
    {
      pixels[p] = known_.scored[p] ? image[p] : 0;
    }
    Blur(masked);
    std::vector<float> smooth;
    for (std::size_t p = 0; p < known_.scored.size(); ++p)
    {
      if (known_.scored[p])
      {
        smooth.push_back(pixels[p] / weight_.ptr<float>()[p]);
      }
    }
    return smooth;
  }

private:
  static void Blur(cv::Mat& image)
  {
    cv::GaussianBlur(image, image, cv::Size(), kStructureSigma, kStructureSigma, cv::BORDER_CONSTANT);
  }

  const KnownPlane& known_;
  cv::Mat weight_;
};

std::vector<float> ScoredPixels(const KnownPlane& known, const float* image)
{
  std::vector<float> pixels;
  for (std::size_t p = 0; p < known.scored.size(); ++p)
  {
    if (known.scored[p])
    {
      pixels.push_back(image[p]);
    }
  }
  return pixels;
}

}  // namespace

PlaneScores ScorePlanes(const std::vector<KnownPlane>& planes,
                        const std::function<void(const SlicePlane&, float*)>& predict)
{
  if (planes.empty())
  {
    throw Error("Scores: there is no plane to score.");
  }
  PlaneScores scores;
  scores.planes = static_cast<int>(planes.size());
  std::vector<double> psnr, structure;
  double scored = 0, all = 0;
  for (const KnownPlane& known : planes)
  {
    std::vector<float> image(known.plane.NumberOfPixels());
    predict(known.plane, image.data());
    const std::vector<float> pixels = ScoredPixels(known, image.data());
    if (pixels.empty())
    {
      throw Error("Scores: a plane has no pixel that counts.");
    }
    scored += static_cast<double>(pixels.size());
    all += static_cast<double>(image.size());
    psnr.push_back(Psnr(pixels.data(), ScoredPixels(known, known.truth.data()).data(), pixels.size()));
    const Smoother smoother(known);
    structure.push_back(Psnr(smoother.ScoredPixels(image.data()).data(),
                             smoother.ScoredPixels(known.truth.data()).data(), pixels.size()));
  }
  scores.scoredShare = scored / all;
  scores.psnr = Mean(psnr);
  scores.psnrStd = Deviation(psnr);
  scores.structure = Mean(structure);
  scores.structureStd = Deviation(structure);
  return scores;
}

}  // namespace bigus
