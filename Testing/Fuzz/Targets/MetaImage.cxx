// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// MetaImage sequences and volumes, and volumes as grids.
#include "Fuzz/Harness.h"
#include "IO/Formats/VolumeGrid.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  const std::string path = Write("input.mha", bytes);
  ReadAsSequence(path);
  RunAsProgram(
      [&path](command::Console&)
      {
        ReadVolumeGrid(path, true);
        return command::Success;
      });
}

}  // namespace bigus::fuzz
