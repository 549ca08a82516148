// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/PlaneFile.h"

#include <cmath>
#include <limits>

#include "IO/FileError.h"
#include "IO/Formats/LinearTransform.h"
#include "IO/Formats/Markups.h"
#include "IO/SequenceFile.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr double kNoTime = std::numeric_limits<double>::quiet_NaN();

void PlanesOfSequence(const std::string& fileName, const PoseOptions& options, PlaneFile& found)
{
  ImageOptions images;
  images.wanted = false;
  const SequenceFile file = ReadSequenceFile(fileName, images);
  PoseTable table;
  ResolvePoses(file, options, table);
  found.rejections = table.RejectionSummary();
  found.rejected = static_cast<int>(table.frames.size()) - table.NumberOfAcceptedFrames();
  for (std::size_t i = 0; i < table.frames.size(); ++i)
  {
    if (table.frames[i].accepted)
    {
      const int width = file.sizes.empty() ? file.width : file.sizes[i][0];
      const int height = file.sizes.empty() ? file.height : file.sizes[i][1];
      found.planes.push_back(
          {table.frames[i].imageToReference, width, height, static_cast<int>(i), table.timestamps[i]});
    }
  }
  RequireFormat(!found.planes.empty(), fileName, ": no pose is left: ", found.rejections);
}

void PlanesOfMarkups(const std::string& fileName, double spacing, bool worldIsLps, PlaneFile& found)
{
  Require(FileFault::User, spacing > 0 && std::isfinite(spacing), "PixelSpacing is ", ExactNumber(spacing),
          " mm; it must be positive");
  for (const MarkupPlane& plane : ReadMarkupPlanes(fileName, spacing, worldIsLps))
  {
    found.planes.push_back(
        {plane.imageToReference, plane.width, plane.height, static_cast<int>(found.planes.size()), kNoTime});
  }
}

}  // namespace

void ReadPlanes(const std::string& fileName, const PoseOptions& options, double spacing, bool worldIsLps,
                PlaneFile& file)
{
  file = PlaneFile();
  const std::string beginning = FileBeginning(fileName, 4096);
  if (!Trimmed(beginning).empty() && Trimmed(beginning).front() == '{')
  {
    PlanesOfMarkups(fileName, spacing, worldIsLps, file);
  }
  else if (LooksLikeTransform(beginning))
  {
    file.planes = {{ReadObjectMatrix(fileName, worldIsLps), 0, 0, 0, kNoTime}};  // the transform's matrix is the pose
  }
  else
  {
    PlanesOfSequence(fileName, options, file);
  }
}

}  // namespace bigus
