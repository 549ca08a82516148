// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Poses.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <set>
#include <string_view>
#include <utility>

#include "Core/Model/Error.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Format.h"
#include "IO/FileError.h"
#include "IO/Formats/HeaderFields.h"
#include "IO/Formats/Xml.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::uint64_t largestConfig = 16u << 20;

// Degrees that rows and columns may be off a right angle where no third axis confirms them.
constexpr double kMostSheared = 10;

struct Link
{
  TransformName name;
  std::string field;                                     ///< of each frame, or of the header
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();  ///< of the header or the configuration
  std::string problem;                                   ///< why `matrix` will not do; empty: it does
};

struct Step
{
  const Link* link;
  bool inverse;
};

// "ProbeToTracker" -> Probe, Tracker. As in Plus there must be exactly one "To" that is followed by a letter
// that is not lowercase ("ToolToTracker" splits at the second).
bool SplitName(const std::string& name, TransformName& result)
{
  std::size_t split = std::string::npos;
  for (std::size_t at = name.find("To", 1); at != std::string::npos; at = name.find("To", at + 1))
  {
    if (at + 2 < name.size() && !(name[at + 2] >= 'a' && name[at + 2] <= 'z'))
    {
      if (split != std::string::npos)
      {
        return false;
      }
      split = at;
    }
  }
  if (split == std::string::npos)
  {
    return false;
  }
  result.from = name.substr(0, split);
  result.to = name.substr(split + 2);
  return true;
}

bool EndsWith(const std::string& text, const std::string& end)
{
  return text.size() > end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

// Where a tracker saw nothing, programs write zeros or a word in the place of a matrix: what it holds, or nothing where
// it may be one. Its last row tells nothing.
std::string NoPoseIn(const std::string& text)
{
  const std::vector<std::string_view> words = Words(text);
  const auto end = words.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(words.size(), 12));
  const auto isNumber = [](std::string_view word) { return word.find_first_of("123456789") != std::string_view::npos; };
  if (words.empty() || std::any_of(words.begin(), end, isNumber))
  {
    return {};
  }
  return words[0].find('0') == std::string_view::npos ? Quoted(words[0]) : "zeros";
}

// Reads an affine matrix; else says what is wrong with it.
std::string ParseMatrix(const std::string& text, Eigen::Matrix4d& matrix)
{
  if (const std::string found = NoPoseIn(text); !found.empty())
  {
    return "holds no pose but " + found;
  }
  double numbers[16];
  if (!ParseNumbers(text, 16, numbers))
  {
    return "is not 16 numbers";
  }
  matrix = Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers);
  if (!matrix.allFinite())
  {
    return "has a value that is not finite";
  }
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
  {
    return "is not affine (its last row is not 0 0 0 1)";
  }
  return {};
}

// Whether the first two axes span a plane, which is all that pixels need.
bool SpansPlane(const Eigen::Matrix4d& matrix)
{
  const Eigen::Vector3d columns = matrix.block<3, 1>(0, 0), rows = matrix.block<3, 1>(0, 1);
  return columns.cross(rows).norm() > kFlattestAxes * columns.norm() * rows.norm();
}

// The transforms of every CoordinateDefinitions, however deep in other elements.
struct DefinedTransforms : pugi::xml_tree_walker
{
  bool areThere = false;
  std::vector<pugi::xml_node> transforms;

  bool for_each(pugi::xml_node& node) override
  {
    const std::string_view name = node.name();
    inside_ = depth() > inside_ ? inside_ : kNowhere;
    if (name == "CoordinateDefinitions" && inside_ == kNowhere)
    {
      areThere = true;
      inside_ = depth();
    }
    else if (name == "Transform" && inside_ != kNowhere)
    {
      transforms.push_back(node);
    }
    return true;
  }

private:
  static constexpr int kNowhere = std::numeric_limits<int>::max();
  int inside_ = kNowhere;  // depth of the definitions that the walk is in
};

