// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The gradient of a field's loss against differences of the loss.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/GaussianField.h"
#include "Support/Fields.h"

namespace bigus::test
{

/// Central differences of value(field) by every parameter against a gradient.
template <class Value>
void CompareGradient(const GaussianField& field, const FieldGradient& gradient, Value&& value)
{
  const auto difference = [&](auto&& change)
  {
    const double h = 2e-3;
    const auto at = [&](double step)
    {
      GaussianField changed = field;
      change(changed, step);
      return value(changed);
    };
    return (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
  };
  std::vector<double> analytic[4], numeric[4];
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    for (int k = 0; k < 3; ++k)
    {
      analytic[0].push_back(gradient.means[i][k]);
      numeric[0].push_back(difference([=](GaussianField& f, double step) { f.means[i][k] += step; }));
      analytic[1].push_back(gradient.logScales[i][k]);
      numeric[1].push_back(difference([=](GaussianField& f, double step) { f.scales[i][k] *= std::exp(step); }));
      analytic[2].push_back(gradient.rotations[i][k]);
      numeric[2].push_back(difference(
          [=](GaussianField& f, double step)
          {
            const Eigen::Matrix3d turn = Eigen::AngleAxisd(step, Eigen::Vector3d::Unit(k)).toRotationMatrix();
            f.rotations[i] = Quaternion(RotationMatrix(f.rotations[i]) * turn);
          }));
    }
    analytic[3].push_back(gradient.reflectivities[i]);
    numeric[3].push_back(difference([=](GaussianField& f, double step) { f.reflectivities[i] += step; }));
  }
  const char* names[4] = {"mean", "log-scale", "rotation", "reflectivity"};
  for (int group = 0; group < 4; ++group)
  {
    double largest = 0;
    for (double value : numeric[group])
    {
      largest = std::max(largest, std::abs(value));
    }
    EXPECT_GT(largest, 0);
    for (std::size_t i = 0; i < numeric[group].size(); ++i)
    {
      EXPECT_NEAR(analytic[group][i], numeric[group][i], 2e-6 * std::max(std::abs(numeric[group][i]), 1e-3 * largest))
          << names[group] << " component " << i;
    }
  }
}

}  // namespace bigus::test
