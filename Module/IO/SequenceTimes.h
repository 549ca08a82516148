// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// In which unit a sequence's times are.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "IO/SequenceFile.h"

namespace bigus
{

/// Seconds of a unit by its name in lower case, such as ms; 0 for no name, nothing for another word.
std::optional<double> UnitOfTime(const std::string& name);

/// Seconds of the unit in which a tracker may have the rate of these times, whose step on the median is returned, too; 1 where
/// there is none, or nothing to tell it by.
double UnitByRate(std::vector<double> times, double& step);

/// What a header says of the unit of its times where readers would take seconds for another; empty elsewhere.
std::string StatedUnitOf(const std::vector<double>& times);

/// Every frame's Timestamp becomes seconds: of the unit that the file states or, where it states none, of that by the rate,
/// which a note says.
void TakeTimesInSeconds(SequenceFile& file);

}  // namespace bigus
