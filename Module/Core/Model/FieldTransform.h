// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field moved to other coordinates, where all that has a place, a direction or a length follows; or without some of its
// Gaussians.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <functional>
#include <string>

#include "Core/Model/GaussianField.h"

namespace bigus
{

/// The field S' with S'(A x) = S(x) for x' = A x, where A = [k Q, t; 0, 1] turns (Q, which may mirror), scales (k > 0) and
/// moves (t, mm):
///
///   mu' = k Q mu + t,   R' = Q R,   s' = k s,   sigma' = k sigma of both beams,   e' = Q e of the trained normals.
///
/// So a slice at A T shows what the slice at T showed before. Throws Error when A is not finite, is perspective, or
/// stretches space differently in different directions (by more than 1e-6 of k), because the beam's thickness would
/// then depend on where a plane points.
GaussianField Transformed(GaussianField field, const Eigen::Matrix4d& transform);

/// Removes the Gaussians whose index `isKept`, asked in order, denies.
void Keep(GaussianField& field, const std::function<bool(std::size_t)>& isKept);

/// What provenance says of a transform that comes after those that `before` tells: its numbers row by row, exactly.
std::string TransformText(const std::string& before, const Eigen::Matrix4d& transform);

/// The error of a transform that is not linear. `property`: where it was given; `kind`: the name of its class; `what`: what
/// it may bend.
[[noreturn]] void RefuseTransform(const std::string& property, const std::string& kind, const std::string& what);

}  // namespace bigus