std::vector<Link> ReadConfig(const std::string& fileName)
{
  const std::string text = ReadTextFile(fileName, largestConfig);
  pugi::xml_document document = ParseXml(text, fileName + ": not a Plus configuration");
  DefinedTransforms definitions;
  document.traverse(definitions);
  RequireFormat(definitions.areThere, fileName,
                ": has no element CoordinateDefinitions; a Plus configuration with its transforms is "
                "expected");
  std::vector<Link> links;
  for (const pugi::xml_node& element : definitions.transforms)
  {
    Link link;
    link.name.from = element.attribute("From").value();
    link.name.to = element.attribute("To").value();
    link.name.source = "config";
    const pugi::xml_attribute matrix = element.attribute("Matrix");
    RequireFormat(!link.name.from.empty() && !link.name.to.empty() && matrix, fileName,
                  ": a Transform lacks From, To or Matrix");
    link.problem = ParseMatrix(matrix.value(), link.matrix);
    links.push_back(std::move(link));
  }
  return links;
}

// Every transform there is. One that the frames have hides one of the same ends in the header, and that one
// in the configuration.
std::vector<Link> CollectLinks(const SequenceFile& file, const PoseOptions& options)
{
  const std::string ending = "Transform";
  std::vector<Link> links;
  std::set<std::pair<std::string, std::string>> known;
  const auto add = [&](Link link)
  {
    if (known.emplace(link.name.from, link.name.to).second)
    {
      links.push_back(std::move(link));
    }
  };
  std::set<std::string> seen;
  for (const Fields& fields : file.frames)
  {
    for (const auto& field : fields)
    {
      Link link;
      if (EndsWith(field.first, ending) && seen.insert(field.first).second &&
          SplitName(field.first.substr(0, field.first.size() - ending.size()), link.name))
      {
        link.name.source = "frames";
        link.field = field.first;
        add(std::move(link));
      }
    }
  }
  for (const auto& field : file.fields)
  {
    Link link;
    if (EndsWith(field.first, ending) &&
        SplitName(field.first.substr(0, field.first.size() - ending.size()), link.name))
    {
      link.name.source = "header";
      link.problem = ParseMatrix(field.second, link.matrix);
      add(std::move(link));
    }
  }
  if (!options.configFileName.empty())
  {
    for (Link& link : ReadConfig(options.configFileName))
    {
      add(std::move(link));
    }
  }
  return links;
}

// The shortest chain, breadth first. Empty, with `reached` filled, when there is none.
std::vector<Step> FindChain(const std::vector<Link>& links, const std::string& from, const std::string& to,
                            std::vector<std::string>& reached)
{
  // Sorted by coordinate frame once, because a file may name any number of them.
  std::map<std::string, std::vector<Step>> stepsFrom;
  for (const Link& link : links)
  {
    stepsFrom[link.name.from].push_back({&link, false});
    stepsFrom[link.name.to].push_back({&link, true});
  }
  std::map<std::string, Step> cameBy;
  std::set<std::string> seen = {from};
  std::deque<std::string> queue = {from};
  reached = {from};
  while (!queue.empty() && !seen.count(to))
  {
    const std::string here = queue.front();
    queue.pop_front();
    for (const Step& step : stepsFrom[here])
    {
      const std::string& end = step.inverse ? step.link->name.from : step.link->name.to;
      if (seen.insert(end).second)
      {
        cameBy[end] = step;
        queue.push_back(end);
        reached.push_back(end);
      }
    }
  }
  std::deque<Step> chain;
  for (std::string at = to; seen.count(to) && at != from;)
  {
    const Step step = cameBy.at(at);
    chain.push_front(step);
    at = step.inverse ? step.link->name.to : step.link->name.from;
  }
  return {chain.begin(), chain.end()};
}

