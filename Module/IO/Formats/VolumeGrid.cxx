// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/VolumeGrid.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "IO/FileError.h"
#include "IO/SequenceFile.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr int kMostLines = 1000000;  // a sequence that serves as a grid has some lines a frame
constexpr double kFlattest = 1e-6;   // sine below which three axes count as lying in a plane

/// The `separator`-parted lines of a header, by lowercase name, up to the line `last` or an empty one.
Fields ReadHeader(InputFile& input, char separator, const std::string& last)
{
  Fields fields;
  std::string line;
  for (int count = 0; input.ReadLine(line) && !line.empty(); ++count)
  {
    const auto end = line.find(separator);
    if (count > kMostLines || (count > 0 && end == std::string::npos && line[0] != '#'))
    {
      throw FormatError(input.Name() + ": header line " + Quoted(line) + " is not \"name" + separator + " value\"");
    }
    const std::string name = Lowercase(Trimmed(std::string_view(line).substr(0, end)));
    if (end != std::string::npos && fields.emplace(name, Trimmed(std::string_view(line).substr(end + 1))).second &&
        name == last)
    {
      break;
    }
  }
  return fields;
}

/// A header and the words of its fields.
struct Header
{
  const std::string& fileName;
  Fields fields;

  [[noreturn]] void Refuse(const std::string& name, const std::string& expected) const
  {
    const auto found = fields.find(name);
    throw FormatError(fileName + ": " + name + (found == fields.end() ? " is missing" : ": " + Quoted(found->second)) +
                      "; " + expected);
  }
  std::string Text(const std::string& name, const std::string& otherwise = "") const
  {
    const auto found = fields.find(name);
    return found == fields.end() ? otherwise : found->second;
  }
  /// Numbers between blanks, commas and parentheses.
  std::vector<double> Numbers(const std::string& name, const std::string& text, std::size_t count) const
  {
    std::string plain = text;
    std::replace_if(
        plain.begin(), plain.end(), [](char c) { return c == '(' || c == ')' || c == ','; }, ' ');
    std::vector<double> numbers(count);
    if (!ParseNumbers(plain, count, numbers.data()) ||
        !std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); }))
    {
      Refuse(name, std::to_string(count) + " numbers are expected");
    }
    return numbers;
  }
  int Size(const std::string& name, double number) const
  {
    if (!(number >= 1 && number <= largestSide && number == std::floor(number)))
    {
      Refuse(name, "whole numbers from 1 to " + std::to_string(largestSide) + " are expected");
    }
    return static_cast<int>(number);
  }
};

/// In LPS.
VolumeGrid GridOfNrrd(const Header& header)
{
  std::string space = Lowercase(header.Text("space"));
  std::array<double, 3> toLps{};
  if (space == "left-posterior-superior" || space == "lps")
  {
    toLps = {1, 1, 1};
  }
  else if (space == "right-anterior-superior" || space == "ras")
  {
    toLps = {-1, -1, 1};
  }
  else if (space == "left-anterior-superior" || space == "las")
  {
    toLps = {1, -1, 1};
  }
  else
  {
    header.Refuse("space",
                  "left-posterior-superior, right-anterior-superior or left-anterior-superior is expected: save "
                  "the volume with 3D Slicer or ITK");
  }
  VolumeGrid grid;
  const std::string sizesText = header.Text("sizes");
  const std::vector<std::string_view> sizes = Words(sizesText);
  // "none (0.5,0,0) (0,0.5,0) (0,0,1)": one word an axis, blanks may stand inside parentheses.
  std::string directions = header.Text("space directions");
  for (std::size_t at = 0, depth = 0; at < directions.size(); ++at)
  {
    depth += directions[at] == '(' ? 1 : 0;
    depth -= directions[at] == ')' && depth > 0 ? 1 : 0;
    directions[at] = depth > 0 && directions[at] == ' ' ? ',' : directions[at];
  }
  const std::vector<std::string_view> axes = Words(directions);
  if (axes.size() != sizes.size())
  {
    header.Refuse("space directions", "one vector an axis is expected");
  }
  int axis = 0;
  for (std::size_t k = 0; k < axes.size(); ++k)
  {
    if (Lowercase(axes[k]) == "none")
    {
      continue;
    }
    double size = 0;
    if (axis == 3 || !ParseNumber(sizes[k], size))
    {
      header.Refuse(axis == 3 ? "space directions" : "sizes", "three axes in space are expected");
    }
    grid.size[axis] = header.Size("sizes", size);
    std::string vector(axes[k]);
    vector.erase(std::unique(vector.begin(), vector.end(), [](char a, char b) { return a == ',' && b == ','; }),
                 vector.end());
    const std::vector<double> step = header.Numbers("space directions", vector, 3);
    grid.steps.col(axis++) = Eigen::Vector3d(toLps[0] * step[0], toLps[1] * step[1], toLps[2] * step[2]);
  }
  if (axis != 3)
  {
    header.Refuse("space directions", "three axes in space are expected");
  }
  const std::vector<double> origin = header.Numbers("space origin", header.Text("space origin"), 3);
  grid.origin = Eigen::Vector3d(toLps[0] * origin[0], toLps[1] * origin[1], toLps[2] * origin[2]);
  return grid;
}

