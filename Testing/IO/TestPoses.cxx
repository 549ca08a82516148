// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Slice planes from sequences, CSV and 3D Slicer's markups.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>

#include "SmallFiles.h"
#include "Support/ErrorObserver.h"
#include "Support/TestSupport.h"
#include "vtkBigusPoseReader.h"
#include "vtkDataArray.h"
#include "vtkErrorCode.h"
#include "vtkTable.h"

namespace bigus::test
{
namespace
{

vtkDataArray* Column(vtkBigusPoseReader* reader, const char* name)
{
  return vtkDataArray::SafeDownCast(reader->GetOutput()->GetColumnByName(name));
}

void Read(vtkBigusPoseReader* reader, const std::string& fileName)
{
  ErrorObserver errors(reader);
  reader->SetFileName(fileName.c_str());
  reader->Modified();
  reader->Update();
  EXPECT_TRUE(errors.Errors().empty()) << errors.Text();
}

TEST(Poses, OfASequence)
{
  TemporaryFolder folder;
  Sequence sequence = SmallSequence();
  sequence.Set(SmallField(1, "ImageToReferenceTransformStatus"), "INVALID");
  WriteBytes(folder / "small.mha", sequence.Bytes());
  vtkNew<vtkBigusPoseReader> reader;
  Read(reader, folder / "small.mha");
  ASSERT_EQ(reader->GetOutput()->GetNumberOfRows(), 2);
  EXPECT_EQ(Column(reader, "SourceFrame")->GetComponent(1, 0), 2);
  EXPECT_EQ(Column(reader, "Timestamp")->GetComponent(1, 0), 2.25);
  EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 0), smallWidth);
  EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 1), smallHeight);
  for (int c = 0; c < 16; ++c)
  {
    EXPECT_EQ(Column(reader, "ImageToReference")->GetComponent(1, c), SmallPose(c / 4, c % 4, 2));
  }
}

TEST(Poses, OfACsv)
{
  TemporaryFolder folder;
  WriteBytes(folder / "poses.csv", SmallCsv(false));
  vtkNew<vtkBigusPoseReader> reader;
  Read(reader, folder / "poses.csv");
  ASSERT_EQ(reader->GetOutput()->GetNumberOfRows(), 3);
  EXPECT_EQ(Column(reader, "ImageToReference")->GetComponent(2, 3), 20);
  EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 0), 0);  // not stated

  std::string sized = "width,height,m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23\n640,480,1,0,0,0,0,1,0,0,0,0,1,0\n";
  WriteBytes(folder / "sized.csv", sized);
  Read(reader, folder / "sized.csv");
  EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 0), 640);
  EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 1), 480);
  EXPECT_EQ(Column(reader, "Timestamp"), nullptr);
  EXPECT_EQ(reader->GetNumberOfRejectedPoses(), 0);
  EXPECT_STREQ(reader->GetRejectionSummary(), "");
}

TEST(Poses, TellWhichWereRejected)
{
  TemporaryFolder folder;
  WriteBytes(folder / "poses.csv",
             "m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23\n"
             "1,0,0,0,0,1,0,0,0,0,1,0\n"
             "nan,0,0,0,0,1,0,0,0,0,1,0\n"
             "1,0,0,0,0,1,0,0,0,0,1,5\n");
  vtkNew<vtkBigusPoseReader> reader;
  Read(reader, folder / "poses.csv");
  ASSERT_EQ(reader->GetOutput()->GetNumberOfRows(), 2);
  EXPECT_EQ(reader->GetNumberOfRejectedPoses(), 1);
  EXPECT_NE(std::string(reader->GetRejectionSummary()).find("(frame 1)"), std::string::npos)
      << reader->GetRejectionSummary();
}

