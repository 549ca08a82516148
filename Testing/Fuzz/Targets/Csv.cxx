// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// CSVs of poses: as slice planes, and as a sweep of three PNG images beside them.
#include "Fuzz/Harness.h"
#include "Fuzz/Png.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  static const std::string images[] = {Write("frame_0.png", Png(4, 3)), Write("frame_1.png", Png(4, 3)),
                                       Write("frame_2.png", Png(4, 3))};
  const std::string path = Write("input.csv", bytes);
  ReadAsSequence(path);
  command::PlaneOptions options;
  options.poses = path;
  options.size = {4, 3};
  ReadAsPlanes(options);
}

}  // namespace bigus::fuzz