/// In LPS.
VolumeGrid GridOfMetaImage(const Header& header)
{
  const auto first = [&header](std::initializer_list<const char*> names, const std::string& otherwise)
  {
    for (const char* name : names)
    {
      if (header.fields.count(name))
      {
        return std::string(name);
      }
    }
    return otherwise;
  };
  if (header.Text("ndims") != "3")
  {
    header.Refuse("ndims", "3 is expected");
  }
  constexpr const char* kOfFrame = "seq_frame";
  if (const auto found = header.fields.lower_bound(kOfFrame);
      found != header.fields.end() && found->first.rfind(kOfFrame, 0) == 0)
  {
    header.Refuse(found->first,
                  "a sequence is no grid of voxels, since each of its frames lies elsewhere; give a volume");
  }
  VolumeGrid grid;
  const std::vector<double> size = header.Numbers("dimsize", header.Text("dimsize"), 3);
  const std::string spacingName = first({"elementspacing", "elementsize"}, "elementspacing");
  const std::vector<double> spacing = header.Numbers(spacingName, header.Text(spacingName, "1 1 1"), 3);
  const std::string originName = first({"offset", "position", "origin"}, "offset");
  const std::vector<double> origin = header.Numbers(originName, header.Text(originName, "0 0 0"), 3);
  const std::string axesName = first({"transformmatrix", "orientation", "rotation"}, "transformmatrix");
  const std::vector<double> axes = header.Numbers(axesName, header.Text(axesName, "1 0 0 0 1 0 0 0 1"), 9);
  for (int k = 0; k < 3; ++k)
  {
    grid.size[k] = header.Size("dimsize", size[k]);
    grid.origin[k] = origin[k];
    grid.steps.col(k) = spacing[k] * Eigen::Vector3d(axes[3 * k], axes[3 * k + 1], axes[3 * k + 2]);
  }
  return grid;
}

}  // namespace

VolumeGrid ReadVolumeGrid(const std::string& fileName, bool worldIsLps)
{
  InputFile input(fileName);
  const std::string beginning = WithoutMark(FileBeginning(fileName, 256));
  const bool isNrrd = beginning.rfind("NRRD000", 0) == 0;
  RequireFormat(isNrrd || beginning.substr(0, beginning.find('\n')).find('=') != std::string::npos, fileName,
                ": not a volume that is read; save it as .nrrd or .mha");
  const Header header{fileName, isNrrd ? ReadHeader(input, ':', "") : ReadHeader(input, '=', "elementdatafile")};
  VolumeGrid grid = isNrrd ? GridOfNrrd(header) : GridOfMetaImage(header);
  const Eigen::Matrix3d axes = grid.steps.colwise().normalized();
  RequireFormat(grid.steps.colwise().norm().minCoeff() > 0 && std::abs(axes.determinant()) > kFlattest, fileName,
                ": the axes of its voxels do not span space");
  if (!worldIsLps)
  {
    grid.origin.head<2>() *= -1;
    grid.steps.topRows<2>() *= -1;
  }
  return grid;
}

}  // namespace bigus
