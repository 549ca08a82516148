// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// MetaImage sequences and volumes.
#include "Fuzz/Harness.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  ReadAsSequence(Write("input.mha", bytes));
}

}  // namespace bigus::fuzz
