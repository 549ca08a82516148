// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The rules of Inspect, one for each kind of finding. Frames are those of one sequence, by their numbers in its sweep.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "Core/Inspection/Inspection.h"
#include "Core/Inspection/Pictures.h"

namespace bigus
{

/// The longest way that a corner of the image goes from one frame to another, mm.
double Moved(const Sweep& sweep, int from, int to);

/// The same from each frame to the next.
std::vector<double> StepsOf(const Sweep& sweep, const std::vector<int>& frames);

/// The value below which `share` of all lie; 0 of none.
double ShareBelow(std::vector<double> values, double share);

/// A finding that something is done about; nothing where there are no frames.
std::optional<Finding> Found(FindingKind kind, std::vector<int> frames, std::string evidence);

/// Frames that another order of times would move; `sorted` gets that order. Nothing where the order is that of times.
std::optional<Finding> FindOrder(const Sweep& sweep, std::vector<int>& sorted);

/// Frames that are dark, or noise, all over or in a quarter of their width, amid others that are not. `pictures` are of
/// `frames`.
std::optional<Finding> FindLostContact(const Pictures& pictures, const std::vector<int>& frames);

/// Stretches in which pictures do not drift.
struct Still
{
  std::optional<Finding> rest;    ///< poses do not drift either: all frames but one of each stretch
  std::optional<Finding> repeat;  ///< poses go on, so that the picture is frozen: all but the first
};
Still FindStill(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames);

/// Frames that show what the one before showed, or nearly, though the probe moved as usual.
std::optional<Finding> FindRepeats(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames);

/// Frames whose poses are not theirs.
struct LostTracking
{
  /// Poses leave the path at once and come back as quickly, or are those of the frame before though pictures go on.
  std::optional<Finding> lost;
  /// The latter again and again: only said, for the pictures are news, and their poses are a step or two behind.
  std::optional<Finding> slow;
};
LostTracking FindLostTracking(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames);

/// What nothing is done about: gain, depth, grey levels, poses.
std::vector<Finding> DoubtsAbout(const Sweep& sweep, const Pictures& pictures, const GreyLevels& levels,
                                 const std::vector<int>& frames);

/// Of these: pictures do not change as poses say, in the order listed, as much as the way is long or in its direction.
std::optional<Finding> DoubtMotion(const Sweep& sweep, const Pictures& pictures, const std::vector<int>& frames);

/// What is done about a pixel of every frame, in `covered` below. 0: nothing.
constexpr std::uint8_t kFilled = 1;     ///< from what is around it
constexpr std::uint8_t kBlackened = 2;  ///< made black, as a pixel that no probe lights

/// Pixels beside the picture where they are not black, so that a training would take them for lit (Sweep::LitBy).
/// `covered` gets kBlackened there.
std::optional<Finding> FindFan(const Sweep& sweep, const std::vector<int>& frames, std::vector<std::uint8_t>& covered);

/// Pixels that do not change from frame to frame and do not look like what is around them, with a rim. `covered` gets
/// kFilled there; pixels that have something else are not looked at, nor white ones where tissue is as white, nor those of
/// a sweep that was averaged.
std::optional<Finding> FindOverlay(const Sweep& sweep, const GreyLevels& levels, const std::vector<int>& frames,
                                   std::vector<std::uint8_t>& covered);

/// The sweep with pixels of its frames blackened, or filled by a mean of what is around them, near pixels first. `covered`
/// says which, [frames of the sweep]; null: none.
Sweep WithoutOverlay(const Sweep& sweep, const std::vector<std::shared_ptr<const std::vector<std::uint8_t>>>& covered);

}  // namespace bigus
