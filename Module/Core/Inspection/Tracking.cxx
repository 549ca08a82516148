// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Poses that a tracker calls good and that are not.
#include <tbb/parallel_for.h>

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
// Where the pictures on both sides of a jump are neighbours, it is the tracker that jumps, for any number of frames.
constexpr double kNeighbours = 1.5;                          // of the median difference of neighbours, and ...
constexpr double kRelated = 0.6;                             // ... of that of unrelated pictures
constexpr double kAwayLong = 0.25;                           // of all frames that it may then be wrong in a row, ...
constexpr std::size_t kMostAway = 2000;                      // ... and no more: each is looked at from each jump
constexpr double kAsLong = 3;                                // of a jump at an end no more than ...
constexpr std::ptrdiff_t kMostAsLong = 3;                    // ... so many steps, with itself, are such a part or more
constexpr double kSame = 1e-6;                               // mm
constexpr std::size_t kFewestMoving = 4;                     // steps that are longer
constexpr double kGoesOn = 0.5;                              // of what pictures change by where the probe moves
constexpr double kSlowShare = 0.25, kSlowStretches = 0.125;  // of all frames, that a slow tracker's poses stand for

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

/// [steps] whether pictures go on over a step as they do between neighbours.
std::vector<char> WhereTheyGoOn(const Pictures& pictures, const Path& path)
{
  const std::size_t steps = path.steps.size();
  std::vector<double> differences(steps);
  tbb::parallel_for(std::size_t(0), steps,
                    [&](std::size_t k) { differences[k] = Difference(pictures, path.places[k], path.places[k + 1]); });
  const double usual = ShareBelow(differences, 0.5);
  std::vector<char> goOn(steps);
  tbb::parallel_for(std::size_t(0), steps,
                    [&](std::size_t k)
                    {
                      goOn[k] = differences[k] <= kNeighbours * usual &&
                                differences[k] < kRelated * UnrelatedDifference(pictures, path.places[k]);
                    });
  return goOn;
}

/// How many frames the tracker may be wrong in a row where pictures go on over a jump.
std::size_t MostAway(std::size_t frames, std::size_t least)
{
  return std::clamp(static_cast<std::size_t>(kAwayLong * static_cast<double>(frames)), least, kMostAway);
}

/// The place in the path at which it goes on as if the jump of step k had not been; nothing where it does not.
std::optional<std::size_t> BackAfter(const Sweep& sweep, const std::vector<int>& frames, const Path& path,
                                     const std::vector<char>& goOn, std::size_t k)
{
  const double usual = UsualWay(path.ways, k), jump = path.steps[k];
  const std::size_t away = goOn[k] ? MostAway(frames.size(), kAway) : kAway;
  for (std::size_t back = k + 2; back < std::min(path.places.size(), k + away + 2); ++back)
  {
    const double moved = Moved(sweep, frames[path.places[k]], frames[path.places[back]]);
    const bool jumpsBack = path.steps[back - 1] > kShorter * jump;
    // It comes back by a jump, or soon and far enough.
    if (moved <= kBack * usual * static_cast<double>(path.places[back] - path.places[k]) &&
        (back < k + kAway + 2 ? jumpsBack || moved <= kShorter * jump : jumpsBack && goOn[back - 1]))
    {
      return back;
    }
  }
  return std::nullopt;
}

/// Marks what lies between a jump and where the path goes on.
void MarkExcursions(const Sweep& sweep, const std::vector<int>& frames, const Path& path, const std::vector<char>& goOn,
                    Lies& lies)
{
  for (std::size_t k = 0; k < path.steps.size(); ++k)
  {
    const double usual = UsualWay(path.ways, k), jump = path.steps[k];
    if (path.ways[k] <= kReturn * usual || jump <= kLeastJump)
    {
      continue;
    }
    if (const std::optional<std::size_t> back = BackAfter(sweep, frames, path, goOn, k);
        back && (path.ways[k] > kJump * usual || path.steps[*back - 1] > kReturn * usual))
    {
      for (std::size_t away = k + 1; away < *back; ++away)
      {
        lies.away[path.places[away]] = true;
      }
      lies.farthest = std::max(lies.farthest, jump);
      k = *back - 1;
    }
  }
}

