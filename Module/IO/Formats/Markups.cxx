// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/Markups.h"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "Core/Model/SlicePlane.h"
#include "IO/FileError.h"
#include "IO/SequenceFile.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::uint64_t largestMarkups = 16u << 20;

using Json = nlohmann::json;

// The member `name`, an array of at least `count` numbers.
Eigen::VectorXd Numbers(const std::string& what, const Json& markup, const char* name, Eigen::Index count)
{
  const auto found = markup.find(name);
  RequireFormat(found != markup.end() && found->is_array() && found->size() >= static_cast<std::size_t>(count), what,
                " has no ", name, " of ", count, " numbers; save it with 3D Slicer 5 or later");
  Eigen::VectorXd numbers(count);
  for (Eigen::Index i = 0; i < count; ++i)
  {
    const Json& number = (*found)[static_cast<std::size_t>(i)];
    RequireFormat(number.is_number(), what, ": ", name, "[", i, "] is not a number");
    numbers[i] = number.get<double>();
  }
  return numbers;
}

std::string TextMember(const Json& object, const char* name, const std::string& otherwise)
{
  const auto found = object.find(name);
  return found != object.end() && found->is_string() ? found->get<std::string>() : otherwise;
}

// mm of a unit of length, by its code of UCUM. A unit is a word, or [code, scheme, meaning].
double UnitOf(const std::string& what, const Json& markup)
{
  const auto found = markup.find("coordinateUnits");
  if (found == markup.end() || found->is_null())
  {
    return 1;
  }
  const Json& code = found->is_array() && !found->empty() ? found->front() : *found;
  const std::string name = code.is_string() ? code.get<std::string>() : code.dump(-1, ' ', true);
  constexpr std::pair<const char*, double> kUnits[] = {{"mm", 1}, {"um", 1e-3}, {"cm", 10}, {"m", 1000}};
  for (const auto& [unit, length] : kUnits)
  {
    if (name == unit)
    {
      return length;
    }
  }
  throw FormatError(what + ": coordinateUnits " + Quoted(name) + "; mm, um, cm and m are read");
}

// What all markups say: a position or a direction of them as the file has it, in the patient system asked for.
class Placement
{
public:
  Placement(const std::string& what, const Json& markup, bool worldIsLps)
  {
    const std::string system = TextMember(markup, "coordinateSystem", "LPS");
    RequireFormat(system == "LPS" || system == "RAS", what, ": coordinateSystem ", Quoted(system),
                  "; LPS and RAS are read");
    unit_ = UnitOf(what, markup);
    sign_ = (system == "LPS") != worldIsLps ? -1 : 1;
  }

  Eigen::Vector3d InWorld(double x, double y, double z) const
  {
    return unit_ * Eigen::Vector3d(sign_ * x, sign_ * y, z);
  }

  /// mm of the file's unit.
  double Unit() const { return unit_; }

private:
  double sign_, unit_;
};

MarkupPlane Grid(const std::string& what, const Eigen::Vector3d& centre, const Eigen::Vector3d& x,
                 const Eigen::Vector3d& y, double width, double height, double spacing)
{
  RequireFormat(std::min(width, height) > 0 && std::max(width, height) / spacing <= largestSide, what, ": size ",
                ExactNumber(width), " x ", ExactNumber(height), " mm at ", ExactNumber(spacing), " mm a pixel; up to ",
                largestSide, " pixels a side are possible");
  SlicePlane plane;
  plane.width = std::max(1, static_cast<int>(std::lround(width / spacing)));
  plane.height = std::max(1, static_cast<int>(std::lround(height / spacing)));
  plane.columnStep = spacing * x.normalized();
  plane.rowStep = spacing * y.normalized();
  plane.origin = centre - 0.5 * (plane.width - 1) * plane.columnStep - 0.5 * (plane.height - 1) * plane.rowStep;
  try
  {
    plane.Validate("the plane");
  }
  catch (const Error& error)
  {
    throw FormatError(what + ": " + error.what());
  }
  return {plane.ImageToReference(), plane.width, plane.height};
}

// https://github.com/Slicer/Slicer/tree/main/Modules/Loadable/Markups/Resources/Schema
MarkupPlane ReadPlane(const std::string& what, const Json& markup, double spacing, bool worldIsLps)
{
  const Placement place(what, markup, worldIsLps);
  const Eigen::VectorXd centre = Numbers(what, markup, "center", 3);
  const Eigen::VectorXd axes = Numbers(what, markup, "orientation", 9);  // row-major, axes in columns
  const Eigen::Vector3d x = place.InWorld(axes[0], axes[3], axes[6]), y = place.InWorld(axes[1], axes[4], axes[7]);
  Eigen::Vector4d bounds = Eigen::Vector4d::Zero();  // along x and y, from the centre
  if (const auto found = markup.find("planeBounds"); found != markup.end() && !found->is_null())
  {
    bounds = Numbers(what, markup, "planeBounds", 4);
  }
  if (!(bounds[1] > bounds[0] && bounds[3] > bounds[2]))  // of versions that did not say, and where nothing was placed
  {
    const Eigen::VectorXd size = Numbers(what, markup, "size", 2);
    bounds << -0.5 * size[0], 0.5 * size[0], -0.5 * size[1], 0.5 * size[1];
  }
  bounds *= place.Unit();
  // Where an edge was dragged, the centre is not in the middle.
  const Eigen::Vector3d middle = place.InWorld(centre[0], centre[1], centre[2]) +
                                 0.5 * (bounds[0] + bounds[1]) * x.normalized() +
                                 0.5 * (bounds[2] + bounds[3]) * y.normalized();
  return Grid(what, middle, x, y, bounds[1] - bounds[0], bounds[3] - bounds[2], spacing);
}

