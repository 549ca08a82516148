// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Labels/FieldLabels.h"

#include <algorithm>
#include <cmath>

#include "Core/Model/Error.h"

namespace bigus
{

void ValidateLabels(const std::vector<Label>& labels)
{
  int before = 0;
  for (const Label& label : labels)
  {
    Require(label.value > before && label.value <= kLargestLabel, "Labels: the value ", label.value, " after ", before,
            "; values ascend from 1 to 255.");
    before = label.value;
    Require(!label.name.empty(), "Labels: the label of value ", label.value, " has no name.");
    for (const double part : label.color)
    {
      Require(part >= 0 && part <= 1, "Labels: the colour of '", label.name, "' has the part ", part,
              "; red, green and blue lie between 0 and 1.");
    }
  }
}

std::array<double, 3> UsualColor(int value)
{
  // Hues a golden section of the circle apart are never close to those of the next few.
  const double hue = 6 * std::fmod(0.618034 * (value - 1), 1.0);
  std::array<double, 3> color{};
  for (int k = 0; k < 3; ++k)
  {
    const double at = std::fmod(hue + 6 - 2 * k, 6.0);  // 0 where this part is full
    color[k] = 0.9 * std::clamp(2 - std::min(at, 6 - at), 0.0, 1.0);
  }
  return color;
}

void FieldLabels::Validate(std::size_t gaussians) const
{
  ValidateLabels(labels);
  Require(weights.size() == (gaussians + points.size()) * labels.size(), "Labels: there are ", weights.size(),
          " weights for ", gaussians, " Gaussians, ", points.size(), " points and ", labels.size(), " labels.");
  for (std::size_t i = 0; i < weights.size(); ++i)
  {
    if (!(weights[i] >= 0 && weights[i] <= 1))
    {
      throw Error("Labels: weight " + std::to_string(i) + " is " + std::to_string(weights[i]) +
                  "; it must lie between 0 and 1.");
    }
  }
  for (std::size_t i = 0; i < points.size(); ++i)
  {
    ValidateGaussian(i, points[i].head<3>(), Eigen::Vector3d::Constant(points[i][3]), {1, 0, 0, 0}, 1);
  }
}

GaussianField FieldLabels::Carriers(const GaussianField& field) const
{
  GaussianField carriers = field;
  carriers.Resize(field.Size() + points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
  {
    carriers.means[field.Size() + i] = points[i].head<3>();
    carriers.scales[field.Size() + i].setConstant(points[i][3]);
    carriers.rotations[field.Size() + i] = {1, 0, 0, 0};
  }
  std::fill(carriers.reflectivities.begin(), carriers.reflectivities.end(), 1.0);
  return carriers;
}

GaussianField FieldLabels::CarriersOf(const GaussianField& field, int value) const
{
  const auto found =
      std::find_if(labels.begin(), labels.end(), [value](const Label& label) { return label.value == value; });
  Require(found != labels.end(), "LabelValue: the field has no label of the value ", value, ".");
  GaussianField carriers = Carriers(field);
  carriers.reflectivities = Raised(static_cast<std::size_t>(found - labels.begin()));
  return carriers;
}

std::vector<double> FieldLabels::Raised(std::size_t label) const
{
  std::vector<double> raised(weights.size() / labels.size());
  for (std::size_t i = 0; i < raised.size(); ++i)
  {
    raised[i] = 1.0 + weights[i * labels.size() + label];
  }
  return raised;
}

FieldLabels Transformed(FieldLabels labels, const Eigen::Matrix4d& transform)
{
  const double scale = std::cbrt(std::abs(transform.topLeftCorner<3, 3>().determinant()));
  for (Eigen::Vector4d& point : labels.points)
  {
    // As floats, so that to turn a field leaves them what they are.
    point << (transform * point.head<3>().homogeneous()).head<3>().eval(), static_cast<float>(scale * point[3]);
  }
  return labels;
}

}  // namespace bigus
