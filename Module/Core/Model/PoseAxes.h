// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The axes of a picture's pose: two are the picture's, and the third may be none.
#pragma once

#include <Eigen/Dense>

namespace bigus
{

/// Sine of the angle below which two axes count as lying in a line, and three in a plane.
constexpr double kFlattestAxes = 1e-9;

/// The determinant of a matrix's three axes as if each had length 1: 0 where they lie in a plane or one is zero, below 0
/// where they are left-handed.
double Handedness(const Eigen::Matrix4d& matrix);

/// A picture has two axes. Makes the third of its pose where it is zero, lies in their plane or, unless
/// `keepsLeftHanded`, points the other way: of length 1, along the normal. Returns whether it was made.
bool MakeThirdAxis(Eigen::Matrix4d& imageToReference, bool keepsLeftHanded);

}  // namespace bigus
