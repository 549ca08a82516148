// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the header of a sequence says besides frames and poses: names of people, dates, remarks. Metadata.md tells what
// becomes of it.
#pragma once

#include <string>
#include <vector>

#include "IO/Poses.h"
#include "IO/SequenceFile.h"

namespace bigus
{

/// A field of a header that is read past. Texts are fit for a message: at most 60 bytes each.
struct UnusedField
{
  std::string name;   ///< without Seq_Frame0000_; "comment" for a line of comment
  std::string value;  ///< the first that there is
  int count = 1;      ///< how many frames, or lines of comment, have it
};

/// All of them by name, comments first. Neither what describes the pixels' grid nor the `transforms` that were found are
/// among them.
std::vector<UnusedField> UnusedFieldsOf(const SequenceFile& file, const std::vector<TransformName>& transforms);

}  // namespace bigus
