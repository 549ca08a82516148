// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Inspection/Rules.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "Core/Numerics/Format.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

// Lost contact. Brightness of tissue stays within a half and twice the median (liver, brain, spine, wires: 0.48 to 1.49).
constexpr double kDark = 0.15, kLit = 0.5;  // of the median brightness
constexpr double kNoise = 1.5;              // roughness; white noise has 2, frames of the sweeps named 0.1 to 0.6
constexpr double kRougher = 1.6;            // times the median roughness
// A band has few pixels, so its roughness wavers; but noise is unlike what was there before and after, too.
constexpr double kRougherBand = 1.3, kUnlikeBand = 0.5;
constexpr double kDarkestSweep = 2;  // grey levels: below that nothing is told from nothing
constexpr double kDarkestBand = 8;   // grey levels: corners of a fan, and shadows, tell nothing

// Repeated pictures.
constexpr double kNoNews = 0.3;         // grey levels: what rounding to 8 bits alone makes
constexpr double kNearly = 3;           // grey levels that another compression of the same picture changes
constexpr double kLittleChange = 0.2;   // of what changes usually, for such a picture
constexpr double kInFull = 0.5;         // of what changes usually, before or after
constexpr double kUnlikeMotion = 0.25;  // times less change for the same motion than usually

// Rest. From frame to frame pictures of a moving probe change by c d for a small way d, so that over five frames they
// change by 3 to 4 times as much as from one to the next; at rest by as much.
constexpr std::size_t kWindow = 5;         // steps
constexpr std::size_t kFewestWindows = 3;  // in a row
constexpr double kGrowth = 1.3;
constexpr double kAlike = 0.35;       // of the difference of unrelated pictures
constexpr double kDrift = 2;          // spreads of the poses within a half by which the halves of a stretch lie apart
constexpr double kLeastDrift = 0.3;   // mm
constexpr double kLittleNoise = 0.5;  // of the usual change, in a frozen picture

constexpr double kSameLength = 1e-9;  // share of a path's length: a sweep listed backwards has the same

/// How far the means of the two halves of a stretch lie apart, and how far frames lie from the mean of their half, mm.
struct Drift
{
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double apart = 0, spread = 0;
};

Drift DriftOf(const Sweep& sweep, const std::vector<int>& frames, std::size_t first, std::size_t last)
{
  const std::size_t middle = (first + last + 1) / 2;
  const std::array<std::array<std::size_t, 2>, 2> halves = {{{first, middle}, {middle, last + 1}}};
  std::array<Eigen::Vector3d, 2> means;
  double squares = 0;
  for (int half = 0; half < 2; ++half)
  {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t k = halves[half][0]; k < halves[half][1]; ++k)
    {
      sum += CentreOf(sweep.Plane(frames[k]));
    }
    means[half] = sum / static_cast<double>(halves[half][1] - halves[half][0]);
    for (std::size_t k = halves[half][0]; k < halves[half][1]; ++k)
    {
      squares += (CentreOf(sweep.Plane(frames[k])) - means[half]).squaredNorm();
    }
  }
  return {0.5 * (means[0] + means[1]), (means[1] - means[0]).norm(),
          std::sqrt(squares / static_cast<double>(last - first + 1))};
}

