// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/Densification.h"

#include <algorithm>
#include <cmath>

#include "Core/Model/FieldTransform.h"

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

/// Whether a Gaussian stays: some frame saw it, and |r| is not negligible.
std::vector<char> Kept(const GaussianField& field, const Engine::Scores& scores)
{
  const std::size_t n = field.Size();
  double meanReflectivity = 0;
  for (double r : field.reflectivities)
  {
    meanReflectivity += std::abs(r) / static_cast<double>(std::max<std::size_t>(n, 1));
  }
  std::vector<char> keep(n);
  for (std::size_t i = 0; i < n; ++i)
  {
    keep[i] = scores.visits[i] > 0 && std::abs(field.reflectivities[i]) >= kPruneReflectivity * meanReflectivity;
  }
  return keep;
}

/// The worst of those kept above the percentile, as many as the cap leaves room for.
std::vector<char> Worst(const std::vector<char>& keep, const Engine::Scores& scores,
                        const DensificationOptions& options)
{
  // E_i for each frame that saw the Gaussian: else those in many frames would always win.
  std::vector<double> error(keep.size(), 0.0);
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < keep.size(); ++i)
  {
    error[i] = keep[i] ? scores.error[i] / scores.visits[i] : 0.0;
    if (error[i] > 0)
    {
      order.push_back(i);
    }
  }
  const std::size_t kept = std::count(keep.begin(), keep.end(), 1);
  const std::size_t room = options.cap > kept ? options.cap - kept : 0;
  const long wanted = std::lround((100.0 - options.percentile) / 100.0 * static_cast<double>(kept));
  const std::size_t count = std::min({room, static_cast<std::size_t>(wanted), order.size()});
  // Ties are broken by index, so that the choice does not depend on the sort.
  std::partial_sort(order.begin(), order.begin() + count, order.end(),
                    [&error](std::size_t a, std::size_t b)
                    { return error[a] != error[b] ? error[a] > error[b] : a < b; });
  std::vector<char> worst(keep.size(), 0);
  for (std::size_t k = 0; k < count; ++k)
  {
    worst[order[k]] = 1;
  }
  return worst;
}

/// Adds a Gaussian with the orientation of Gaussian i.
void Add(const GaussianField& field, std::size_t i, const Eigen::Vector3d& mean, const Eigen::Vector3d& scale, double r,
         int parent, Restructured& out)
{
  out.field.means.push_back(mean);
  out.field.scales.push_back(scale);
  out.field.rotations.push_back(field.rotations[i]);
  out.field.reflectivities.push_back(r);
  out.parents.push_back(parent);
}

/// Two Gaussians in place of Gaussian i. `descent` is where its mean is pulled to.
void SplitOrClone(const GaussianField& field, std::size_t i, const Eigen::Vector3d& descent, double pixelSize,
                  Restructured& out)
{
  const Eigen::Vector3d& mean = field.means[i];
  const Eigen::Vector3d& scale = field.scales[i];
  const double r = field.reflectivities[i];
  const Eigen::Matrix3d axes = RotationMatrix(field.rotations[i]);
  // The descent direction in whitened coordinates tells along which axis the Gaussian is pulled most.
  Eigen::Vector3d pull = (axes.transpose() * descent).cwiseProduct(scale);
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
    Add(field, i, mean + offset, childScale, 0.5 * r / shrink, -1, out);
    Add(field, i, mean - offset, childScale, 0.5 * r / shrink, -1, out);
  }
  else
  {
    const Eigen::Vector3d step = kNudge * (axes * pull.normalized().cwiseProduct(scale));
    Add(field, i, mean, scale, kCloneReflectivity * r, static_cast<int>(i), out);
    Add(field, i, mean + step, scale, kCloneReflectivity * r, -1, out);
  }
}

}  // namespace

Restructured Densify(const GaussianField& field, const Engine::Scores& scores, double pixelSize,
                     const DensificationOptions& options)
{
  const std::vector<char> keep = Kept(field, scores), worst = Worst(keep, scores, options);
  Restructured out;
  out.field.beam = field.beam;
  out.field.transfer = field.transfer;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    if (worst[i])
    {
      SplitOrClone(field, i, scores.descent[i], pixelSize, out);
    }
    else if (keep[i])
    {
      Add(field, i, field.means[i], field.scales[i], field.reflectivities[i], static_cast<int>(i), out);
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
  bool isAnyLeft = false;
  const std::size_t last = field.Size() - 1;
  Keep(field,
       [&](std::size_t i)
       {
         const bool isVisible = std::abs(field.reflectivities[i]) * field.transfer.gamma >= tolerance;
         isAnyLeft = isAnyLeft || isVisible;
         return isVisible || (i == last && !isAnyLeft);
       });
}

}  // namespace bigus
