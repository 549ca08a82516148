// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a training leaves in its field for standard errors.
#pragma once

#include <string>

#include "Core/Model/Sweep.h"
#include "Core/Trainer/Trainer.h"

namespace bigus
{

/// StandardError::ToBytes of what a training of `recorded` gave, measured on all frames that are not held out, at the poses
/// that it was trained at. Empty for a training that was stopped, and where measuring would take more than a tenth of
/// `timeLimit` (s; 0: none). Throws Error where it cannot be had.
std::string MeasureStandardError(const TrainingResult& result, const Sweep& recorded, double timeLimit);

}  // namespace bigus
