// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Messages of an OpenIGTLink server, one after another, and the field that grows with them.
#include "Live/OpenIgtLink.h"

#include <algorithm>

#include "Fuzz/Harness.h"
#include "Fuzz/Structured.h"
#include "IO/Poses.h"
#include "Live/LiveTraining.h"

namespace bigus::fuzz
{

namespace
{

/// The body as an image, a transform or a text, and the image as a frame. Gives what reading says.
void TryMessage(const IgtHeader& header, const std::vector<std::uint8_t>& body, LiveTraining& training)
{
  if (header.type == "TRANSFORM")
  {
    ParseIgtTransform(header, body);
    return;
  }
  if (header.type == "STRING")
  {
    ParseIgtString(header, body);
    return;
  }
  if (header.type == "TRACKEDFRAME")
  {
    const IgtTrackedFrame frame = ParseIgtTrackedFrame(header, body);
    const IgtImage& picture = frame.image;
    SequenceFile sequence;  // as `live` finds the frame's pose
    sequence.fileName = "TRACKEDFRAME";
    sequence.width = picture.width;
    sequence.height = picture.height;
    sequence.numberOfFrames = 1;
    sequence.frames = {frame.fields};
    PoseTable table;
    ResolvePoses(sequence, {}, table);
    training.Add({picture.width, picture.height, picture.pixels, table.frames[0].imageToReference, header.timestamp});
    return;
  }
  const IgtImage image = ParseIgtImage(header, body);
  // What was read is sent back, and is the same then.
  const std::vector<std::uint8_t> packed = PackIgtImage(header.device, header.timestamp, image);
  const IgtHeader again = ParseIgtHeader(packed.data());
  if (ParseIgtImage(again, {packed.begin() + kIgtHeaderBytes, packed.end()}).pixels != image.pixels)
  {
    Finding("an image reads back as another");
  }
  training.Add({image.width, image.height, image.pixels, image.imageToWorld, header.timestamp});
}

}  // namespace

void TryInput(const std::string& bytes)
{
  RunAsProgram(
      [&bytes](command::Console&)
      {
        LiveOptions options;
        options.training.engine = "cpu";
        LiveTraining training(options);
        std::size_t at = 0;
        // A field begins with the eighth frame.
        for (int messages = 0; messages < 10 && bytes.size() - at >= kIgtHeaderBytes; ++messages)
        {
          const auto* start = reinterpret_cast<const std::uint8_t*>(bytes.data()) + at;
          const IgtHeader header = ParseIgtHeader(start);
          at += kIgtHeaderBytes;
          const std::size_t count = std::min<std::size_t>(header.bodyBytes, bytes.size() - at);
          TryMessage(header, {start + kIgtHeaderBytes, start + kIgtHeaderBytes + count}, training);
          at += count;
        }
        if (training.Step())
        {
          training.Field().Validate();
          SlicePlane plane = training.Frames().Plane(0);
          plane.width = plane.height = 3;
          if (const std::string wrong = WrongPictures(training.Field(), plane, "cpu"); !wrong.empty())
          {
            Finding(wrong);
          }
        }
        return command::Success;
      });
}

}  // namespace bigus::fuzz