// The plane's centre (1, 2, 3) LPS, columns along x, rows along z.
TEST(Poses, OfAMarkupPlaneInEitherCoordinateSystem)
{
  TemporaryFolder folder;
  WriteBytes(folder / "plane.mrk.json", SmallMarkup());
  vtkNew<vtkBigusPoseReader> reader;
  reader->SetPixelSpacing(0.25);
  for (const bool lps : {true, false})
  {
    lps ? reader->SetWorldCoordinateSystemToLPS() : reader->SetWorldCoordinateSystemToRAS();
    Read(reader, folder / "plane.mrk.json");
    ASSERT_EQ(reader->GetOutput()->GetNumberOfRows(), 1);
    EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 0), 32);
    EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 1), 16);
    const double* m = Column(reader, "ImageToReference")->GetTuple(0);
    const double sign = lps ? 1 : -1;
    const double centre[3] = {sign * 1, sign * 2, 3};
    const double column[3] = {sign * 0.25, 0, 0};
    const double row[3] = {0, 0, 0.25};
    for (int r = 0; r < 3; ++r)
    {
      EXPECT_NEAR(m[4 * r], column[r], 1e-15);
      EXPECT_NEAR(m[4 * r + 1], row[r], 1e-15);
      EXPECT_NEAR(m[4 * r] * 15.5 + m[4 * r + 1] * 7.5 + m[4 * r + 3], centre[r], 1e-12);
    }
  }
  std::string ras = SmallMarkup();
  ras.replace(ras.find("LPS"), 3, "RAS");
  WriteBytes(folder / "ras.mrk.json", ras);
  Read(reader, folder / "ras.mrk.json");
  EXPECT_NEAR(Column(reader, "ImageToReference")->GetComponent(0, 0), 0.25, 1e-15);
}

// As Slicer saves a plane one edge of which was dragged: its centre is where it was placed. In metres nothing moves.
TEST(Poses, OfAMarkupPlaneWhoseEdgesWereDragged)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusPoseReader> reader;
  reader->SetPixelSpacing(0.5);
  reader->SetWorldCoordinateSystemToLPS();
  const std::vector<std::array<std::string, 4>> cases = {
      {"\"mm\"", "[1.0, 2.0, 3.0]", "[8.0, 4.0, 0.0]", "[-2, 6, -3, 1]"},
      {"[\"mm\", \"UCUM\", \"millimeter\"]", "[1.0, 2.0, 3.0]", "[7, 7, 0]", "[-2, 6, -3, 1]"},
      {"[\"m\", \"UCUM\", \"meter\"]", "[0.001, 0.002, 0.003]", "[0.008, 0.004, 0]", "[-0.002, 0.006, -0.003, 0.001]"},
      {"\"um\"", "[3000, 2000, 2000]", "[8000, 4000, 0]", "[0, 0, 0, 0]"}};
  for (const auto& [units, centre, size, bounds] : cases)
  {
    SCOPED_TRACE(units);
    WriteBytes(folder / "plane.mrk.json", R"({"markups": [{"type": "Plane", "coordinateUnits": )" + units +
                                              R"(, "center": )" + centre +
                                              R"(, "orientation": [1, 0, 0, 0, 0, -1, 0, 1, 0], "size": )" + size +
                                              R"(, "planeBounds": )" + bounds + "}]}");
    Read(reader, folder / "plane.mrk.json");
    ASSERT_EQ(reader->GetOutput()->GetNumberOfRows(), 1);
    EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 0), 16);
    EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 1), 8);
    const double* m = Column(reader, "ImageToReference")->GetTuple(0);
    const double middle[3] = {3, 2, 2};  // columns along x, rows along z
    for (int r = 0; r < 3; ++r)
    {
      EXPECT_NEAR(m[4 * r] * 7.5 + m[4 * r + 1] * 3.5 + m[4 * r + 3], middle[r], 1e-12);
    }
  }
}

void ExpectRefused(vtkBigusPoseReader* reader, const std::string& fileName, const std::string& part)
{
  ErrorObserver errors(reader);
  reader->SetFileName(fileName.c_str());
  reader->Modified();
  reader->Update();
  ASSERT_EQ(errors.Errors().size(), 1u) << errors.Text();
  EXPECT_NE(errors.Text().find(part), std::string::npos) << errors.Text();
  EXPECT_EQ(reader->GetOutput()->GetNumberOfRows(), 0);
  EXPECT_NE(reader->GetErrorCode(), static_cast<unsigned long>(vtkErrorCode::NoError));
}