/// First and last place of every stretch of frames whose pictures do not drift apart.
std::vector<std::pair<std::size_t, std::size_t>> StillStretches(const Pictures& pictures,
                                                                const std::vector<double>& steps)
{
  std::vector<std::pair<std::size_t, std::size_t>> stretches;
  const std::size_t last = steps.size() + 1 - std::min(kWindow, steps.size() + 1);  // where no window begins any more
  std::vector<char> isStillFrom(last + 1);
  tbb::parallel_for(std::size_t(0), last,
                    [&](std::size_t k)
                    {
                      double squares = 0;
                      for (std::size_t j = 0; j < kWindow; ++j)
                      {
                        squares += steps[k + j] * steps[k + j];
                      }
                      const double all = Difference(pictures, k, k + kWindow);
                      isStillFrom[k] = all <= kGrowth * std::sqrt(squares / kWindow) &&
                                       all < kAlike * UnrelatedDifference(pictures, k);
                    });
  std::size_t windows = 0;
  for (std::size_t k = 0; k <= last; ++k)
  {
    const bool isStill = isStillFrom[k];
    windows = isStill ? windows + 1 : windows;
    if (!isStill && windows > 0)
    {
      if (windows >= kFewestWindows)
      {
        stretches.emplace_back(k - windows, k - 1 + kWindow);
      }
      windows = 0;
    }
  }
  return stretches;
}

/// Frames, by their places, that show nothing, over the whole width or a part.
struct Lost
{
  std::vector<bool> isDark, isNoise;

  explicit Lost(std::size_t frames) : isDark(frames), isNoise(frames) {}

  std::size_t Count() const
  {
    std::size_t count = 0;
    for (std::size_t k = 0; k < isDark.size(); ++k)
    {
      count += isDark[k] || isNoise[k];
    }
    return count;
  }

  /// What each may ask is the place of a frame.
  template <class Dark, class Lit, class Noise>
  void Add(const Dark& dark, const Lit& lit, const Noise& noise)
  {
    const std::size_t frames = isDark.size();
    const auto isBlank = [&](std::size_t k) { return dark(k) || noise(k); };
    for (std::size_t k = 0, end = 0; k < frames; k = std::max(k + 1, end))
    {
      for (end = k; end < frames && isBlank(end); ++end)
      {
      }
      // A sweep that leaves what it shows gets dark little by little; a probe that leaves the skin at once.
      const bool atOnce = (k > 0 && lit(k - 1)) || (end < frames && lit(end));
      for (std::size_t j = k; j < end && (atOnce || !dark(k)); ++j)
      {
        isDark[j] = isDark[j] || dark(j);
        isNoise[j] = isNoise[j] || !dark(j);
      }
    }
  }
};

/// Of each number the median.
Band UsualBand(const Pictures& pictures, std::size_t band)
{
  std::vector<double> near, deep, roughness;
  for (const std::array<Band, kBands>& bands : pictures.bands)
  {
    near.push_back(bands[band].near);
    deep.push_back(bands[band].deep);
    roughness.push_back(bands[band].roughness);
  }
  return {ShareBelow(near, 0.5), ShareBelow(deep, 0.5), ShareBelow(roughness, 0.5)};
}

/// Marks frames that show nothing in a quarter of their width. `lost` has those that show nothing at all.
void AddBands(const Pictures& pictures, Lost& lost)
{
  std::vector<std::size_t> sound;  // places
  for (std::size_t k = 0; k < pictures.small.size(); ++k)
  {
    if (!lost.isDark[k] && !lost.isNoise[k])
    {
      sound.push_back(k);
    }
  }
  for (std::size_t b = 0; b < kBands; ++b)
  {
    const Band typical = UsualBand(pictures, b);
    if (typical.near < kDarkestBand || typical.deep < kDarkestBand || sound.size() < 2)
    {
      continue;
    }
    std::vector<double> alike(pictures.small.size(), 0.0);  // the frame before or after it, whichever is more
    std::vector<double> before(sound.size() - 1);
    tbb::parallel_for(std::size_t(0), before.size(),
                      [&](std::size_t k) { before[k] = AlikeIn(b, pictures, sound[k], sound[k + 1]); });
    for (std::size_t k = 0; k < before.size(); ++k)
    {
      alike[sound[k]] = std::max(alike[sound[k]], before[k]);
      alike[sound[k + 1]] = before[k];
    }
    const double usual = ShareBelow(before, 0.5);
    const auto band = [&](std::size_t k) { return pictures.bands[k][b]; };
    lost.Add([&](std::size_t k) { return band(k).near < kDark * typical.near && band(k).deep < kDark * typical.deep; },
             [&](std::size_t k) { return band(k).near >= kLit * typical.near && band(k).deep >= kLit * typical.deep; },
             [&](std::size_t k)
             {
               return std::binary_search(sound.begin(), sound.end(), k) && alike[k] < kUnlikeBand * usual &&
                      band(k).roughness > std::max(kNoise, kRougherBand * typical.roughness);
             });
  }
}

}  // namespace

