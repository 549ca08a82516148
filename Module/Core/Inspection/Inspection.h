// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What is wrong with recorded frames, looked for in pictures, poses and times together, and what is done about it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "Core/Model/Sweep.h"

namespace bigus
{

/// What may be found. README.md says how.
enum class FindingKind
{
  Order,     ///< frames are listed in another order than that of their times
  Contact,   ///< the probe was off the skin: frames are black, or noise without speckle
  Repeat,    ///< the picture was frozen, or shown again, while the probe moved on
  Rest,      ///< probe and picture stand still
  Overlay,   ///< pixels of the scanner's screen: text, rulers, logos
  Tracking,  ///< the tracker lost the probe: poses jump away and come back, or stay while pictures go on
  Fan,       ///< what lies beside the picture is not black, so that it counts as lit: a screen's grey, or noise
  // What follows is only doubted: nothing is ever done about it.
  Gain,    ///< pictures get brighter or darker at once
  Depth,   ///< pictures get larger, smaller or mirrored at once: another depth, zoom or side
  Levels,  ///< white pixels hide what is there, or no pixel is bright
  Poses    ///< sound as numbers, but hardly those of a probe (PoseDoubts.h)
};

/// "order", "contact", "repeat", "rest", "overlay", "tracking", "fan", "gain", "depth", "levels", "poses".
const char* NameOf(FindingKind kind);

/// Kinds of findings that something is done about unless they are kept.
class KeptKinds
{
public:
  /// What Parse takes: "none|all|order|contact|...".
  static constexpr const char* kNames = "none|all|order|contact|repeat|rest|overlay|tracking|fan";

  bool Keeps(FindingKind kind) const { return kinds_ >> static_cast<int>(kind) & 1; }

  /// Names joined by '+', "all", or "none". Throws Error for another name.
  static KeptKinds Parse(const std::string& text);
  /// The text that Parse reads back to the same.
  std::string ToString() const;

private:
  std::uint32_t kinds_ = 0;  // bit k: FindingKind k
};

struct Finding
{
  FindingKind kind = FindingKind::Order;
  /// Of the sweep, in its order: those left out, or those that would be. Of a doubt those from which on it holds; none
  /// where it is about the whole sweep. All for an overlay or a fan.
  std::vector<int> frames;
  std::size_t pixels = 0;  ///< of every frame, that are filled or blackened; 0 for other kinds
  bool isApplied = false;  ///< something was done: false where the kind is kept, and for what is only a doubt
  std::string evidence;    ///< in numbers; a sentence without its full stop

  /// The frames that something is done about by leaving them out: none of an order, an overlay or a fan, or where nothing
  /// is done.
  std::vector<int> LeftOut() const;
};

/// What was found, the evidence, what was done and how to undo it. `numbers` says for every frame of the sweep how it is
/// called, for instance by its place in a file.
std::string Describe(const Finding& finding, const std::vector<int>& numbers);

/// A sweep as it is trained on.
struct InspectedSweep
{
  std::shared_ptr<const Sweep> recorded;  ///< the one that came
  std::shared_ptr<const Sweep> sweep;     ///< what is left of it; the same where nothing was done
  std::vector<int> frames;                ///< [frames of `sweep`] their numbers in `recorded`
  std::vector<int> heldOut;               ///< frames of `sweep` that were not looked at
  std::vector<Finding> findings;
};

/// Looks at every sequence of the sweep by itself and leaves out, orders and fills what was found, but for kinds that are
/// kept. What would leave fewer than two frames is no finding. Frames that a hold-out keeps (SplitHoldOut in the order of
/// times, 0: none) all stay, and what they show has no part in what is found. The sweep is valid. It takes some 2 ns for
/// every pixel.
InspectedSweep Inspect(std::shared_ptr<const Sweep> sweep, const KeptKinds& kept = {}, int holdOut = 0);

}  // namespace bigus
