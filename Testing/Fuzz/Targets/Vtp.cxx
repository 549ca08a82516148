// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Fields as .vtp in the encoding that we write. Others are VTK's to read, see SECURITY.md.
#include "IO/Formats/Vtp.h"

#include "Fuzz/Harness.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  const std::string path = Write("field.vtp", bytes);
  bool ours = true;
  try
  {
    ours = ReadVtp(path).has_value();
  }
  catch (const std::exception&)
  {
    // Refused: the program must say so.
  }
  if (ours)
  {
    RunInfo(path);
  }
}

}  // namespace bigus::fuzz
