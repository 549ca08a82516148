// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A method that is no part of this program: it gets the training frames and predicts the planes that are scored.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "Core/Model/Sweep.h"

/// Works in two runs of one job, with the other program between them. The first writes into the folder the training frames,
/// `training.txt` and `training.f32`, and the planes that are asked for, `asked.txt`. The second finds their pictures there,
/// `predicted.f32`. A line of text is a plane: width, height, then the centre of pixel (0, 0), the step along a row and that
/// along a column in mm. Pictures are float32 of this machine's order of bytes, row by row, one behind the other,
/// intensities in [0, 1]; NaN in training frames: no probe lights it.
class Outside
{
public:
  /// Throws bigus::Error for a folder that cannot be written, or whose pictures are not those asked for.
  Outside(const std::filesystem::path& folder, const bigus::Sweep& sweep, const std::vector<int>& training);

  /// Black in the first run. Planes must be asked for in the same order in both.
  void Predict(const bigus::SlicePlane& plane, float* image);

  bool IsPredicted() const { return isPredicted_; }

private:
  bool isPredicted_;
  std::string name_;  // of the folder
  std::fstream asked_;
  std::ifstream pictures_;
  int count_ = 0;  // of planes
};
