// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The mean of fields that one training passes through. Private to Core.
#pragma once

#include "Core/Model/GaussianField.h"

namespace bigus
{

/// The mean over fields of the same Gaussians, number by number: what their steps jitter by averages out (Polyak and
/// Juditsky, SIAM J. Control Optim. 30, 1992). A quaternion and its negative are the same rotation.
struct FieldAverage
{
  GaussianField mean;
  int count = 0;  ///< fields in it

  /// `field` has as many Gaussians as those before, in the same order.
  void Add(const GaussianField& field);
};

}  // namespace bigus
