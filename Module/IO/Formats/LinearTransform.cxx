// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/LinearTransform.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <sstream>
#include <vector>

#include "IO/FileError.h"
#include "IO/Formats/Hdf5Transform.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::uint64_t largestTransform = 1u << 20;
constexpr const char* itkMagic = "#Insight Transform File";

std::vector<double> Numbers(const std::string& where, std::string_view text)
{
  const auto words = Words(text);
  std::vector<double> numbers(words.size());
  for (std::size_t i = 0; i < words.size(); ++i)
  {
    RequireFormat(ParseNumber(words[i], numbers[i]) && std::isfinite(numbers[i]), where, ": ", Quoted(words[i]),
                  " is not a number");
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

/// x -> L (x - c) + c + t, where c is the centre that the fixed parameters begin with.
struct Affine
{
  Eigen::Matrix3d linear = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};

using Vector = Eigen::Map<const Eigen::Vector3d>;

/// The rotation of a versor, whose fourth component is not in the file.
Eigen::Matrix3d Versor(const std::string& where, const double* p)
{
  const double rest = 1 - p[0] * p[0] - p[1] * p[1] - p[2] * p[2];
  RequireFormat(rest >= -1e-6, where, ": the versor is longer than 1");
  return Eigen::Quaterniond(std::sqrt(std::max(rest, 0.0)), p[0], p[1], p[2]).normalized().toRotationMatrix();
}

Eigen::Matrix3d Euler(const double* p, const std::vector<double>& fixed)
{
  using Eigen::AngleAxisd;
  using Eigen::Vector3d;
  const AngleAxisd x(p[0], Vector3d::UnitX()), y(p[1], Vector3d::UnitY()), z(p[2], Vector3d::UnitZ());
  const bool zyx = fixed.size() == 4 && fixed[3] != 0;
  return zyx ? (z * y * x).toRotationMatrix() : (z * x * y).toRotationMatrix();
}

/// ITK adds scales and skews to a versor's rotation, and does not multiply.
Eigen::Matrix3d WithScales(Eigen::Matrix3d linear, const double* scales)
{
  linear.diagonal() += Vector(scales) - Eigen::Vector3d::Ones();
  return linear;
}

Eigen::Matrix3d WithSkews(Eigen::Matrix3d linear, const double* k)
{
  Eigen::Matrix3d skews;
  skews << 0, k[0], k[1], k[2], 0, k[3], k[4], k[5], 0;
  return linear + skews;
}

/// The one type that multiplies: three scales after three skews.
Eigen::Matrix3d Composed(const double* k)
{
  Eigen::Matrix3d skews;
  skews << 1, k[3], k[4], 0, 1, k[5], 0, 0, 1;
  return Vector(k).asDiagonal() * skews;
}

/// A type of ITK's: how many parameters and fixed parameters it has, and what they mean.
struct Kind
{
  const char* type;
  std::size_t parameters, fewestFixed, mostFixed;
  Affine (*read)(const std::string& where, const double* p, const std::vector<double>& fixed);
};

Affine ReadMatrix(const std::string&, const double* p, const std::vector<double>&)
{
  return {Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(p), Vector(p + 9)};
}

const Kind kKinds[] = {
    {"AffineTransform", 12, 3, 3, ReadMatrix},
    {"MatrixOffsetTransformBase", 12, 3, 3, ReadMatrix},
    {"Rigid3DTransform", 12, 3, 3, ReadMatrix},
    {"Euler3DTransform", 6, 3, 4,
     [](const std::string&, const double* p, const std::vector<double>& fixed) {
       return Affine{Euler(p, fixed), Vector(p + 3)};
     }},
    {"VersorTransform", 3, 3, 3,
     [](const std::string& where, const double* p, const std::vector<double>&) {
       return Affine{Versor(where, p), Eigen::Vector3d::Zero()};
     }},
    {"VersorRigid3DTransform", 6, 3, 3,
     [](const std::string& where, const double* p, const std::vector<double>&) {
       return Affine{Versor(where, p), Vector(p + 3)};
     }},
    {"Similarity3DTransform", 7, 3, 3,
     [](const std::string& where, const double* p, const std::vector<double>&) {
       return Affine{p[6] * Versor(where, p), Vector(p + 3)};
     }},
    {"ScaleVersor3DTransform", 9, 3, 3,
     [](const std::string& where, const double* p, const std::vector<double>&) {
       return Affine{WithScales(Versor(where, p), p + 6), Vector(p + 3)};
     }},
    {"ScaleSkewVersor3DTransform", 15, 3, 3,
     [](const std::string& where, const double* p, const std::vector<double>&) {
       return Affine{WithSkews(WithScales(Versor(where, p), p + 6), p + 9), Vector(p + 3)};
     }},
    {"ComposeScaleSkewVersor3DTransform", 12, 3, 3,
     [](const std::string& where, const double* p, const std::vector<double>&) {
       return Affine{Versor(where, p) * Composed(p + 6), Vector(p + 3)};
     }},
    {"ScaleTransform", 3, 3, 3,
     [](const std::string&, const double* p, const std::vector<double>&) {
       return Affine{Vector(p).asDiagonal(), Eigen::Vector3d::Zero()};
     }},
    {"TranslationTransform", 3, 0, 0,
     [](const std::string&, const double* p, const std::vector<double>&) {
       return Affine{Eigen::Matrix3d::Identity(), Vector(p)};
     }},
    {"IdentityTransform", 0, 0, 0,
     [](const std::string&, const double*, const std::vector<double>&) { return Affine(); }},
};

Eigen::Matrix4d MatrixOf(const std::string& fileName, const TransformEntry& entry)
{
  const auto kind =
      std::find_if(std::begin(kKinds), std::end(kKinds), [&entry](const Kind& one) { return entry.type == one.type; });
  RequireFormat(kind != std::end(kKinds), fileName, ": ", Quoted(entry.type),
                " is not read; Identity, Translation, Scale, Affine, MatrixOffsetTransformBase, Rigid3D, Euler3D, "
                "Versor, VersorRigid3D, Similarity3D, ScaleVersor3D, ScaleSkewVersor3D, ComposeScaleSkewVersor3D and a "
                "Composite of them are");
  const std::size_t fixed = entry.fixedParameters.size();
  RequireFormat(entry.parameters.size() == kind->parameters && fixed >= kind->fewestFixed && fixed <= kind->mostFixed,
                fileName, ": ", entry.type, " has ", entry.parameters.size(), " Parameters and ", fixed,
                " FixedParameters; ", kind->parameters, " and ", kind->fewestFixed, " are expected");
  auto [linear, translation] = kind->read(fileName + ": " + entry.type, entry.parameters.data(), entry.fixedParameters);
  if (!entry.fixedParameters.empty())
  {
    const Eigen::Vector3d centre = Vector(entry.fixedParameters.data());
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
  const std::string text = ReadTextFile(fileName, largestTransform);
  const bool isHdf5 = LooksLikeHdf5(text);
  if (!isHdf5 && text.rfind(itkMagic, 0) != 0)
  {
    double numbers[16];
    RequireFormat(ParseNumbers(text, 16, numbers), fileName,
                  ": neither a linear transform of ITK (.tfm, .txt, .h5) nor 16 numbers, a 4 x 4 matrix "
                  "row by row");
    return {Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers), false};
  }
  std::vector<TransformEntry> entries = isHdf5 ? ReadHdf5Transforms(fileName) : TextEntries(fileName, text);
  for (TransformEntry& entry : entries)
  {
    entry.type = TypeOf(fileName, entry.type);
    for (const double number : entry.parameters)
    {
      RequireFormat(std::isfinite(number), fileName, ": ", entry.type, " has a parameter that is not finite");
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
  RequireFormat(std::abs(file.matrix.determinant()) > 0, fileName, ": the transform has no inverse");
  const Eigen::Vector4d signs = worldIsLps ? Eigen::Vector4d(1, 1, 1, 1) : Eigen::Vector4d(-1, -1, 1, 1);
  return signs.asDiagonal() * file.matrix.inverse() * signs.asDiagonal();
}

bool LooksLikeTransform(const std::string& beginning)
{
  return LooksLikeHdf5(beginning) || beginning.rfind(itkMagic, 0) == 0;
}

}  // namespace bigus
