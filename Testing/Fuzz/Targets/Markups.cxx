// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// 3D Slicer's markups: planes, lines and regions of interest.
#include "IO/Formats/Markups.h"

#include "Fuzz/Harness.h"
#include "Inputs.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  const std::string path = Write("plane.mrk.json", bytes);
  RunAsProgram(
      [&path](command::Console& console)
      {
        command::PlaneOptions options;
        options.poses = path;
        command::ReadPlanes(options, console);
        return command::Success;
      });
  RunAsProgram(
      [&path](command::Console&)
      {
        ReadMarkupBox(path, true);
        return command::Success;
      });
}

}  // namespace bigus::fuzz
