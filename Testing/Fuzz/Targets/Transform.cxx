// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Linear transforms of ITK and 3D Slicer.
#include "Fuzz/Harness.h"
#include "IO/Formats/LinearTransform.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  const std::string path = Write("t.tfm", bytes);
  RunAsProgram(
      [&path](command::Console&)
      {
        ReadLinearTransform(path);
        return command::Success;
      });
}

}  // namespace bigus::fuzz
