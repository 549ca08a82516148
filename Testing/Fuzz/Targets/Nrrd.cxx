// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// NRRD sequences and volumes.
#include "Fuzz/Harness.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  ReadAsSequence(Write("input.nrrd", bytes));
}

}  // namespace bigus::fuzz
