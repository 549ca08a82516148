// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// NRRD sequences and volumes, and volumes as grids.
#include "Fuzz/Harness.h"
#include "IO/Formats/VolumeGrid.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  const std::string path = Write("input.nrrd", bytes);
  ReadAsSequence(path);
  RunAsProgram(
      [&path](command::Console&)
      {
        ReadVolumeGrid(path, true);
        return command::Success;
      });
}

}  // namespace bigus::fuzz
