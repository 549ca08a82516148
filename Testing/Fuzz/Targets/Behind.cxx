// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Behind the parsers: Structured.h tells what BIGUS_TRY does.
#include "Fuzz/Harness.h"
#include "Fuzz/Structured.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  if (const std::string wrong = BIGUS_TRY(bytes).value_or(""); !wrong.empty())
  {
    Finding(wrong);
  }
}

}  // namespace bigus::fuzz