std::string Line(const std::string& points)
{
  return R"({"markups": [{"type": "Line", "coordinateSystem": "LPS", "controlPoints": [)" + points + "]}]}";
}

TEST(Poses, OfAMarkupLine)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusPoseReader> reader;
  reader->SetPixelSpacing(0.5);
  // Across the body: down is to the feet. Along it: down is to the back, which is +y in LPS and -y in RAS.
  for (const bool lps : {true, false})
  {
    lps ? reader->SetWorldCoordinateSystemToLPS() : reader->SetWorldCoordinateSystemToRAS();
    const double sign = lps ? 1 : -1;
    const auto check = [&](const std::string& points, const Eigen::Vector3d& column, const Eigen::Vector3d& row,
                           const Eigen::Vector3d& middle)
    {
      WriteBytes(folder / "line.mrk.json", Line(points));
      Read(reader, folder / "line.mrk.json");
      ASSERT_EQ(reader->GetOutput()->GetNumberOfRows(), 1);
      EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 0), 20);
      EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 1), 20);
      const double* m = Column(reader, "ImageToReference")->GetTuple(0);
      for (int r = 0; r < 3; ++r)
      {
        EXPECT_NEAR(m[4 * r], 0.5 * column[r], 1e-12);
        EXPECT_NEAR(m[4 * r + 1], 0.5 * row[r], 1e-12);
        EXPECT_NEAR(9.5 * (m[4 * r] + m[4 * r + 1]) + m[4 * r + 3], middle[r], 1e-12);
      }
    };
    check(R"({"position": [1, 2, 3]}, {"position": [7, 2, 11]})", {0.6 * sign, 0, 0.8}, {0.8 * sign, 0, -0.6},
          {4 * sign, 2 * sign, 7});
    check(R"({"position": [0, 0, 0]}, {"position": [0, 0, 10]})", {0, 0, 1}, {0, sign, 0}, {0, 0, 5});
  }
  const std::vector<std::pair<std::string, std::string>> bad = {
      {R"({"position": [1, 2, 3]})", "two controlPoints, this one 1"},
      {R"({"position": [1, 2, 3]}, {"position": [1, 2, 3]})", "size 0 x 0"},
      {R"({"position": [1, 2, 3]}, {"position": [1, 2]})", "controlPoints[1] has no position"},
      {R"({"position": [1, 2, 3]}, {"position": [1, 2, "x"]})", "not a number"},
      {R"({"position": [1, 2, 3]}, 7)", "controlPoints[1] has no position"}};
  for (const auto& [points, part] : bad)
  {
    SCOPED_TRACE(points);
    WriteBytes(folder / "bad.mrk.json", Line(points));
    ExpectRefused(reader, folder / "bad.mrk.json", part);
  }
}

TEST(Poses, OfALinearTransform)
{
  TemporaryFolder folder;
  // What is under it moves by the inverse: (1, 2, 3) from the origin, in LPS.
  WriteBytes(folder / "t.tfm",
             "#Insight Transform File V1.0\nTransform: AffineTransform_double_3_3\n"
             "Parameters: 0 -1 0 1 0 0 0 0 1 2 -1 -3\nFixedParameters: 0 0 0\n");
  vtkNew<vtkBigusPoseReader> reader;
  for (const bool lps : {true, false})
  {
    lps ? reader->SetWorldCoordinateSystemToLPS() : reader->SetWorldCoordinateSystemToRAS();
    Read(reader, folder / "t.tfm");
    ASSERT_EQ(reader->GetOutput()->GetNumberOfRows(), 1);
    EXPECT_EQ(Column(reader, "Size")->GetComponent(0, 0), 0);
    const double sign = lps ? 1 : -1;
    const double expected[16] = {0, 1, 0, sign, -1, 0, 0, 2 * sign, 0, 0, 1, 3, 0, 0, 0, 1};
    for (int k = 0; k < 16; ++k)
    {
      EXPECT_NEAR(Column(reader, "ImageToReference")->GetComponent(0, k), expected[k], 1e-12) << k;
    }
  }
  WriteBytes(folder / "flat.tfm",
             "#Insight Transform File V1.0\nTransform: AffineTransform_double_3_3\n"
             "Parameters: 0 0 0 0 1 0 0 0 1 0 0 0\nFixedParameters: 0 0 0\n");
  ExpectRefused(reader, folder / "flat.tfm", "no inverse");
}

