// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Plus configurations, for a sequence that needs one and for one that does not.
#include "Fuzz/Harness.h"
#include "IO/SmallFiles.h"

namespace bigus::fuzz
{
namespace
{

std::string Sequence()
{
  test::Sequence sequence = test::SmallSequence();
  for (int frame = 0; frame < test::smallFrames; ++frame)
  {
    sequence.Set(test::SmallField(frame, "ProbeToReferenceTransform"), test::SmallPoseText(frame));
    sequence.Set(test::SmallField(frame, "ProbeToReferenceTransformStatus"), "OK");
    sequence.Remove(test::SmallField(frame, "ImageToReferenceTransform"));
    sequence.Remove(test::SmallField(frame, "ImageToReferenceTransformStatus"));
  }
  return sequence.Bytes();
}

}  // namespace

void TryInput(const std::string& bytes)
{
  static const std::string sequence = Write("small.mha", Sequence());
  const std::string path = Write("plus.xml", bytes);
  if (!ReadAsSequence(sequence, path).answer.empty())
  {
    RunInfo(sequence, {"--image-from", "Probe", "--config", path});
  }
}

}  // namespace bigus::fuzz
