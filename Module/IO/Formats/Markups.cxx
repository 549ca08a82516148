// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/Markups.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "Core/Model/SlicePlane.h"
#include "IO/FileError.h"
#include "IO/SequenceFile.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::uint64_t largestFile = 16u << 20;

using Json = nlohmann::json;

// The member `name`, an array of at least `count` numbers.
Eigen::VectorXd Numbers(const std::string& what, const Json& markup, const char* name, Eigen::Index count)
{
  const auto found = markup.find(name);
  if (found == markup.end() || !found->is_array() || found->size() < static_cast<std::size_t>(count))
  {
    throw FormatError(what + " has no " + name + " of " + std::to_string(count) +
                      " numbers; save it with 3D Slicer 5 or later");
  }
  Eigen::VectorXd numbers(count);
  for (Eigen::Index i = 0; i < count; ++i)
  {
    const Json& number = (*found)[static_cast<std::size_t>(i)];
    if (!number.is_number())
    {
      throw FormatError(what + ": " + name + "[" + std::to_string(i) + "] is not a number");
    }
    numbers[i] = number.get<double>();
  }
  return numbers;
}

std::string TextMember(const Json& object, const char* name, const std::string& otherwise)
{
  const auto found = object.find(name);
  return found != object.end() && found->is_string() ? found->get<std::string>() : otherwise;
}

// https://github.com/Slicer/Slicer/tree/main/Modules/Loadable/Markups/Resources/Schema
MarkupPlane ReadPlane(const std::string& what, const Json& markup, double spacing, bool worldIsLps)
{
  const std::string system = TextMember(markup, "coordinateSystem", "LPS");
  if (system != "LPS" && system != "RAS")
  {
    throw FormatError(what + ": coordinateSystem " + Quoted(system) + "; LPS and RAS are read");
  }
  if (const std::string units = TextMember(markup, "coordinateUnits", "mm"); units != "mm")
  {
    throw FormatError(what + ": coordinateUnits " + Quoted(units) + "; only mm is read");
  }
  Eigen::Vector3d centre = Numbers(what, markup, "center", 3);
  const Eigen::VectorXd orientation = Numbers(what, markup, "orientation", 9);  // row-major, axes in columns
  const Eigen::VectorXd size = Numbers(what, markup, "size", 2);
  Eigen::Vector3d x(orientation[0], orientation[3], orientation[6]);
  Eigen::Vector3d y(orientation[1], orientation[4], orientation[7]);
  if (!(size.minCoeff() > 0 && size.maxCoeff() / spacing <= largestSide))
  {
    throw FormatError(what + ": size " + ExactNumber(size[0]) + " x " + ExactNumber(size[1]) + " mm at " +
                      ExactNumber(spacing) + " mm a pixel; up to " + std::to_string(largestSide) +
                      " pixels a side are possible");
  }
  if ((system == "LPS") != worldIsLps)
  {
    for (Eigen::Vector3d* vector : {&centre, &x, &y})
    {
      vector->head<2>() *= -1;
    }
  }
  SlicePlane plane;
  plane.width = std::max(1, static_cast<int>(std::lround(size[0] / spacing)));
  plane.height = std::max(1, static_cast<int>(std::lround(size[1] / spacing)));
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

}  // namespace

std::vector<MarkupPlane> ReadMarkupPlanes(const std::string& fileName, double spacing, bool worldIsLps)
{
  const std::string text = ReadTextFile(fileName, largestFile);
  const Json document = Json::parse(text, nullptr, false);
  if (document.is_discarded())
  {
    throw FormatError(fileName + ": not valid JSON; it is damaged or truncated");
  }
  const auto markups = document.is_object() ? document.find("markups") : document.end();
  if (!document.is_object() || markups == document.end() || !markups->is_array())
  {
    throw FormatError(fileName + ": has no list \"markups\"; a 3D Slicer markup file (.mrk.json) is expected");
  }
  std::vector<MarkupPlane> planes;
  for (std::size_t i = 0; i < markups->size(); ++i)
  {
    const Json& markup = (*markups)[i];
    if (markup.is_object() && TextMember(markup, "type", "") == "Plane")
    {
      planes.push_back(ReadPlane(fileName + ": markup " + std::to_string(i), markup, spacing, worldIsLps));
    }
  }
  if (planes.empty())
  {
    throw FormatError(fileName + ": has no markup of type Plane");
  }
  return planes;
}

}  // namespace bigus