double ShareBelow(std::vector<double> values, double share)
{
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : Quantile(values, share);
}

std::vector<double> StepsOf(const Sweep& sweep, const std::vector<int>& frames)
{
  std::vector<double> steps;
  for (std::size_t k = 1; k < frames.size(); ++k)
  {
    steps.push_back(Moved(sweep, frames[k - 1], frames[k]));
  }
  return steps;
}

std::optional<Finding> Found(FindingKind kind, std::vector<int> frames, std::string evidence)
{
  if (frames.empty())
  {
    return std::nullopt;
  }
  return Finding{kind, std::move(frames), 0, true, std::move(evidence)};
}

double Moved(const Sweep& sweep, int from, int to)
{
  const SlicePlane one = sweep.Plane(from), other = sweep.Plane(to);
  double farthest = 0;
  for (const double i : {0.0, sweep.width - 1.0})
  {
    for (const double j : {0.0, sweep.height - 1.0})
    {
      farthest = std::max(farthest, (other.Point(i, j) - one.Point(i, j)).norm());
    }
  }
  return farthest;
}

std::optional<Finding> FindOrder(const Sweep& sweep, std::vector<int>& sorted)
{
  sorted = AllFrames(sweep);
  const std::vector<double>& times = sweep.timestamps;
  if (times.empty() || std::is_sorted(times.begin(), times.end()))
  {
    return std::nullopt;
  }
  const std::vector<int> listed = sorted;
  std::stable_sort(sorted.begin(), sorted.end(), [&times](int a, int b) { return times[a] < times[b]; });
  const auto length = [&sweep](const std::vector<int>& frames)
  {
    const std::vector<double> steps = StepsOf(sweep, frames);
    return std::accumulate(steps.begin(), steps.end(), 0.0);
  };
  std::vector<int> moved;
  for (std::size_t k = 0; k < sorted.size(); ++k)
  {
    if (sorted[k] != listed[k])
    {
      moved.push_back(listed[k]);
    }
  }
  const double asListed = length(listed), byTime = length(sorted);
  std::optional<Finding> found = Found(FindingKind::Order, moved,
                                       "the probe's path is " + Format("%.0f", byTime) + " mm long by time and " +
                                           Format("%.0f", asListed) + " mm as listed");
  found->isApplied = byTime <= (1 + kSameLength) * asListed;  // else times are the worse witness
  return found;
}

std::optional<Finding> FindLostContact(const Pictures& pictures, const std::vector<int>& frames)
{
  const double usual = ShareBelow(pictures.brightness, 0.5), rough = ShareBelow(pictures.roughness, 0.5);
  if (usual < kDarkestSweep)
  {
    return std::nullopt;
  }
  Lost lost(frames.size());
  lost.Add([&](std::size_t k) { return pictures.brightness[k] < kDark * usual; },
           [&](std::size_t k) { return pictures.brightness[k] >= kLit * usual; },
           [&](std::size_t k) { return pictures.roughness[k] > std::max(kNoise, kRougher * rough); });
  const std::size_t whole = lost.Count();
  AddBands(pictures, lost);
  std::vector<int> gone;
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    if (lost.isDark[k] || lost.isNoise[k])
    {
      gone.push_back(frames[k]);
    }
  }
  const auto dark = std::count(lost.isDark.begin(), lost.isDark.end(), true);
  const std::string evidence = std::to_string(dark) + " darker than " + Format("%.0f", 100 * kDark) +
                               " % of the usual brightness, " + std::to_string(lost.Count() - dark) +
                               " with noise without speckle, " + std::to_string(lost.Count() - whole) +
                               " of them in a part of the width";
  std::optional<Finding> found = Found(FindingKind::Contact, gone, evidence);
  if (found)
  {
    found->isApplied = 2 * gone.size() < frames.size();
  }
  return found;
}

