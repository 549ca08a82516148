// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Linear transforms of ITK and 3D Slicer, and a field that they move.
#include "Fuzz/Harness.h"
#include "Fuzz/Structured.h"
#include "IO/Formats/LinearTransform.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  const std::string path = Write("t.tfm", bytes);
  RunAsProgram(
      [&path](command::Console&)
      {
        for (const bool isLps : {false, true})
        {
          Transformed(UsualField(), ReadObjectMatrix(path, isLps)).Validate();
        }
        return command::Success;
      });
}

}  // namespace bigus::fuzz
