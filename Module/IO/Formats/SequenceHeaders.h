// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The formats of tracked sequences: what tells each, and its header. All of them throw FileError.
#pragma once

#include <string>

#include "IO/SequenceFile.h"
#include "IO/Text.h"

namespace bigus
{

/// Whether a file that begins with these bytes is of the format.
bool LooksLikeMetaImage(const std::string& beginning);
bool LooksLikeNrrd(const std::string& beginning);
bool LooksLikePoseCsv(const std::string& beginning);

/// https://itk.org/Wiki/ITK/MetaIO/Documentation, with the per-frame fields of Plus and IGSIO.
void ReadMetaImageHeader(SequenceFile& file, InputFile& input);

/// https://teem.sourceforge.net/nrrd/format.html, with the per-frame fields of IGSIO as key/value pairs.
void ReadNrrdHeader(SequenceFile& file, InputFile& input, const ImageOptions& options);

/// Poses as a table, with PNG images; README.md lists the columns.
void ReadPoseCsv(SequenceFile& file, InputFile& input, const ImageOptions& options);

}  // namespace bigus
