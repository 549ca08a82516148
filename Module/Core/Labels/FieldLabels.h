// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the parts of a scene are called, and what each Gaussian of a field has of them.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "Core/Model/GaussianField.h"

namespace bigus
{

constexpr int kLargestLabel = 255;

/// A name for a value of label pictures, whose 0 is what has no label.
struct Label
{
  int value = 1;                           ///< 1 to 255
  std::string name;                        ///< not empty
  std::array<double, 3> color{0.9, 0, 0};  ///< red, green, blue, 0 to 1
};

/// Throws Error unless values ascend within their range, names are not empty and colours are colours.
void ValidateLabels(const std::vector<Label>& labels);

/// A colour for a label that has none, well apart from those of its neighbours.
std::array<double, 3> UsualColor(int value);

/// What each Gaussian has of every label. Where borders run between Gaussians, or none lie because all is dark there, further
/// round ones carry labels and nothing else.
struct FieldLabels
{
  std::vector<Label> labels;            ///< [K], ascending
  std::vector<float> weights;           ///< [N + M][K] 0 to 1: of the field's Gaussians, then of the further ones
  std::vector<Eigen::Vector4d> points;  ///< [M] x, y, z and standard deviation, mm

  /// Throws Error unless labels are valid, points can be Gaussians, and there are finite weights from 0 to 1 for so many
  /// Gaussians and the points.
  void Validate(std::size_t gaussians) const;

  /// The field's Gaussians and the further ones, [N + M], all of reflectivity 1, under the field's beam.
  GaussianField Carriers(const GaussianField& field) const;

  /// The same of reflectivities 1 + w, which give a Gaussian the same footprint whatever it has of the label of this value:
  /// ShareOf shows it. Throws Error where there is none.
  GaussianField CarriersOf(const GaussianField& field, int value) const;
};

/// The labels of Transformed(field, transform).
FieldLabels Transformed(FieldLabels labels, const Eigen::Matrix4d& transform);

}  // namespace bigus