/// Marks short ends of the path that lie beyond a jump.
void MarkEnds(const Path& path, const std::vector<char>& goOn, std::size_t frames, Lies& lies)
{
  const std::size_t steps = path.steps.size();
  const auto isSound = [&](std::size_t k) { return !lies.away[path.places[k]] && !lies.away[path.places[k + 1]]; };
  std::vector<double> sound;
  for (std::size_t k = 0; k < steps; ++k)
  {
    if (isSound(k) && path.ways[k] > kSame)
    {
      sound.push_back(path.ways[k]);
    }
  }
  std::sort(sound.begin(), sound.end());
  std::size_t first = 0, last = path.places.size();  // of what stays
  for (std::size_t k = 0; k < steps && sound.size() >= kFewestMoving; ++k)
  {
    // A hand that moves so far elsewhere, too, does not jump, were it beside a rest.
    const auto asLong = sound.end() - std::partition_point(sound.begin(), sound.end(),
                                                           [&](double way) { return kAsLong * way < path.ways[k]; });
    const bool isJump = path.ways[k] > kJump * UsualWay(path.ways, k) && asLong <= kMostAsLong;
    if (path.steps[k] <= kLeastJump || !isSound(k) || !isJump)
    {
      continue;
    }
    const std::size_t most = goOn[k] ? MostAway(frames, kAtAnEnd) : kAtAnEnd;
    first = k < most ? k + 1 : first;
    last = k >= most && k + most >= steps ? std::min(last, k + 1) : last;
    lies.farthest = k < most || k + most >= steps ? std::max(lies.farthest, path.steps[k]) : lies.farthest;
  }
  for (std::size_t k = 0; k < path.places.size(); ++k)
  {
    lies.away[path.places[k]] = lies.away[path.places[k]] || k < first || k >= last;
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

/// Whether poses stand again and again, as those of a tracker that is slower than the pictures do, not in a stretch or two.
bool IsSlowTracker(const std::vector<bool>& stale)
{
  std::size_t frames = 0, stretches = 0;
  for (std::size_t k = 1; k < stale.size(); ++k)
  {
    frames += stale[k];
    stretches += stale[k] && !stale[k - 1];
  }
  return frames >= kSlowShare * static_cast<double>(stale.size()) &&
         stretches >= kSlowStretches * static_cast<double>(stale.size());
}

std::vector<int> Chosen(const std::vector<int>& frames, const std::vector<bool>& which)
{
  std::vector<int> chosen;
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    if (which[k])
    {
      chosen.push_back(frames[k]);
    }
  }
  return chosen;
}

}  // namespace

LostTracking FindLostTracking(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames)
{
  LostTracking found;
  if (frames.size() < kFewest)
  {
    return found;
  }
  Lies lies{std::vector<bool>(frames.size()), std::vector<bool>(frames.size()), 0};
  MarkStale(pictures, StepsOf(sweep, frames), lies);
  const Path path = FreshPath(sweep, frames, lies.stale);
  const std::vector<char> goOn = WhereTheyGoOn(pictures, path);
  MarkExcursions(sweep, frames, path, goOn, lies);
  MarkEnds(path, goOn, frames.size(), lies);
  const std::vector<int> away = Chosen(frames, lies.away), stale = Chosen(frames, lies.stale);
  std::vector<int> gone = away;
  const std::string count = std::to_string(stale.size()) + " have the pose of the frame before, though pictures go on";
  if (IsSlowTracker(lies.stale))
  {
    found.slow = Found(FindingKind::Tracking, stale,
                       count +
                           ", again and again: the tracker is slower than the pictures. A table of poses with the "
                           "tracker's own times gives each frame its own");
    found.slow->isApplied = false;
  }
  else
  {
    gone.insert(gone.end(), stale.begin(), stale.end());
    std::sort(gone.begin(), gone.end());  // none is both
  }
  std::string evidence;
  if (!away.empty())
  {
    evidence = std::to_string(away.size()) + " lie up to " + Format("%.3g", lies.farthest) +
               " mm off a path that goes on without them";
  }
  if (gone.size() > away.size())
  {
    evidence += (away.empty() ? "" : ", ") + count;
  }
  found.lost = Found(FindingKind::Tracking, gone, evidence);
  if (found.lost)
  {
    found.lost->isApplied = 2 * gone.size() < frames.size();
  }
  return found;
}

}  // namespace bigus