std::optional<Finding> FindRepeats(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames)
{
  const std::vector<double> steps = StepsOf(sweep, frames);
  const std::vector<double> changes(pictures.change.begin() + 1, pictures.change.end());
  const double usual = ShareBelow(changes, 0.75), usualStep = ShareBelow(steps, 0.75);
  std::vector<int> repeated;
  double largest = 0;
  for (std::size_t k = 1, shown = 0; k < frames.size(); ++k)
  {
    // `shown` is the last frame with a picture of its own; `end` comes after those that repeat it.
    std::size_t end = k;
    double most = 0;
    for (; end < frames.size(); ++end)
    {
      const double change = std::max(changes[end - 1], Difference(pictures, shown, end));
      const bool isLittle = change < std::min(kLittleChange * usual, kNearly) &&
                            change * usualStep < kUnlikeMotion * usual * steps[end - 1];
      if (change >= kNoNews && !isLittle)
      {
        break;
      }
      most = std::max(most, change);
    }
    // A probe that sets out slowly changes its picture little, then a little more; after a repeat it changes in full.
    const double before = shown > 0 ? changes[shown - 1] : 0, after = end < frames.size() ? changes[end - 1] : 0;
    if (most < kNoNews || std::max(before, after) >= kInFull * usual)
    {
      repeated.insert(repeated.end(), frames.begin() + k, frames.begin() + end);
      largest = std::max(largest, most);
    }
    k = end;
    shown = end;
  }
  return Found(FindingKind::Repeat, repeated,
               "pictures changed by " + Format("%.2f", largest) + " grey levels at the most, and by " +
                   Format("%.2f", usual) + " from frame to frame elsewhere");
}

Still FindStill(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames)
{
  std::vector<double> steps;
  for (std::size_t k = 1; k < frames.size(); ++k)
  {
    steps.push_back(Difference(pictures, k - 1, k));
  }
  const double usual = ShareBelow(steps, 0.75);
  std::vector<int> resting, frozen;
  double spread = 0;
  for (const auto& [first, last] : StillStretches(pictures, steps))
  {
    const Drift drift = DriftOf(sweep, frames, first, last);
    const bool drifts = drift.apart > std::max(kDrift * drift.spread, kLeastDrift);
    // A scene that is the same along the sweep changes as little everywhere.
    if (drifts && ShareBelow({steps.begin() + first, steps.begin() + last}, 0.5) > kLittleNoise * usual)
    {
      continue;
    }
    std::size_t kept = first;  // of a frozen picture the first, which was taken where it says
    const auto distance = [&](std::size_t place) { return (CentreOf(sweep.Plane(frames[place])) - drift.mean).norm(); };
    for (std::size_t k = first; k <= last && !drifts; ++k)
    {
      kept = distance(k) < distance(kept) ? k : kept;
    }
    for (std::size_t k = first; k <= last; ++k)
    {
      if (k != kept)
      {
        (drifts ? frozen : resting).push_back(frames[k]);
      }
    }
    spread = drifts ? spread : std::max(spread, drift.spread);
  }
  Still still;
  still.rest = Found(FindingKind::Rest, resting,
                     "pictures change no more over " + std::to_string(kWindow) +
                         " frames than from one to the next, and poses stay within " + Format("%.2f", spread) + " mm");
  still.repeat = Found(FindingKind::Repeat, frozen, "only noise changes while the poses go on");
  return still;
}

}  // namespace bigus
