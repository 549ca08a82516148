// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The scatterers that a plane's probe can see. The world is not stored: a hash places them.
#pragma once

#include <functional>

#include "Core/Phantom/Aperture.h"

namespace bigus
{

struct Scatterer
{
  BeamPoint place;
  double elevation;  ///< mm out of the plane
  double amplitude;
};

/// Calls visit for every scatterer that can reach the image, in an order that depends on the plane only. In the
/// amplitudes' unit the echo of parenchyma has root mean square 1.
void ForEachScatterer(const PhantomOptions& options, const Aperture& aperture,
                      const std::function<void(const Scatterer&)>& visit);

}  // namespace bigus
