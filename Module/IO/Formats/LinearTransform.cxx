// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/LinearTransform.h"

#include <cmath>
#include <sstream>
#include <vector>

#include "IO/FileError.h"
#include "IO/Formats/Hdf5Transform.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::uint64_t largestFile = 1u << 20;
constexpr const char* itkMagic = "#Insight Transform File";

std::vector<double> Numbers(const std::string& where, std::string_view text)
{
  const auto words = Words(text);
  std::vector<double> numbers(words.size());
  for (std::size_t i = 0; i < words.size(); ++i)
  {
    if (!ParseNumber(words[i], numbers[i]) || !std::isfinite(numbers[i]))
    {
      throw FormatError(where + ": " + Quoted(words[i]) + " is not a number");
    }
  }
  return numbers;
}

/// "AffineTransform_double_3_3" to "AffineTransform". Throws FileError unless it is one between 3-D points.
std::string TypeOf(const std::string& fileName, std::string_view name)
{
  for (const std::string_view end : {"_double_3_3", "_float_3_3"})
  {
    if (name.size() > end.size() && name.substr(name.size() - end.size()) == end)
    {
      return std::string(name.substr(0, name.size() - end.size()));
    }
  }
  throw FormatError(fileName + ": the transform " + Quoted(name) + " is not one between 3-D points (..._double_3_3)");
}

std::vector<TransformEntry> TextEntries(const std::string& fileName, const std::string& text)
{
  std::vector<TransformEntry> entries;
  std::istringstream lines(text);
  std::string line;
  while (std::getline(lines, line))
  {
    const std::string_view whole = Trimmed(line);
    if (whole.empty() || whole[0] == '#')
    {
      continue;
    }
    const auto colon = whole.find(':');
    const std::string_view key = whole.substr(0, colon);
    const std::string_view value = colon == std::string_view::npos ? "" : Trimmed(whole.substr(colon + 1));
    if (key == "Transform")
    {
      entries.push_back({std::string(value), {}, {}});
    }
    else if (!entries.empty() && (key == "Parameters" || key == "FixedParameters"))
    {
      const std::string where = fileName + ": " + std::string(key);
      (key == "Parameters" ? entries.back().parameters : entries.back().fixedParameters) = Numbers(where, value);
    }
    else
    {
      throw FormatError(fileName + ": " + Quoted(whole) + " is no line of an ITK transform file");
    }
  }
  return entries;
}

/// x -> M (x - c) + c + t, with M and t as the type has them and the centre c.
Eigen::Matrix4d MatrixOf(const std::string& fileName, const TransformEntry& entry)
{
  const std::vector<double>& p = entry.parameters;
  const auto require = [&](std::size_t parameters, std::size_t fewestFixed, std::size_t mostFixed)
  {
    const std::size_t fixed = entry.fixedParameters.size();
    if (p.size() != parameters || fixed < fewestFixed || fixed > mostFixed)
    {
      throw FormatError(fileName + ": " + entry.type + " has " + std::to_string(p.size()) + " Parameters and " +
                        std::to_string(fixed) + " FixedParameters; " + std::to_string(parameters) + " and " +
                        std::to_string(fewestFixed) + " are expected");
    }
  };
  // The rotation of a versor, whose fourth component is not in the file.
  const auto versor = [&]
  {
    const double rest = 1 - p[0] * p[0] - p[1] * p[1] - p[2] * p[2];
    if (rest < -1e-6)
    {
      throw FormatError(fileName + ": the versor of " + entry.type + " is longer than 1");
    }
    return Eigen::Quaterniond(std::sqrt(std::max(rest, 0.0)), p[0], p[1], p[2]).normalized().toRotationMatrix();
  };
  Eigen::Matrix3d linear = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  if (entry.type == "AffineTransform" || entry.type == "MatrixOffsetTransformBase" || entry.type == "Rigid3DTransform")
  {
    require(12, 3, 3);
    linear = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(p.data());
    translation = Eigen::Map<const Eigen::Vector3d>(p.data() + 9);
  }
  else if (entry.type == "Euler3DTransform")
  {
    require(6, 3, 4);
    using Eigen::AngleAxisd;
    using Eigen::Vector3d;
    const AngleAxisd x(p[0], Vector3d::UnitX()), y(p[1], Vector3d::UnitY()), z(p[2], Vector3d::UnitZ());
    const bool zyx = entry.fixedParameters.size() == 4 && entry.fixedParameters[3] != 0;
    linear = zyx ? (z * y * x).toRotationMatrix() : (z * x * y).toRotationMatrix();
    translation = Eigen::Map<const Eigen::Vector3d>(p.data() + 3);
  }
  else if (entry.type == "VersorRigid3DTransform" || entry.type == "Similarity3DTransform")
  {
    const bool similar = entry.type == "Similarity3DTransform";
    require(similar ? 7 : 6, 3, 3);
    linear = (similar ? p[6] : 1.0) * versor();
    translation = Eigen::Map<const Eigen::Vector3d>(p.data() + 3);
  }
  else if (entry.type == "TranslationTransform")
  {
    require(3, 0, 0);
    translation = Eigen::Map<const Eigen::Vector3d>(p.data());
  }
  else
  {
    throw FormatError(fileName + ": " + Quoted(entry.type) +
                      " is not read; Affine, MatrixOffsetTransformBase, Rigid3D, Euler3D, VersorRigid3D, Similarity3D, "
                      "Translation and a Composite of them are");
  }
  if (!entry.fixedParameters.empty())
  {
    const Eigen::Vector3d centre = Eigen::Map<const Eigen::Vector3d>(entry.fixedParameters.data());
    translation += centre - linear * centre;
  }
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = linear;
  matrix.topRightCorner<3, 1>() = translation;
  return matrix;
}

}  // namespace

