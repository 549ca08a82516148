// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Linear transforms of ITK's files and plain matrices. Testing/Command/test_simpleitk.py reads files that ITK wrote.
#include <gtest/gtest.h>

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
  ExpectAt(Itk("TranslationTransform", "1 2 3", ""), {1, 1, 1}, {2, 3, 4});
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
}

TEST(LinearTransform, SixteenNumbers)
{
  TemporaryFolder folder;
  WriteBytes(folder / "t.txt", "1 0 0 10\n0\t0 -1 20\r\n0 1 0 30\n0 0 0 1\n");
  const LinearTransform read = ReadLinearTransform(folder / "t.txt");
  EXPECT_FALSE(read.isItk);
  EXPECT_EQ((read.matrix * Eigen::Vector4d(1, 2, 3, 1)).eval(), Eigen::Vector4d(11, 17, 32, 1));
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
  refused(Itk("BSplineTransform", "1 1 0 0 0 0"), "BSplineTransform");
  refused(Itk("AffineTransform", "1") + "Transform: AffineTransform_double_2_2\n", "3-D points");
  refused(Itk("TranslationTransform", "1 2 3", "") + Itk("TranslationTransform", "1 2 3", ""), "has 2 transforms");
  refused("#Insight Transform File V1.0\nhello\n", "\"hello\"");
}

}  // namespace
}  // namespace bigus::test