std::string Listed(const std::vector<std::string>& names)
{
  constexpr std::size_t kMost = 30;
  std::string text;
  for (std::size_t i = 0; i < names.size() && i < kMost; ++i)
  {
    text += (i ? ", " : "") + Shortened(names[i]);
  }
  return names.empty()          ? "none"
         : names.size() > kMost ? text + " and " + std::to_string(names.size() - kMost) + " more"
                                : text;
}

// Why a pose places no picture, or nothing. Makes its third axis where that is none.
std::string CheckPose(const PoseOptions& options, const SequenceFile& file, FramePose& frame)
{
  Eigen::Matrix4d& pose = frame.imageToReference;
  if (!pose.allFinite())
  {
    return "a pose that is not finite";
  }
  const SlicePlane plane = SlicePlane::FromImageToReference(pose, std::max(file.width, 1), std::max(file.height, 1));
  try
  {
    plane.Validate("");
  }
  catch (const Error&)
  {
    return "a pose whose pixel steps span no plane or are not between 1e-6 and 1e6 mm";
  }
  if (!plane.IsWithinReach())
  {
    return "a pose farther than 1e9 mm from the origin";
  }
  frame.hasMadeAxis = MakeThirdAxis(pose, options.allowReflectedPoses);
  const double shear = std::abs(plane.columnStep.normalized().dot(plane.rowStep.normalized()));
  if (frame.hasMadeAxis && shear > std::sin(kMostSheared * kRadiansPerDegree))
  {
    return "a pose whose rows and columns are more than " + ExactNumber(kMostSheared) +
           " degrees off a right angle, and whose third column is none";
  }
  return {};
}

// That only some of the accepted frames have a time, or nothing.
std::string MissingTimes(const SequenceFile& file, const PoseTable& table)
{
  int accepted = 0, timed = 0;
  for (std::size_t k = 0; k < table.frames.size(); ++k)
  {
    accepted += table.frames[k].accepted;
    timed += table.frames[k].accepted && std::isfinite(table.timestamps[k]);
  }
  return timed == 0 || timed == accepted ? ""
                                         : file.fileName + ": " + std::to_string(accepted - timed) + " of " +
                                               std::to_string(accepted) + " frames have no time, so times are not used";
}

void RequireSpacing(const SequenceFile& file, const PoseOptions& options)
{
  const auto [i, j] = options.imageSpacing;
  Require(FileFault::User, std::isfinite(i) && std::isfinite(j) && std::min(i, j) >= 0 && (i > 0) == (j > 0),
          file.fileName, ": the image spacing is ", ExactNumber(i), " x ", ExactNumber(j),
          " mm; two lengths above 0 are expected, or 0 and 0 for those of the transforms");
}

// Gives pixels the size that the caller wants. Pixel (0, 0) stays where it is.
void SetSpacing(const PoseOptions& options, Eigen::Matrix4d& pose)
{
  for (int axis = 0; axis < 2; ++axis)
  {
    if (const double side = options.imageSpacing[static_cast<std::size_t>(axis)]; side > 0)
    {
      pose.block<3, 1>(0, axis) = side * pose.block<3, 1>(0, axis).normalized();
    }
  }
}

