// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Grey and colour PNG images. Checksums of chunks are set right, because they would stop nearly every change.
#include "Fuzz/Png.h"

#include "Fuzz/Harness.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  ReadAsSequence(Write("image.png", WithRightChecksums(bytes)));
}

}  // namespace bigus::fuzz
