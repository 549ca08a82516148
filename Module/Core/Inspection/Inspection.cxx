// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Inspection/Inspection.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <sstream>
#include <utility>

#include "Core/Inspection/Pictures.h"
#include "Core/Inspection/Rules.h"
#include "Core/Model/Error.h"
#include "Core/Model/Sequences.h"
#include "Core/Numerics/OpenCv.h"
#include "Core/Poses/PoseDoubts.h"

namespace bigus
{
namespace
{

/// How a kind is called, what was found, and what is done about it; null: it is only doubted.
struct KindOfFinding
{
  const char *name, *what, *done;
};

/// In the order of FindingKind, so that those that something is done about are the first.
constexpr std::array<KindOfFinding, 11> kKinds{{
    {"order", "Frames are not in the order of their times", "They are taken by time"},
    {"contact", "The probe seems to be off the skin", "They are left out"},
    {"repeat", "A picture is shown again", "They are left out"},
    {"rest", "The probe rests", "They are left out, but for one of each rest"},
    {"overlay", "The scanner's screen shows (text, rulers, logos)", "They are filled from what is around them"},
    {"tracking", "The tracker seems to have lost the probe", "They are left out"},
    {"fan", "What lies beside the picture is not black", "They are made black, as beside other pictures"},
    {"gain", "The gain seems to change", nullptr},
    {"depth", "Depth, zoom or side seem to change", nullptr},
    {"levels", "Grey levels are doubtful", nullptr},
    {"poses", "Poses are doubtful", nullptr},
}};
constexpr std::size_t kActing = static_cast<std::size_t>(FindingKind::Gain);

const KindOfFinding& Of(FindingKind kind)
{
  return kKinds[static_cast<std::size_t>(kind)];
}

/// What is known of one sequence while its rules are asked, by its own numbers of frames.
struct Inspected
{
  std::vector<Finding> findings;
  std::vector<int> heldOut;
  std::vector<int> frames;            ///< that are left, in order
  std::vector<std::uint8_t> covered;  ///< what is done about each pixel (Rules.h); empty: nothing
};

std::vector<int> Without(const std::vector<int>& frames, std::vector<int> gone)
{
  std::sort(gone.begin(), gone.end());
  std::vector<int> left;
  std::copy_if(frames.begin(), frames.end(), std::back_inserter(left),
               [&gone](int frame) { return !std::binary_search(gone.begin(), gone.end(), frame); });
  return left;
}

/// Adds a finding, unless it would leave too few frames, and its frames to those that are gone, unless its kind is kept.
/// Either way the rules that come after do not look at them. True where there is a finding.
bool Add(std::optional<Finding> found, const KeptKinds& kept, std::vector<int>& looked, std::vector<int>& gone,
         std::vector<Finding>& findings)
{
  std::vector<int> left = found && found->isApplied ? Without(looked, found->frames) : looked;
  if (!found || left.size() < 2)
  {
    return false;
  }
  looked = std::move(left);
  found->isApplied = found->isApplied && !kept.Keeps(found->kind);
  const std::vector<int> leftOut = found->LeftOut();
  gone.insert(gone.end(), leftOut.begin(), leftOut.end());
  findings.push_back(*std::move(found));
  return true;
}

/// What is no tissue in every frame: beside the picture, and over it.
void FindCovered(const Sweep& sweep, const GreyLevels& levels, const std::vector<int>& looked, const KeptKinds& kept,
                 Inspected& inspected)
{
  std::vector<std::uint8_t>& covered = inspected.covered;
  for (std::optional<Finding> found : {FindFan(sweep, looked, covered), FindOverlay(sweep, levels, looked, covered)})
  {
    if (found)
    {
      found->isApplied = !kept.Keeps(found->kind);
      inspected.findings.push_back(*std::move(found));
    }
  }
  // What is kept is left only now: a grey ground is no text, whatever is done about it.
  for (const auto& [kind, mark] : {std::pair(FindingKind::Fan, kBlackened), {FindingKind::Overlay, kFilled}})
  {
    std::replace(covered.begin(), covered.end(), mark, kept.Keeps(kind) ? std::uint8_t(0) : mark);
  }
  if (std::count(covered.begin(), covered.end(), 0) == static_cast<std::ptrdiff_t>(covered.size()))
  {
    covered.clear();
  }
}

Inspected InspectSequence(const Sweep& recorded, const KeptKinds& kept, int holdOut)
{
  Inspected inspected;
  std::vector<int> ordered;
  if (std::optional<Finding> order = FindOrder(recorded, ordered))
  {
    order->isApplied = order->isApplied && !kept.Keeps(FindingKind::Order);
    ordered = order->isApplied ? ordered : AllFrames(recorded);
    inspected.findings.push_back(*std::move(order));
  }
  for (const int place : SplitHoldOut(static_cast<int>(ordered.size()), holdOut).second)
  {
    inspected.heldOut.push_back(ordered[place]);
  }
  std::vector<int> looked = Without(ordered, inspected.heldOut), gone;
  inspected.frames = ordered;
  if (looked.size() < 2)
  {
    return inspected;
  }
  const GreyLevels levels = SurveyLevels(recorded, looked);
  const Sweep sweep = levels.IsDim() ? Brightened(recorded, levels) : recorded;
  Pictures pictures = MakePictures(sweep, looked);
  const auto add = [&](std::optional<Finding> found)
  {
    if (Add(std::move(found), kept, looked, gone, inspected.findings))
    {
      pictures = MakePictures(sweep, looked);
    }
  };
  add(FindLostContact(pictures, looked));
  LostTracking tracking = FindLostTracking(sweep, pictures, looked);
  add(std::move(tracking.lost));
  add(std::move(tracking.slow));
  Still still = FindStill(sweep, pictures, looked);
  add(std::move(still.rest));
  add(std::move(still.repeat));
  add(FindRepeats(sweep, pictures, looked));
  FindCovered(sweep, levels, looked, kept, inspected);
  for (Finding& doubt : DoubtsAbout(sweep, pictures, levels, looked))
  {
    inspected.findings.push_back(std::move(doubt));
  }
  inspected.frames = Without(ordered, gone);
  return inspected;
}

/// "0-39, 41"
std::string Ranges(const std::vector<int>& frames)
{
  std::ostringstream text;
  constexpr std::size_t kMost = 12;  // ranges
  std::size_t ranges = 0;
  for (std::size_t k = 0; k < frames.size(); ++ranges)
  {
    std::size_t last = k;
    while (last + 1 < frames.size() && frames[last + 1] == frames[last] + 1)
    {
      ++last;
    }
    if (ranges == kMost)
    {
      text << " ...";
      break;
    }
    text << (k ? ", " : "") << frames[k];
    if (last > k)
    {
      text << "-" << frames[last];
    }
    k = last + 1;
  }
  return text.str();
}

}  // namespace

const char* NameOf(FindingKind kind)
{
  return Of(kind).name;
}

std::vector<int> Finding::LeftOut() const
{
  const bool stay =
      kind == FindingKind::Order || kind == FindingKind::Overlay || kind == FindingKind::Fan || !isApplied;
  return stay ? std::vector<int>{} : frames;
}

KeptKinds KeptKinds::Parse(const std::string& text)
{
  KeptKinds kinds;
  std::istringstream names(text.empty() ? " " : text);
  for (std::string name; std::getline(names, name, '+');)
  {
    const auto end = kKinds.begin() + kActing;
    const auto known =
        std::find_if(kKinds.begin(), end, [&name](const KindOfFinding& one) { return name == one.name; });
    if (known != end)
    {
      kinds.kinds_ |= 1u << (known - kKinds.begin());
    }
    else if (name == "all")
    {
      kinds.kinds_ = (1u << kActing) - 1;
    }
    else if (name != "none")
    {
      throw Error("'" + name.substr(0, 60) + "' is no kind of finding that can be kept; give " + kNames +
                  ", or some of these joined by +.");
    }
  }
  return kinds;
}

std::string KeptKinds::ToString() const
{
  std::string text;
  for (std::size_t kind = 0; kind < kActing; ++kind)
  {
    text += kinds_ >> kind & 1 ? (text.empty() ? "" : "+") + std::string(kKinds[kind].name) : "";
  }
  return text.empty() ? "none" : kinds_ + 1 == 1u << kActing ? "all" : text;
}

std::string Describe(const Finding& finding, const std::vector<int>& numbers)
{
  std::vector<int> frames;
  std::transform(finding.frames.begin(), finding.frames.end(), std::back_inserter(frames),
                 [&numbers](int frame) { return numbers[frame]; });
  const std::string count = std::to_string(frames.size()) + (frames.size() == 1 ? " frame (" : " frames (");
  const std::string where = finding.pixels > 0 ? std::to_string(finding.pixels) + " pixels of every frame; "
                            : frames.empty()   ? ""
                                               : count + Ranges(frames) + "); ";
  const KindOfFinding& words = Of(finding.kind);
  return std::string(words.what) + ": " + where + finding.evidence + ". " +
         (finding.isApplied ? std::string(words.done) + "; keep '" + words.name + "' to use them as they are."
                            : "Nothing was done about it.");
}

InspectedSweep Inspect(std::shared_ptr<const Sweep> sweep, const KeptKinds& kept, int holdOut)
try
{
  InspectedSweep result{sweep, sweep, {}, {}, {}};
  std::vector<std::shared_ptr<const std::vector<std::uint8_t>>> covered;  // [frames that are left]
  for (const Sequence& sequence : SequencesOf(*sweep))
  {
    Inspected inspected = InspectSequence(sequence.sweep, kept, holdOut);
    const auto number = [&sequence](int& frame) { frame += sequence.first; };
    std::sort(inspected.heldOut.begin(), inspected.heldOut.end());
    for (std::size_t k = 0; k < inspected.frames.size(); ++k)
    {
      if (std::binary_search(inspected.heldOut.begin(), inspected.heldOut.end(), inspected.frames[k]))
      {
        result.heldOut.push_back(static_cast<int>(result.frames.size() + k));
      }
    }
    std::for_each(inspected.frames.begin(), inspected.frames.end(), number);
    result.frames.insert(result.frames.end(), inspected.frames.begin(), inspected.frames.end());
    for (Finding& finding : inspected.findings)
    {
      std::for_each(finding.frames.begin(), finding.frames.end(), number);
      result.findings.push_back(std::move(finding));
    }
    covered.resize(result.frames.size(), inspected.covered.empty()
                                             ? nullptr
                                             : std::make_shared<const std::vector<std::uint8_t>>(inspected.covered));
  }
  if (std::optional<std::string> doubt = DoubtAboutSequences(*sweep))
  {
    result.findings.push_back({FindingKind::Poses, {}, 0, false, *std::move(doubt)});
  }
  if (sweep->NumberOfFrames() < 2)
  {
    result.findings.push_back({FindingKind::Poses,
                               {},
                               0,
                               false,
                               "there is one usable frame, and a new field needs two at least, at different places"});
  }
  if (result.frames != AllFrames(*sweep))
  {
    result.sweep = std::make_shared<const Sweep>(sweep->Subset(result.frames));
  }
  if (std::any_of(covered.begin(), covered.end(), [](const auto& one) { return one != nullptr; }))
  {
    result.sweep = std::make_shared<const Sweep>(WithoutOverlay(*result.sweep, covered));
  }
  return result;
}
catch (const cv::Exception& exception)
{
  ThrowAsCores(exception);
}

}  // namespace bigus