// The frame's pose, or why it has none.
std::string ComputePose(const Fields& fields, const std::vector<Step>& chain, const PoseOptions& options,
                        const SequenceFile& file, FramePose& frame)
{
  Eigen::Matrix4d& pose = frame.imageToReference;
  for (const char* name : {"ImageStatus", "Status"})  // the second is IGSIO's name in NRRD
  {
    if (const std::string* status = Find(fields, name); status && !IsSound(*status))
    {
      return "image status " + Quoted(*status);
    }
  }
  bool first = true;
  pose.setIdentity();
  for (const Step& step : chain)
  {
    const Link& link = *step.link;
    const std::string name = Shortened(link.name.Name());
    Eigen::Matrix4d matrix = link.matrix;
    std::string problem = link.problem;
    if (!link.field.empty())
    {
      const std::string* text = Find(fields, link.field);
      if (!text)
      {
        return name + " absent";
      }
      const std::string* status = Find(fields, link.field + "Status");
      if (!status && !options.assumeMissingStatusOK)
      {
        return name + " without a status";
      }
      if (status && !IsSound(*status))
      {
        return name + " status " + Quoted(*status);
      }
      problem = ParseMatrix(*text, matrix);
    }
    if (problem.empty() &&
        !(first && !step.inverse ? SpansPlane(matrix) : std::abs(Handedness(matrix)) > kFlattestAxes))
    {
      problem = "is singular";
    }
    if (!problem.empty())
    {
      return name + " that " + problem;
    }
    if (step.inverse)
    {
      matrix = Eigen::Matrix4d(Eigen::Affine3d(matrix).inverse().matrix());
    }
    pose = first ? matrix : Eigen::Matrix4d(matrix * pose);  // a single forward link stays as it is, to the last bit
    first = false;
  }
  SetSpacing(options, pose);
  return CheckPose(options, file, frame);
}

}  // namespace

std::vector<int> PoseTable::Kept(bool keepsRejected) const
{
  std::vector<int> kept;
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    if (keepsRejected || frames[k].accepted)
    {
      kept.push_back(static_cast<int>(k));
    }
  }
  return kept;
}

int PoseTable::NumberOfAcceptedFrames() const
{
  int accepted = 0;
  for (const FramePose& frame : frames)
  {
    accepted += frame.accepted;
  }
  return accepted;
}

std::string PoseTable::RejectionSummary() const
{
  if (rejections.empty())
  {
    return {};
  }
  std::size_t rejected = 0;
  std::string details;
  for (std::size_t i = 0; i < rejections.size(); ++i)
  {
    std::vector<std::string> numbers;
    for (const int frame : rejections[i].frames)
    {
      numbers.push_back(std::to_string(frame));
    }
    rejected += numbers.size();
    if (i < 10)
    {
      details += (i ? ", " : "") + std::to_string(numbers.size()) + " for " + rejections[i].reason + " (frame" +
                 (numbers.size() > 1 ? "s " : " ") + Listed(numbers) + ")";
    }
  }
  return std::to_string(rejected) + " of " + std::to_string(frames.size()) + " frames rejected: " + details +
         (rejections.size() > 10 ? ", and further reasons" : "");
}

void PoseTable::RequireFrames(const std::string& fileName) const
{
  RequireFormat(NumberOfAcceptedFrames() != 0, fileName, ": no frame is left: ", RejectionSummary());
}

std::string PoseTable::CroppedFrame(const std::string& fromFrame) const
{
  const std::string cropped = "Cropped" + fromFrame;
  for (const TransformName& transform : transforms)
  {
    if (transform.from == cropped || transform.to == cropped)
    {
      return cropped;
    }
  }
  return {};
}

int PoseTable::NumberOfMadeAxes() const
{
  return static_cast<int>(std::count_if(frames.begin(), frames.end(),
                                        [](const FramePose& frame) { return frame.accepted && frame.hasMadeAxis; }));
}

std::string SpacingDoubt(const SequenceFile& file, const PoseTable& table)
{
  constexpr double kSame = 0.02;  // share; headers are rounded
  const auto frame =
      std::find_if(table.frames.begin(), table.frames.end(), [](const FramePose& f) { return f.accepted; });
  // Programs write 1 where they know nothing.
  if (table.chain.empty() || frame == table.frames.end() || file.spacingField.empty() ||
      (file.spacing[0] == 1 && file.spacing[1] == 1))
  {
    return {};
  }
  const double sides[2] = {frame->imageToReference.block<3, 1>(0, 0).norm(),
                           frame->imageToReference.block<3, 1>(0, 1).norm()};
  if (std::abs(file.spacing[0] / sides[0] - 1) < kSame && std::abs(file.spacing[1] / sides[1] - 1) < kSame)
  {
    return {};
  }
  const auto text = [](double i, double j, const char* between)
  { return Format("%.4g", i) + between + Format("%.4g", j); };
  return file.fileName + ": a pixel measures " + text(sides[0], sides[1], " x ") + " mm by the transforms, but " +
         text(file.spacing[0], file.spacing[1], " x ") + " mm by the header (" + file.spacingField +
         "). The transforms' is used; to take the header's, set the image spacing to " +
         text(file.spacing[0], file.spacing[1], " ");
}

