// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Poses that a tracker calls good and that are not.
#include <algorithm>
#include <optional>

#include "Core/Inspection/Rules.h"
#include "Core/Numerics/Format.h"

namespace bigus
{
namespace
{

constexpr std::size_t kFewest = 12;  // frames, to tell what is usual
constexpr std::size_t kAround = 8;   // steps before and after, whose medians tell what is usual there
constexpr double kJump = 8;          // usual steps; a hand that starts does not: on one side they are as long
constexpr double kLeastJump = 0.5;   // mm
constexpr std::size_t kAway = 8;     // frames that the tracker may be wrong in a row
constexpr double kBack = 2.5;        // usual steps a frame, for the way from before a jump to after it, ...
constexpr double kShorter = 0.5;     // ... and jumps
constexpr std::size_t kAtAnEnd = 3;  // frames before the first jump, or after the last, that hardly are a stroke
constexpr double kSame = 1e-6;       // mm
constexpr double kGoesOn = 0.5;      // of what pictures change by where the probe moves

struct Lies
{
  std::vector<bool> away, stale;  // [places]
  double farthest = 0;            // mm
};

/// The longer of the median steps before and after step k: where the speed changes, the faster is usual.
double UsualStep(const std::vector<double>& steps, std::size_t k)
{
  const auto at = steps.begin() + static_cast<std::ptrdiff_t>(k);
  const auto first = steps.begin() + static_cast<std::ptrdiff_t>(k - std::min(k, kAround));
  const auto last = at + 1 + static_cast<std::ptrdiff_t>(std::min(steps.size() - k - 1, kAround));
  return std::max(ShareBelow({first, at}, 0.5), ShareBelow({at + 1, last}, 0.5));
}

/// The place at which the path goes on as if the jump of step k had not been; nothing where it does not.
std::optional<std::size_t> BackAfter(const Sweep& sweep, const std::vector<int>& frames,
                                     const std::vector<double>& steps, std::size_t k)
{
  for (std::size_t back = k + 2; back < std::min(frames.size(), k + kAway + 2); ++back)
  {
    const double way = kBack * UsualStep(steps, k) * static_cast<double>(back - k);
    if (Moved(sweep, frames[k], frames[back]) <= std::min(way, kShorter * steps[k]))
    {
      return back;
    }
  }
  return std::nullopt;
}

/// Marks what lies between a jump and where the path goes on, and short ends from which it does not.
void MarkAway(const Sweep& sweep, const std::vector<int>& frames, const std::vector<double>& steps, Lies& lies)
{
  const auto mark = [&](std::size_t first, std::size_t end, double jump)
  {
    std::fill_n(lies.away.begin() + static_cast<std::ptrdiff_t>(first), end - first, true);
    lies.farthest = std::max(lies.farthest, jump);
  };
  for (std::size_t k = 0; k < steps.size(); ++k)
  {
    if (steps[k] <= std::max(kJump * UsualStep(steps, k), kLeastJump))
    {
      continue;
    }
    if (const std::optional<std::size_t> back = BackAfter(sweep, frames, steps, k))
    {
      mark(k + 1, *back, steps[k]);
      k = *back - 1;
    }
    else if (k < kAtAnEnd)
    {
      mark(0, k + 1, steps[k]);
    }
    else if (k + kAtAnEnd >= steps.size())
    {
      mark(k + 1, frames.size(), steps[k]);
    }
  }
}

/// Marks frames whose pose is that of the frame before, though pictures change as they do where poses move.
void MarkStale(const Pictures& pictures, const std::vector<double>& steps, Lies& lies)
{
  std::vector<double> moving;
  for (std::size_t k = 0; k < steps.size(); ++k)
  {
    if (steps[k] > kSame)
    {
      moving.push_back(Difference(pictures, k, k + 1));
    }
  }
  const double usual = ShareBelow(moving, 0.5);
  for (std::size_t k = 0; k < steps.size() && 2 * moving.size() > steps.size(); ++k)
  {
    lies.stale[k + 1] = steps[k] <= kSame && Difference(pictures, k, k + 1) > kGoesOn * usual;
  }
}

}  // namespace

std::optional<Finding> FindLostTracking(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames)
{
  if (frames.size() < kFewest)
  {
    return std::nullopt;
  }
  const std::vector<double> steps = StepsOf(sweep, frames);
  Lies lies{std::vector<bool>(frames.size()), std::vector<bool>(frames.size()), 0};
  MarkAway(sweep, frames, steps, lies);
  MarkStale(pictures, steps, lies);
  std::vector<int> gone;
  std::size_t away = 0;
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    away += lies.away[k];
    if (lies.away[k] || lies.stale[k])
    {
      gone.push_back(frames[k]);
    }
  }
  std::string evidence;
  if (away > 0)
  {
    evidence = std::to_string(away) + " lie up to " + Format("%.3g", lies.farthest) +
               " mm off a path that goes on without them";
  }
  if (gone.size() > away)
  {
    evidence += (away > 0 ? ", " : "") + std::to_string(gone.size() - away) +
                " have the pose of the frame before, though pictures go on";
  }
  std::optional<Finding> found = Found(FindingKind::Tracking, gone, evidence);
  if (found)
  {
    found->isApplied = 2 * gone.size() < frames.size();
  }
  return found;
}

}  // namespace bigus