LinearTransform ReadLinearTransform(const std::string& fileName)
{
  const std::string text = ReadTextFile(fileName, largestFile);
  const bool isHdf5 = LooksLikeHdf5(text);
  if (!isHdf5 && text.rfind(itkMagic, 0) != 0)
  {
    double numbers[16];
    if (!ParseNumbers(text, 16, numbers))
    {
      throw FormatError(fileName +
                        ": neither a linear transform of ITK (.tfm, .txt, .h5) nor 16 numbers, a 4 x 4 matrix "
                        "row by row");
    }
    return {Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers), false};
  }
  std::vector<TransformEntry> entries = isHdf5 ? ReadHdf5Transforms(fileName) : TextEntries(fileName, text);
  for (TransformEntry& entry : entries)
  {
    entry.type = TypeOf(fileName, entry.type);
    for (const double number : entry.parameters)
    {
      if (!std::isfinite(number))
      {
        throw FormatError(fileName + ": " + entry.type + " has a parameter that is not finite");
      }
    }
  }
  const bool composite = !entries.empty() && entries.front().type == "CompositeTransform";
  if (composite)
  {
    entries.erase(entries.begin());
  }
  if (entries.empty() || (!composite && entries.size() > 1))
  {
    throw FormatError(fileName + ": has " + std::to_string(entries.size()) +
                      " transforms; one is expected, or a Composite of some");
  }
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  for (const TransformEntry& entry : entries)
  {
    matrix = matrix * MatrixOf(fileName, entry);  // the last of the list comes first to a point
  }
  return {matrix, true};
}

Eigen::Matrix4d ReadObjectMatrix(const std::string& fileName, bool worldIsLps)
{
  const LinearTransform file = ReadLinearTransform(fileName);
  if (!file.isItk)
  {
    return file.matrix;
  }
  if (!(std::abs(file.matrix.determinant()) > 0))
  {
    throw FormatError(fileName + ": the transform has no inverse");
  }
  const Eigen::Vector4d signs = worldIsLps ? Eigen::Vector4d(1, 1, 1, 1) : Eigen::Vector4d(-1, -1, 1, 1);
  return signs.asDiagonal() * file.matrix.inverse() * signs.asDiagonal();
}

bool LooksLikeTransform(const std::string& beginning)
{
  return LooksLikeHdf5(beginning) || beginning.rfind(itkMagic, 0) == 0;
}

}  // namespace bigus
