// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Grids of volumes. Testing/Command/test_simpleitk.py reads files that ITK wrote.
#include <gtest/gtest.h>

#include "Core/Model/Error.h"
#include "IO/Formats/Markups.h"
#include "IO/Formats/VolumeGrid.h"
#include "SmallFiles.h"
#include "Support/TestSupport.h"

namespace bigus::test
{
namespace
{

const std::string kNrrd =
    "NRRD0005\n# a comment\ntype: double\ndimension: 4\nsizes: 3 5 6 7\nspace: left-posterior-superior\nkinds: vector domain "
    "domain domain\nspace directions: none (0, 2, 0) (-3,0,0) (0,0,4)\nspace origin: (10,20,30)\n\npixels";
const std::string kMeta =
    "ObjectType = Image\nNDims = 3\nDimSize = 5 6 7\nElementSpacing = 2 3 4\nTransformMatrix = 0 1 0 -1 0 0 0 0 1\n"
    "Offset = 10 20 30\nElementType = MET_INT\nElementDataFile = LOCAL\npixels";

VolumeGrid Read(const std::string& name, const std::string& bytes, bool worldIsLps = true)
{
  TemporaryFolder folder;
  WriteBytes(folder / name, bytes);
  return ReadVolumeGrid(folder / name, worldIsLps);
}

TEST(VolumeGrid, OfEitherFormat)
{
  for (const VolumeGrid& grid : {Read("v.nrrd", kNrrd), Read("v.mha", kMeta)})
  {
    EXPECT_EQ(grid.size, (std::array<int, 3>{5, 6, 7}));
    EXPECT_EQ(grid.origin, Eigen::Vector3d(10, 20, 30));
    EXPECT_EQ((grid.steps * Eigen::Vector3d(1, 10, 100)).eval(), Eigen::Vector3d(-30, 2, 400));
  }
}

TEST(VolumeGrid, InEitherPatientSystem)
{
  const auto corner = [](const VolumeGrid& grid)
  { return (grid.origin + grid.steps * Eigen::Vector3d(1, 1, 1)).eval(); };
  const Eigen::Vector3d lps(7, 22, 34), ras(-7, -22, 34);
  EXPECT_EQ(corner(Read("v.mha", kMeta, true)), lps);
  EXPECT_EQ(corner(Read("v.mha", kMeta, false)), ras);
  EXPECT_EQ(corner(Read("v.nrrd", kNrrd, false)), ras);
  for (const auto& [space, inLps] : {std::pair("RAS", Eigen::Vector3d(-7, -22, 34)),
                                     std::pair("right-anterior-superior", Eigen::Vector3d(-7, -22, 34)),
                                     std::pair("left-anterior-superior", Eigen::Vector3d(7, -22, 34))})
  {
    std::string text = kNrrd;
    text.replace(text.find("left-posterior-superior"), 23, space);
    EXPECT_EQ(corner(Read("v.nrrd", text, true)), inLps) << space;
  }
}

TEST(VolumeGrid, BadFiles)
{
  const auto refused =
      [](const std::string& good, const std::string& from, const std::string& to, const std::string& part)
  {
    std::string bad = good;
    bad.replace(bad.find(from), from.size(), to);
    try
    {
      Read("bad.volume", bad);
      ADD_FAILURE() << "not refused: " << to;
    }
    catch (const Error& error)
    {
      EXPECT_NE(std::string(error.what()).find("bad.volume"), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  refused(kNrrd, kNrrd, "", "not a volume");
  refused(kNrrd, "NRRD0005", "PK\x03\x04", "not a volume");
  refused(kNrrd, "space: left-posterior-superior\n", "", "space is missing");
  refused(kNrrd, "left-posterior-superior", "scanner-xyz", "\"scanner-xyz\"");
  refused(kNrrd, "space directions", "directions", "space directions is missing");
  refused(kNrrd, "none ", "", "one vector an axis");
  refused(kNrrd, "none ", "(1,0,0) ", "three axes");
  refused(kNrrd, "(-3,0,0)", "none", "three axes");
  refused(kNrrd, "(-3,0,0)", "(-3,0)", "3 numbers");
  refused(kNrrd, "(-3,0,0)", "(-3,0,nan)", "3 numbers");
  refused(kNrrd, "(-3,0,0)", "(0,3,0)", "do not span space");
  refused(kNrrd, "(-3,0,0)", "(0,0,0)", "do not span space");
  refused(kNrrd, "space origin", "origin", "space origin is missing");
  refused(kNrrd, "3 5 6 7", "3 5 0 7", "sizes");
  refused(kNrrd, "3 5 6 7", "3 5 99999999999 7", "sizes");
  refused(kNrrd, "3 5 6 7", "3 5 x 7", "sizes");
  refused(kNrrd, "type: double", "type double", "header line");
  refused(kMeta, "NDims = 3", "NDims = 2", "ndims");
  refused(kMeta, "DimSize = 5 6 7\n", "", "dimsize is missing");
  refused(kMeta, "DimSize = 5 6 7\n",
          "DimSize = 5 6 7\nSeq_Frame0000_ProbeToTrackerTransform = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n",
          "give a volume");
  refused(kMeta, "DimSize = 5 6 7", "DimSize = 5 6", "dimsize");
  refused(kMeta, "DimSize = 5 6 7", "DimSize = 5 6 7.5", "dimsize");
  refused(kMeta, "ElementSpacing = 2 3 4", "ElementSpacing = 2 3 0", "do not span space");
  refused(kMeta, "TransformMatrix = 0 1 0", "TransformMatrix = 0 0 1", "do not span space");
  refused(kMeta, "Offset = 10 20 30", "Offset = 10 20 inf", "offset");
}

// What is damaged is refused, or it is a grid.
TEST(VolumeGrid, EveryCutAndEveryByteChanged)
{
  const auto tryRead = [](const std::string& bytes)
  {
    try
    {
      const VolumeGrid grid = Read("v.volume", bytes);
      EXPECT_TRUE(grid.steps.allFinite() && grid.origin.allFinite());
      EXPECT_GE(*std::min_element(grid.size.begin(), grid.size.end()), 1);
    }
    catch (const Error&)
    {
    }
  };
  for (const std::string& whole : {kNrrd, kMeta})
  {
    for (std::size_t at = 0; at < whole.size(); ++at)
    {
      tryRead(whole.substr(0, at));
      for (const char byte : {'\0', '\n', '(', ')', ' ', ':', '-', '9', '\xff'})
      {
        std::string changed = whole;
        changed[at] = byte;
        tryRead(changed);
      }
    }
  }
}

TEST(MarkupBox, InEitherPatientSystem)
{
  TemporaryFolder folder;
  const std::string text =
      R"({"markups": [{"type": "Line"}, {"type": "ROI", "coordinateSystem": "LPS", "center": [1, 2, 3],
      "orientation": [0, -1, 0, 1, 0, 0, 0, 0, 1], "size": [4, 5, 6]}]})";
  WriteBytes(folder / "box.mrk.json", text);
  const MarkupBox lps = ReadMarkupBox(folder / "box.mrk.json", true),
                  ras = ReadMarkupBox(folder / "box.mrk.json", false);
  EXPECT_EQ(lps.centre, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(ras.centre, Eigen::Vector3d(-1, -2, 3));
  EXPECT_EQ(lps.size, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ((lps.axes * Eigen::Vector3d(1, 10, 100)).eval(), Eigen::Vector3d(-10, 1, 100));
  EXPECT_EQ((ras.axes * Eigen::Vector3d(1, 10, 100)).eval(), Eigen::Vector3d(10, -1, 100));

  for (const auto& [from, to, part] :
       std::vector<std::tuple<std::string, std::string, std::string>>{{"ROI", "Plane", "has 0 markups of type ROI"},
                                                                      {"Line", "ROI", "markup 0 has no center"},
                                                                      {"[1, 2, 3]", "[1, 2]", "center"},
                                                                      {"[4, 5, 6]", "[4, 5, 0]", "three lengths"},
                                                                      {"[4, 5, 6]", "[4, 5]", "size of 3 numbers"},
                                                                      {"[0, -1, 0,", "[0, -1, 1,", "right angles"},
                                                                      {"LPS", "IJK", "\"IJK\""}})
  {
    std::string bad = text;
    bad.replace(bad.find(from), from.size(), to);
    WriteBytes(folder / "bad.mrk.json", bad);
    try
    {
      ReadMarkupBox(folder / "bad.mrk.json", true);
      ADD_FAILURE() << "not refused: " << to;
    }
    catch (const Error& error)
    {
      EXPECT_NE(std::string(error.what()).find("bad.mrk.json"), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace bigus::test
