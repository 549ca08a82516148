// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What callers of Train keep beside its field: where it comes from, in lines `key=value`, and what standard errors rest on.
// And what they say while it runs.
#pragma once

#include <string>
#include <vector>

#include "Core/Trainer/Trainer.h"

namespace bigus
{

/// What `poses` says where a field was trained at the poses of its sweep; else how far they were corrected.
inline constexpr const char* kAsTracked = "as tracked";

/// Appends `key=value`, replacing an earlier line of that key.
void SetProvenanceLine(std::vector<std::string>& lines, const std::string& key, const std::string& value);

/// The choices a training rested on: seed, loss, the settled options by their properties' names,
/// `decision.NAME` = choice (evidence), and how far poses were corrected. Of several sequences `sequences` says how many,
/// and `poses.sequence1` and so on the same for each. Nothing that differs between two equal runs,
/// such as the time. `isContinued`: the training began with a field.
void AddTrainingProvenance(std::vector<std::string>& lines, const TrainingResult& result, const Sweep& sweep,
                           bool isContinued);

/// Numbers of frames as provenance has them: between blanks.
std::string FrameListText(const std::vector<int>& frames);

/// StandardError::ToBytes of what a training of `recorded` gave, measured on all frames that are not held out, at the poses
/// that it was trained at. Empty for a training that was stopped, and where measuring would take more than a tenth of
/// `timeLimit` (s; 0: none). Throws Error where it cannot be had.
std::string MeasureStandardError(const TrainingResult& result, const Sweep& recorded, double timeLimit);

/// What filters and Python say while a training runs: "iteration 120, loss 0.0123, 14 s left".
std::string ProgressText(const TrainingProgress& progress);

}  // namespace bigus
