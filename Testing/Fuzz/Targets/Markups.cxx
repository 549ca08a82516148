// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// 3D Slicer's markups: planes, lines and regions of interest.
#include "IO/Formats/Markups.h"

#include "Fuzz/Harness.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  const std::string path = Write("plane.mrk.json", bytes);
  command::PlaneOptions options;
  options.poses = path;
  ReadAsPlanes(options);
  RunAsProgram(
      [&path](command::Console&)
      {
        ReadMarkupBox(path, true);
        return command::Success;
      });
}

}  // namespace bigus::fuzz