void ResolvePoses(const SequenceFile& file, const PoseOptions& options, PoseTable& table)
{
  table = PoseTable();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Link> links = CollectLinks(file, options);
  std::vector<std::string> names;
  for (const Link& link : links)
  {
    table.transforms.push_back(link.name);
    names.push_back(link.name.Name());
  }

  Require(FileFault::User,
          !options.fromFrame.empty() && !options.toFrame.empty() && options.fromFrame != options.toFrame, file.fileName,
          ": poses lead from ", Quoted(options.fromFrame), " to ", Quoted(options.toFrame),
          "; name two different coordinate frames");
  RequireSpacing(file, options);
  std::vector<std::string> reached;
  const std::vector<Step> chain = FindChain(links, options.fromFrame, options.toFrame, reached);
  if (chain.empty() && (options.required || !links.empty()))
  {
    throw FormatError(file.fileName + ": no way from " + options.fromFrame + " to " + options.toFrame +
                      ". Transforms there are: " + Listed(names) + ". Reached from " + options.fromFrame + ": " +
                      Listed({reached.begin() + 1, reached.end()}) +
                      ". Name other coordinate frames, or give a Plus configuration that has the missing transform");
  }
  table.chain = chain.empty() ? "" : options.fromFrame;
  for (const Step& step : chain)
  {
    table.chain += " -> " + (step.inverse ? step.link->name.from : step.link->name.to);
  }

  std::map<std::string, std::size_t> reasons;
  table.frames.resize(file.frames.size());
  table.timestamps.assign(file.frames.size(), nan);
  for (std::size_t i = 0; i < file.frames.size(); ++i)
  {
    const Fields& fields = file.frames[i];
    FramePose& frame = table.frames[i];
    const std::string reason = ComputePose(fields, chain, options, file, frame);
    frame.accepted = reason.empty();
    if (!frame.accepted)
    {
      frame.imageToReference.setConstant(nan);
      const auto place = reasons.emplace(reason, table.rejections.size());
      if (place.second)
      {
        table.rejections.push_back({reason, {}});
      }
      table.rejections[place.first->second].frames.push_back(static_cast<int>(i));
    }
    if (const std::string* timestamp = Find(fields, "Timestamp"))
    {
      ParseNumber(*timestamp, table.timestamps[i]);
    }
  }
}

std::vector<std::string> CautionsOf(const std::string& fileName, const SequenceFile& file, const PoseOptions& options,
                                    const PoseTable& table)
{
  std::vector<std::string> cautions;
  if (const std::string cropped = table.CroppedFrame(options.fromFrame); !cropped.empty())
  {
    cautions.push_back(fileName + ": poses lead from " + options.fromFrame + ", but the transforms name " + cropped +
                       ", too. Where the images are the cropped ones, name that coordinate frame instead");
  }
  if (const int made = table.NumberOfMadeAxes(); made > 0)
  {
    cautions.push_back(fileName + ": the third column of " + std::to_string(made) + " of " +
                       std::to_string(table.frames.size()) +
                       " poses is zero or points the other way. A picture has two axes, so the first two were read and "
                       "the third was made");
  }
  cautions.insert(cautions.end(), file.notes.begin(), file.notes.end());
  for (const std::string& caution : {MissingTimes(file, table), SpacingDoubt(file, table)})
  {
    if (!caution.empty())
    {
      cautions.push_back(caution);
    }
  }
  return cautions;
}

}  // namespace bigus
