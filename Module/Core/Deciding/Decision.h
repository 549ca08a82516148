// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace bigus
{

/// A choice that training rests on, why, and what finding out cost.
struct Decision
{
  std::string what;      ///< "Gaussians", "elevation sigma", ...
  std::string choice;    ///< with its unit
  std::string evidence;  ///< what was compared, in dB on validation frames; "given" when the caller chose
  double seconds = 0;
};

}  // namespace bigus
