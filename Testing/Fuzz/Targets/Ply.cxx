// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Fields as .ply, ours and those of splat viewers.
#include "Fuzz/Harness.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  RunInfo(Write("field.ply", bytes));
}

}  // namespace bigus::fuzz