// Columns along the line, from its first point to its second. Rows go down as far as a right angle lets them: to the feet,
// or to the back where the line itself runs along the body.
MarkupPlane ReadLine(const std::string& what, const Json& markup, double spacing, bool worldIsLps)
{
  constexpr double kAlongTheBody = 0.9;  // cosine; nearer to it a right angle leaves less than half of "down"
  const Placement place(what, markup, worldIsLps);
  const auto points = markup.find("controlPoints");
  RequireFormat(points != markup.end() && points->is_array() && points->size() == 2, what,
                ": a line has two controlPoints, this one ", points == markup.end() ? 0 : points->size());
  std::array<Eigen::Vector3d, 2> ends;
  for (std::size_t k = 0; k < 2; ++k)
  {
    const Eigen::VectorXd position =
        Numbers(what + ": controlPoints[" + std::to_string(k) + "]", (*points)[k], "position", 3);
    ends[k] = place.InWorld(position[0], position[1], position[2]);
  }
  const double length = (ends[1] - ends[0]).norm();
  const Eigen::Vector3d along = (ends[1] - ends[0]).normalized();
  const Eigen::Vector3d feet(0, 0, -1), back(0, worldIsLps ? 1 : -1, 0);
  const Eigen::Vector3d down = std::abs(along.dot(feet)) < kAlongTheBody ? feet : back;
  return Grid(what, 0.5 * (ends[0] + ends[1]), along, down - down.dot(along) * along, length, length, spacing);
}

// The markups of a file, each with the words that name it.
std::vector<std::pair<std::string, Json>> ReadMarkups(const std::string& fileName)
{
  const Json document = Json::parse(ReadTextFile(fileName, largestMarkups), nullptr, false);
  RequireFormat(!document.is_discarded(), fileName, ": not valid JSON; it is damaged or truncated");
  const auto markups = document.is_object() ? document.find("markups") : document.end();
  RequireFormat(document.is_object() && markups != document.end() && markups->is_array(), fileName,
                ": has no list \"markups\"; a 3D Slicer markup file (.mrk.json) is expected");
  std::vector<std::pair<std::string, Json>> named;
  for (std::size_t i = 0; i < markups->size(); ++i)
  {
    if ((*markups)[i].is_object())
    {
      named.emplace_back(fileName + ": markup " + std::to_string(i), (*markups)[i]);
    }
  }
  return named;
}

}  // namespace

std::vector<MarkupPlane> ReadMarkupPlanes(const std::string& fileName, double spacing, bool worldIsLps)
{
  std::vector<MarkupPlane> planes;
  for (const auto& [what, markup] : ReadMarkups(fileName))
  {
    const std::string type = TextMember(markup, "type", "");
    if (type == "Plane" || type == "Line")
    {
      planes.push_back((type == "Plane" ? ReadPlane : ReadLine)(what, markup, spacing, worldIsLps));
    }
  }
  RequireFormat(!planes.empty(), fileName, ": has no markup of type Plane or Line");
  return planes;
}

MarkupBox ReadMarkupBox(const std::string& fileName, bool worldIsLps)
{
  std::vector<MarkupBox> boxes;
  for (const auto& [what, markup] : ReadMarkups(fileName))
  {
    if (TextMember(markup, "type", "") != "ROI")
    {
      continue;
    }
    const Placement place(what, markup, worldIsLps);
    const Eigen::VectorXd centre = Numbers(what, markup, "center", 3);
    const Eigen::VectorXd axes = Numbers(what, markup, "orientation", 9);
    const Eigen::VectorXd size = place.Unit() * Numbers(what, markup, "size", 3);
    MarkupBox box{place.InWorld(centre[0], centre[1], centre[2]), Eigen::Matrix3d(), size};
    for (int k = 0; k < 3; ++k)
    {
      box.axes.col(k) = place.InWorld(axes[k], axes[3 + k], axes[6 + k]).normalized();
    }
    RequireFormat(size.minCoeff() > 0 && (box.axes.transpose() * box.axes - Eigen::Matrix3d::Identity()).norm() < 1e-6,
                  what,
                  ": size and orientation must be those of a box: three lengths above 0, and axes at right "
                  "angles");
    boxes.push_back(box);
  }
  RequireFormat(boxes.size() == 1, fileName, ": has ", boxes.size(), " markups of type ROI; one is expected");
  return boxes.front();
}

}  // namespace bigus
