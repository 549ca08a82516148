// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Linear transforms of ITK's files and plain matrices. Testing/Command/test_simpleitk.py reads files that ITK wrote.
#include <gtest/gtest.h>

#include <tuple>
#include <vector>

#include "Core/Model/Error.h"
#include "IO/Formats/LinearTransform.h"
#include "SmallFiles.h"
#include "Support/TestSupport.h"

namespace bigus::test
{
namespace
{

std::string Itk(const std::string& type, const std::string& parameters, const std::string& fixed = "0 0 0")
{
  return "#Insight Transform File V1.0\n#Transform 0\nTransform: " + type + "_double_3_3\nParameters: " + parameters +
         "\nFixedParameters: " + fixed + "\n";
}

Eigen::Vector3d Moved(const std::string& text, const Eigen::Vector3d& point)
{
  TemporaryFolder folder;
  WriteBytes(folder / "t.tfm", text);
  return (ReadLinearTransform(folder / "t.tfm").matrix * point.homogeneous()).head<3>();
}

void ExpectAt(const std::string& text, const Eigen::Vector3d& point, const Eigen::Vector3d& moved)
{
  EXPECT_LT((Moved(text, point) - moved).norm(), 1e-12) << text << Moved(text, point).transpose();
}

TEST(LinearTransform, EveryTypeByHand)
{
  ExpectAt(Itk("AffineTransform", "0 -1 0 1 0 0 0 0 1 10 20 30"), {1, 2, 3}, {8, 21, 33});
  ExpectAt(Itk("MatrixOffsetTransformBase", "0 -1 0 1 0 0 0 0 1 10 20 30", "1 2 3"), {1, 2, 3}, {11, 22, 33});
  ExpectAt(Itk("Rigid3DTransform", "0 -1 0 1 0 0 0 0 1 0 0 0", "1 0 0"), {2, 0, 0}, {1, 1, 0});
  ExpectAt(Itk("IdentityTransform", "", ""), {1, 2, 3}, {1, 2, 3});
  ExpectAt(Itk("TranslationTransform", "1 2 3", ""), {1, 1, 1}, {2, 3, 4});
  ExpectAt(Itk("ScaleTransform", "2 3 4", "1 1 1"), {2, 2, 2}, {3, 4, 5});
  ExpectAt(Itk("VersorTransform", "0 0 0.70710678118654752", "1 0 0"), {2, 0, 0}, {1, 1, 0});
  ExpectAt(Itk("ScaleVersor3DTransform", "0 0 0 5 6 7 2 3 4"), {1, 1, 1}, {7, 9, 11});
  ExpectAt(Itk("ComposeScaleSkewVersor3DTransform", "0 0 0 1 0 0 2 3 4 5 6 7"), {1, 10, 100}, {1303, 2130, 400});
  ExpectAt(Itk("ScaleSkewVersor3DTransform", "0 0 0 0 0 0 1 1 1 2 3 4 5 6 7"), {1, 10, 100}, {321, 514, 176});
  ExpectAt(Itk("VersorRigid3DTransform", "0 0 0.70710678118654752 5 0 0"), {1, 0, 0}, {5, 1, 0});
  ExpectAt(Itk("Similarity3DTransform", "0 0 0 0 0 0 2", "1 1 1"), {2, 1, 1}, {3, 1, 1});
  // x and y turned by a quarter: Rz Rx Ry takes (1, 0, 0) to (0, 0, -1) and on to (0, 1, 0); Rz Ry Rx leaves it at z.
  const std::string angles = "1.5707963267948966 1.5707963267948966 0 0 0 0";
  ExpectAt(Itk("Euler3DTransform", angles), {1, 0, 0}, {0, 1, 0});
  ExpectAt(Itk("Euler3DTransform", angles, "0 0 0 0"), {1, 0, 0}, {0, 1, 0});
  ExpectAt(Itk("Euler3DTransform", angles, "0 0 0 1"), {1, 0, 0}, {0, 0, -1});
}

TEST(LinearTransform, TheLastOfACompositeComesFirst)
{
  const std::string parts =
      "#Insight Transform File V1.0\nTransform: CompositeTransform_double_3_3\n"
      "Transform: TranslationTransform_double_3_3\nParameters: 1 0 0\nFixedParameters:\n"
      "Transform: AffineTransform_float_3_3\r\nParameters: 2 0 0 0 2 0 0 0 2 0 0 0\nFixedParameters: 0 0 0\n";
  ExpectAt(parts, {1, 1, 1}, {3, 2, 2});
  ExpectAt(parts + "Transform: IdentityTransform_double_3_3\nParameters: \nFixedParameters: \n", {1, 1, 1}, {3, 2, 2});
}

TEST(LinearTransform, SixteenNumbers)
{
  TemporaryFolder folder;
  WriteBytes(folder / "t.txt", "1 0 0 10\n0\t0 -1 20\r\n0 1 0 30\n0 0 0 1\n");
  const LinearTransform read = ReadLinearTransform(folder / "t.txt");
  EXPECT_FALSE(read.isItk);
  EXPECT_EQ((read.matrix * Eigen::Vector4d(1, 2, 3, 1)).eval(), Eigen::Vector4d(11, 17, 32, 1));
}

// The same composite as text, as SimpleITK wrote both.
const std::string kComposite =
    "#Insight Transform File V1.0\n#Transform 0\nTransform: CompositeTransform_double_3_3\n#Transform 1\n"
    "Transform: VersorRigid3DTransform_double_3_3\n"
    "Parameters: 0.10391372781674944 -0.17318954636124909 0.27710327417799857 3 4 -5\nFixedParameters: 1 2 3\n#Transform 2\n"
    "Transform: TranslationTransform_double_3_3\nParameters: 1 2 -3\nFixedParameters: \n";

TEST(LinearTransform, Hdf5)
{
  const LinearTransform read = ReadLinearTransform((TestDataFolder() / "transform.h5").string());
  EXPECT_TRUE(read.isItk);
  ExpectAt(kComposite, {1, 0, 0}, {6.393174710447365, 8.231874295061278, -7.127519082004464});  // by SimpleITK
  EXPECT_LT(((read.matrix * Eigen::Vector4d(1, 0, 0, 1)).head<3>() - Moved(kComposite, {1, 0, 0})).norm(), 1e-14);
  EXPECT_LT(((read.matrix * Eigen::Vector4d(0, 2, 5, 1)).head<3>() - Moved(kComposite, {0, 2, 5})).norm(), 1e-14);
}

// What is cut or damaged is refused, naming the file, or it is a transform.
TEST(LinearTransform, DamagedHdf5)
{
  TemporaryFolder folder;
  const std::string whole = ReadBytes((TestDataFolder() / "transform.h5").string());
  int refused = 0;
  const auto tryRead = [&](const std::string& bytes)
  {
    WriteBytes(folder / "t.h5", bytes);
    try
    {
      EXPECT_TRUE(ReadLinearTransform(folder / "t.h5").matrix.allFinite());
    }
    catch (const Error& error)
    {
      ++refused;
      EXPECT_NE(std::string(error.what()).find("t.h5"), std::string::npos) << error.what();
    }
  };
  for (std::size_t at = 0; at < whole.size(); at += 7)
  {
    tryRead(whole.substr(0, at));
  }
  const int cut = refused;
  EXPECT_GT(cut, 500);  // what ITK appends about itself may be missing
  for (std::size_t at = 0; at < whole.size(); ++at)
  {
    if (whole[at] != '\0' || at % 8 == 0)  // most of the file is zeros
    {
      std::string changed = whole;
      changed[at] = static_cast<char>(whole[at] ^ (at % 3 == 0 ? 0xFF : 0x01));
      tryRead(changed);
    }
  }
  EXPECT_GT(refused, cut + 100);
  for (const auto& [from, to, part] : std::vector<std::tuple<std::string, std::string, std::string>>{
           {"TransformGroup", "TransformGroap", "no TransformGroup"},
           {"VersorRigid3D", "VersorRigid4D", "VersorRigid4D"},
           {"TransformParameters", "TransformParametars", "has 0 Parameters"},
           {std::string("\x89HDF\r\n\x1a\n\x02", 9), std::string("\x89HDF\r\n\x1a\n\x00", 9), "version 0; save the"}})
  {
    std::string bad = whole;
    ASSERT_NE(bad.find(from), std::string::npos) << from;
    bad.replace(bad.find(from), from.size(), to);
    WriteBytes(folder / "bad.h5", bad);
    try
    {
      ReadLinearTransform(folder / "bad.h5");
      ADD_FAILURE() << "not refused: " << to;
    }
    catch (const Error& error)
    {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  }
}

TEST(LinearTransform, BadFiles)
{
  TemporaryFolder folder;
  const auto refused = [&](const std::string& text, const std::string& part)
  {
    WriteBytes(folder / "t.tfm", text);
    try
    {
      ReadLinearTransform(folder / "t.tfm");
      ADD_FAILURE() << "not refused: " << text;
    }
    catch (const Error& error)
    {
      EXPECT_NE(std::string(error.what()).find("t.tfm"), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  refused("", "16 numbers");
  refused("1 0 0 0 0 1 0 0 0 0 1 0 0 0 0", "16 numbers");
  refused("#Insight Transform File V1.0\n", "has 0 transforms");
  refused(Itk("AffineTransform", "1 0 0"), "has 3 Parameters");
  refused(Itk("AffineTransform", "1 0 0 0 1 0 0 0 1 0 0 0", ""), "0 FixedParameters");
  refused(Itk("AffineTransform", "1 0 0 0 1 0 0 0 1 0 0 x"), "\"x\" is not a number");
  refused(Itk("AffineTransform", "1 0 0 0 1 0 0 0 1 0 0 inf"), "\"inf\" is not a number");
  refused(Itk("VersorRigid3DTransform", "1 1 0 0 0 0"), "longer than 1");
  refused(Itk("IdentityTransform", "1", ""), "has 1 Parameters");
  refused(Itk("ScaleTransform", "2 2", "0 0 0"), "has 2 Parameters");
  refused(Itk("BSplineTransform", "1 1 0 0 0 0"), "BSplineTransform");
  refused(Itk("AffineTransform", "1") + "Transform: AffineTransform_double_2_2\n", "3-D points");
  refused(Itk("TranslationTransform", "1 2 3", "") + Itk("TranslationTransform", "1 2 3", ""), "has 2 transforms");
  refused("#Insight Transform File V1.0\nhello\n", "\"hello\"");
}

}  // namespace
}  // namespace bigus::test
