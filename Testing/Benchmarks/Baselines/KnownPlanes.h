// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Scores at planes that are no frames of a sweep, but whose picture is known: of a volume, or of a phantom.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "Core/Model/SlicePlane.h"

namespace bigus
{

/// A plane, its picture, and where a prediction of it is judged.
struct KnownPlane
{
  SlicePlane plane;
  std::vector<float> truth;          ///< [height][width], intensities in [0, 1]
  std::vector<std::uint8_t> scored;  ///< [height][width], 1 where it counts
};

/// Pixels: the standard deviation of the Gaussian that leaves the structure of a picture. A probe that looks from another
/// side sees other speckle, which no method can know; what is wider than its grains can be known.
constexpr double kStructureSigma = 3;

/// Each number per plane, then mean and (population) standard deviation over planes. A plane met exactly makes the mean
/// infinite; its standard deviation is then given as 0.
struct PlaneScores
{
  int planes = 0;
  double scoredShare = 0;                  ///< of all pixels, those that counted
  double psnr = 0, psnrStd = 0;            ///< dB, over the scored pixels
  double structure = 0, structureStd = 0;  ///< dB, the same once both pictures are smoothed by kStructureSigma
};

/// Scores what `predict(plane, image)` writes; it is called for one plane after another. Smoothing is a weighted mean
/// over the scored pixels alone. Throws Error when there is no plane, or a plane without a scored pixel.
PlaneScores ScorePlanes(const std::vector<KnownPlane>& planes,
                        const std::function<void(const SlicePlane&, float*)>& predict);

}  // namespace bigus
