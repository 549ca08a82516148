// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Messages from which the fuzzing of OpenIGTLink starts.
#include "Fuzz/Seeds.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "Live/OpenIgtLink.h"
#include "Live/Testing/TrackedFrame.h"

namespace bigus::fuzz
{
namespace
{

void Messages()
{
  IgtImage image;
  image.width = 4;
  image.height = 3;
  image.pixels.assign(12, 100);
  const std::vector<std::uint8_t> picture = PackIgtImage("Image", 1.5, image);
  const std::vector<std::uint8_t> pose = PackIgtTransform("ImageToReference", 1.5, Eigen::Matrix4d::Identity());
  std::string both(pose.begin(), pose.end());
  both.append(picture.begin(), picture.end());
  // Without a checksum what is changed is still read.
  constexpr std::size_t kChecksumAt = 50;
  std::string unchecked(picture.begin(), picture.end());
  std::fill_n(unchecked.begin() + kChecksumAt, 8, '\0');
  std::string extended = unchecked;
  extended[1] = 2;
  Seed("OpenIgtLink", "both", both);
  Seed("OpenIgtLink", "unchecked", unchecked + unchecked);
  Seed("OpenIgtLink", "extended", extended);
  const std::string identity = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1";
  const std::map<std::string, std::string> fields = {
      {"ImageToReferenceTransform", identity}, {"ImageToReferenceTransformStatus", "OK"}, {"Operator", "A &lt;B&gt;"}};
  const std::string old = test::TrackedFrameMessage(fields, false), now = test::TrackedFrameMessage(fields, true);
  std::string field;  // nine pictures, from which a field begins
  for (int k = 0; k < 9; ++k)
  {
    image.imageToWorld(2, 3) = 0.5 * k;
    const std::vector<std::uint8_t> next = PackIgtImage("Image", 1 + k, image);
    field.append(next.begin(), next.end());
    std::fill_n(field.end() - static_cast<std::ptrdiff_t>(next.size()) + kChecksumAt, 8, '\0');
  }
  Seed("OpenIgtLink", "field", field);
  Seed("OpenIgtLink", "tracked-old", old);
  Seed("OpenIgtLink", "tracked", now + now + both);
  Seed("OpenIgtLink", "tracked-chain",
       test::TrackedFrameMessage({{"ImageToProbeTransform", identity},
                                  {"ImageToProbeTransformStatus", "OK"},
                                  {"ReferenceToProbeTransform", identity},
                                  {"ReferenceToProbeTransformStatus", "INVALID"}},
                                 true));
}

[[maybe_unused]] const std::size_t row = AddSeeds(Messages);

}  // namespace
}  // namespace bigus::fuzz