TEST(Poses, RefusesBadMarkups)
{
  TemporaryFolder folder;
  const std::vector<std::tuple<std::string, std::string, std::string>> cases = {
      {"\"markups\"", "\"makeups\"", "markups"},
      {"\"Plane\"", "\"Angle\"", "type Plane or Line"},
      {"\"Plane\"", "\"Line\"", "two controlPoints"},
      {"LPS", "XYZ", "XYZ"},
      {"\"mm\"", "\"inch\"", "inch"},
      {"\"mm\"", "[\"[in_i]\", \"UCUM\", \"inch\"]", "in_i"},
      {"\"mm\"", "7", "7"},
      {"\"size\"", "\"planeBounds\": [1, 2, 3], \"size\"", "planeBounds"},
      {"\"center\"", "\"centre\"", "center"},
      {"[1.0, 2.0, 3.0]", "[1.0, 2.0]", "center"},
      {"[1.0, 2.0, 3.0]", "[1.0, \"2\", 3.0]", "not a number"},
      {"[1, 0, 0, 0, 0, -1, 0, 1, 0]", "[0, 0, 0, 0, 0, 0, 0, 0, 0]", "plane"},
      {"[1, 0, 0, 0, 0, -1, 0, 1, 0]", "[1, 1, 0, 0, 0, -1, 0, 0, 0]", "plane"},
      {"[8.0, 4.0, 0.0]", "[0.0, 4.0, 0.0]", "size"},
      {"[8.0, 4.0, 0.0]", "[8.0, -4.0, 0.0]", "size"},
      {"[8.0, 4.0, 0.0]", "[1e300, 4.0, 0.0]", "size"},
      {"]}]}", "]}]", "JSON"},
      {"]}]}", "]}]} trailing", "JSON"},
  };
  vtkNew<vtkBigusPoseReader> reader;
  for (const auto& [from, to, part] : cases)
  {
    SCOPED_TRACE(from + " -> " + to);
    std::string bad = SmallMarkup();
    bad.replace(bad.rfind(from), from.size(), to);
    WriteBytes(folder / "bad.mrk.json", bad);
    ExpectRefused(reader, folder / "bad.mrk.json", part);
  }
  WriteBytes(folder / "deep.mrk.json", "{\"markups\": " + std::string(1000000, '['));
  ExpectRefused(reader, folder / "deep.mrk.json", "JSON");
  WriteBytes(folder / "good.mrk.json", SmallMarkup());
  for (const double spacing : {0.0, -1.0, std::nan(""), HUGE_VAL})
  {
    reader->SetPixelSpacing(spacing);
    ExpectRefused(reader, folder / "good.mrk.json", "PixelSpacing");
  }
}

TEST(Poses, RefusesWhatSequencesRefuse)
{
  TemporaryFolder folder;
  vtkNew<vtkBigusPoseReader> reader;
  ExpectRefused(reader, folder / "missing.mha", "no such file");
  ExpectRefused(reader, "", "FileName");
  WriteBytes(folder / "empty.mha", "");
  ExpectRefused(reader, folder / "empty.mha", "empty");
  WriteBytes(folder / "bad.csv", "m00,m01\n1,2\n");
  ExpectRefused(reader, folder / "bad.csv", "m02");
  WriteBytes(folder / "small.mha", SmallSequence().Bytes());
  reader->SetToFrame("Nowhere");
  ExpectRefused(reader, folder / "small.mha", "Image to Nowhere");
}

}  // namespace
}  // namespace bigus::test
