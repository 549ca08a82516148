// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How large what has a label is, and how sure that is.
#pragma once

#include <string>
#include <vector>

#include "Core/Labels/Labels.h"

namespace bigus
{

struct LabelVolume
{
  Label label;
  double volume = 0;  ///< mm^3 where the label's share is at least 1/2, seen without a beam
  double standardError =
      0;  ///< mm^3; README.md says of what. Not a number where fewer than three frames have the label,
          ///< or a sweep has it that was drawn on fewer
};

/// Of each label that was fitted to these pictures. `trackerNoise`: mm, at least 0, of a frame's place along its normal
/// (TrackerNoise of Core/StandardError).
std::vector<LabelVolume> MeasureLabels(const GaussianField& field, const FieldLabels& labels, const Sweep& sweep,
                                       const LabelFrames& drawn, double trackerNoise,
                                       const std::string& engine = "auto");

}  // namespace bigus
