// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/Densification.h"

#include <algorithm>
#include <cmath>

namespace bigus
{
namespace
{

/// Pixels: a Gaussian whose largest scale is above this is split, a smaller one cloned. Two standard deviations of one
/// pixel each are about what pixels can tell apart.
constexpr double kSplitScale = 2.0;

/// Children lie this many standard deviations to either side of a split Gaussian, along the split axis.
constexpr double kOffset = 0.75;

/// A clone starts this far from its twin, in standard deviations along the descent direction, so that they can part.
constexpr double kNudge = 0.25;

/// Each of a cloned pair gets this share of r, so that the two render about what the one did.
constexpr double kCloneReflectivity = 0.5;

/// A Gaussian with |r| below this share of the mean |r| is negligible.
constexpr double kPruneReflectivity = 0.01;

}  // namespace

Restructured Densify(const GaussianField& field, const Engine::Scores& scores, double pixelSize,
                     const DensificationOptions& options)
{
  const std::size_t n = field.Size();
  double meanReflectivity = 0;
  for (double r : field.reflectivities)
  {
    meanReflectivity += std::abs(r) / static_cast<double>(std::max<std::size_t>(n, 1));
  }

  // E_i for each frame that saw the Gaussian: else those in many frames would always win.
  std::vector<double> error(n, 0.0);
  std::vector<char> keep(n);
  std::vector<double> ranked;
  for (std::size_t i = 0; i < n; ++i)
  {
    keep[i] = scores.visits[i] > 0 && std::abs(field.reflectivities[i]) >= kPruneReflectivity * meanReflectivity;
    if (keep[i])
    {
      error[i] = scores.error[i] / scores.visits[i];
      ranked.push_back(error[i]);
    }
  }

  Restructured out;
  out.field.beam = field.beam;
  out.field.transfer = field.transfer;
  const auto add = [&](std::size_t i, const Eigen::Vector3d& mean, const Eigen::Vector3d& scale, double r, int parent)
  {
    out.field.means.push_back(mean);
    out.field.scales.push_back(scale);
    out.field.rotations.push_back(field.rotations[i]);
    out.field.reflectivities.push_back(r);
    out.parents.push_back(parent);
  };

  // The worst of those above the percentile, as many as the cap leaves room for.
  std::vector<char> densify(n, 0);
  const std::size_t kept = ranked.size();
  const std::size_t room = options.cap > kept ? options.cap - kept : 0;
  const std::size_t wanted = std::min(
      room, static_cast<std::size_t>(std::lround((100.0 - options.percentile) / 100.0 * static_cast<double>(kept))));
  if (wanted > 0)
  {
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < n; ++i)
    {
      if (keep[i] && error[i] > 0)
      {
        order.push_back(i);
      }
    }
    const std::size_t count = std::min(wanted, order.size());
    // Ties are broken by index, so that the choice does not depend on the sort.
    std::partial_sort(order.begin(), order.begin() + count, order.end(),
                      [&error](std::size_t a, std::size_t b)
                      { return error[a] != error[b] ? error[a] > error[b] : a < b; });
    for (std::size_t k = 0; k < count; ++k)
    {
      densify[order[k]] = 1;
    }
  }

  for (std::size_t i = 0; i < n; ++i)
  {
    if (!keep[i])
    {
      ++out.pruned;
      continue;
    }
    const Eigen::Vector3d& mean = field.means[i];
    const Eigen::Vector3d& scale = field.scales[i];
    const double r = field.reflectivities[i];
    if (!densify[i])
    {
      add(i, mean, scale, r, static_cast<int>(i));
      continue;
    }
    const Eigen::Matrix3d axes = RotationMatrix(field.rotations[i]);
    // The descent direction in whitened coordinates tells along which axis the Gaussian is pulled most.
    Eigen::Vector3d pull = (axes.transpose() * scores.descent[i]).cwiseProduct(scale);
    if (!(pull.norm() > 0))
    {
      pull = scale;  // no pull at all: along its longest extent
    }
    if (scale.maxCoeff() > kSplitScale * pixelSize)
    {
      // Two children with half the mass and, together, the covariance of their parent.
      int axis;
      pull.cwiseAbs().maxCoeff(&axis);
      const double shrink = std::sqrt(1.0 - kOffset * kOffset);
      Eigen::Vector3d childScale = scale;
      childScale[axis] *= shrink;
      const Eigen::Vector3d offset = kOffset * scale[axis] * axes.col(axis);
      add(i, mean + offset, childScale, 0.5 * r / shrink, -1);
      add(i, mean - offset, childScale, 0.5 * r / shrink, -1);
      ++out.split;
    }
    else
    {
      const Eigen::Vector3d step = kNudge * (axes * pull.normalized().cwiseProduct(scale));
      add(i, mean, scale, kCloneReflectivity * r, static_cast<int>(i));
      add(i, mean + step, scale, kCloneReflectivity * r, -1);
      ++out.cloned;
    }
  }
  return out;
}

void Densify(Engine& engine, double pixelSize, const DensificationOptions& options)
{
  const Restructured next = Densify(engine.GetField(), engine.GetScores(), pixelSize, options);
  if (next.field.Size() > 0)
  {
    engine.SetField(next.field, &next.parents);
  }
  engine.ResetScores();
}

void RemoveInvisible(GaussianField& field, double tolerance)
{
  std::size_t kept = 0;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    if (std::abs(field.reflectivities[i]) * field.transfer.gamma >= tolerance || (i + 1 == field.Size() && kept == 0))
    {
      field.means[kept] = field.means[i];
      field.scales[kept] = field.scales[i];
      field.rotations[kept] = field.rotations[i];
      field.reflectivities[kept] = field.reflectivities[i];
      ++kept;
    }
  }
  field.Resize(kept);
}

}  // namespace bigus
