// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "Core/Training/TrainingProgress.h"

namespace bigus
{

/// What filters and Python say while a training runs: "iteration 120, loss 0.0123, 14 s left".
std::string ProgressText(const TrainingProgress& progress);

}  // namespace bigus
