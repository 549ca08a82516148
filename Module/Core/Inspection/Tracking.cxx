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
constexpr std::size_t kFewestWays = 3;
constexpr double kJump = 8;          // usual ways a frame; a hand that starts does not: on one side they are as long
constexpr double kReturn = 5;        // the same of a jump that is followed by another one back
constexpr double kLeastJump = 0.5;   // mm
constexpr std::size_t kAway = 8;     // frames that the tracker may be wrong in a row
constexpr double kBack = 2.5;        // usual ways a frame, for the way from before a jump to after it, ...
constexpr double kShorter = 0.5;     // ... and jumps, if it does not come back by a jump of such a size itself
constexpr std::size_t kAtAnEnd = 3;  // frames before the first jump, or after the last, that hardly are a stroke
constexpr double kSame = 1e-6;       // mm
constexpr std::size_t kFewestMoving = 4;  // steps that are longer
constexpr double kGoesOn = 0.5;           // of what pictures change by where the probe moves

struct Lies
{
  std::vector<bool> away, stale;  // [places]
  double farthest = 0;            // mm
};

/// The probe's path without frames whose pose is stale.
struct Path
{
  std::vector<std::size_t> places;  // among all frames
  std::vector<double> steps, ways;  // from each place to the next: mm, and mm a frame
};

Path FreshPath(const Sweep& sweep, const std::vector<int>& frames, const std::vector<bool>& stale)
{
  Path path;
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    if (stale[k])
    {
      continue;
    }
    if (!path.places.empty())
    {
      path.steps.push_back(Moved(sweep, frames[path.places.back()], frames[k]));
      path.ways.push_back(path.steps.back() / static_cast<double>(k - path.places.back()));
    }
    path.places.push_back(k);
  }
  return path;
}

/// The longer of the median ways before and after step k: where the speed changes, the faster is usual. Fewer than three ways
/// tell nothing, for one or two may be jumps.
double UsualWay(const std::vector<double>& ways, std::size_t k)
{
  const auto at = ways.begin() + static_cast<std::ptrdiff_t>(k);
  const auto median = [](std::vector<double> some)
  { return some.size() < kFewestWays ? 0 : ShareBelow(std::move(some), 0.5); };
  return std::max(median({at - static_cast<std::ptrdiff_t>(std::min(k, kAround)), at}),
                  median({at + 1, at + 1 + static_cast<std::ptrdiff_t>(std::min(ways.size() - k - 1, kAround))}));
}

/// The place in the path at which it goes on as if the jump of step k had not been; nothing where it does not.
std::optional<std::size_t> BackAfter(const Sweep& sweep, const std::vector<int>& frames, const Path& path,
                                     std::size_t k)
{
  const double usual = UsualWay(path.ways, k), jump = path.steps[k];
  for (std::size_t back = k + 2; back < std::min(path.places.size(), k + kAway + 2); ++back)
  {
    const double moved = Moved(sweep, frames[path.places[k]], frames[path.places[back]]);
    // It comes back by a jump, or at least far enough.
    if (moved <= kBack * usual * static_cast<double>(path.places[back] - path.places[k]) &&
        (moved <= kShorter * jump || path.steps[back - 1] > kShorter * jump))
    {
      return back;
    }
  }
  return std::nullopt;
}

/// Marks what lies between a jump and where the path goes on, and short ends from which it does not.
void MarkAway(const Sweep& sweep, const std::vector<int>& frames, Lies& lies)
{
  const Path path = FreshPath(sweep, frames, lies.stale);
  const std::size_t steps = path.steps.size();
  const auto mark = [&](std::size_t first, std::size_t end, double jump)
  {
    for (std::size_t k = first; k < end; ++k)
    {
      lies.away[path.places[k]] = true;
    }
    lies.farthest = std::max(lies.farthest, jump);
  };
  for (std::size_t k = 0; k < steps; ++k)
  {
    const double usual = UsualWay(path.ways, k), jump = path.steps[k];
    if (path.ways[k] <= kReturn * usual || jump <= kLeastJump)
    {
      continue;
    }
    const bool isJump = path.ways[k] > kJump * usual;
    if (const std::optional<std::size_t> back = BackAfter(sweep, frames, path, k);
        back && (isJump || path.steps[*back - 1] > kReturn * usual))
    {
      mark(k + 1, *back, jump);
      k = *back - 1;
    }
    else if (isJump && k < kAtAnEnd)
    {
      mark(0, k + 1, jump);
    }
    else if (isJump && k + kAtAnEnd >= steps)
    {
      mark(k + 1, path.places.size(), jump);
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
  for (std::size_t k = 0; k < steps.size() && moving.size() >= kFewestMoving; ++k)
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
  Lies lies{std::vector<bool>(frames.size()), std::vector<bool>(frames.size()), 0};
  MarkStale(pictures, StepsOf(sweep, frames), lies);
  MarkAway(sweep, frames, lies);
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
