// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Digits that are dropped are not seen, and the rest compresses.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/FieldRounding.h"
#include "Core/Model/GaussianField.h"
#include "Support/Fields.h"
#include "Support/Random.h"

namespace
{

using bigus::GaussianField;
using bigus::RoundField;
using bigus::SlicePlane;
using bigus::test::Random;

std::vector<float> Picture(const GaussianField& field, const SlicePlane& plane)
{
  const auto engine = bigus::Engine::Create("reference");
  engine->SetField(field);
  std::vector<float> picture(plane.NumberOfPixels());
  engine->Render(plane, bigus::ViewOutput::Scattering, picture.data());
  return picture;
}

// As dense as trained fields are, far from the origin as tracked ones are, with needles and plates among them.
TEST(FieldRounding, PicturesStay)
{
  Random random(5);
  GaussianField field = bigus::test::RandomField(random, 4000, 6.0, 0.15, 1.5, 0.1);
  const Eigen::Vector3d away(310, -220, 170);
  for (Eigen::Vector3d& mean : field.means)
  {
    mean += away;
  }
  GaussianField rounded = field;
  RoundField(rounded);
  rounded.Validate();
  double change = 0, power = 0;
  for (int k = 0; k < 4; ++k)
  {
    const SlicePlane plane = bigus::test::RandomPlane(random, away, 0.2, 48, 40);
    const std::vector<float> before = Picture(field, plane), after = Picture(rounded, plane);
    for (std::size_t p = 0; p < before.size(); ++p)
    {
      change += (after[p] - before[p]) * (after[p] - before[p]);
      power += before[p] * before[p];
    }
  }
  ASSERT_GT(power, 0);
  // Pictures lie 20 dB below white or so: 66 dB below the picture itself is 86 dB and more below white.
  EXPECT_GT(10 * std::log10(power / change), 60);
}

TEST(FieldRounding, AgainChangesNothing)
{
  Random random(6);
  GaussianField once = bigus::test::RandomField(random, 500, 50.0, 0.01, 30.0, 0.0);
  RoundField(once);
  GaussianField twice = once;
  RoundField(twice);
  EXPECT_TRUE(bigus::test::SameField(once, twice));
}

// Then files hold them in 32 bits.
TEST(FieldRounding, NumbersOfATrackedSweepAreFloats)
{
  Random random(7);
  GaussianField field = bigus::test::RandomField(random, 2000, 300.0, 0.05, 20.0, 0.0);
  RoundField(field);
  const auto isFloat = [](double value) { return static_cast<double>(static_cast<float>(value)) == value; };
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    for (int axis = 0; axis < 3; ++axis)
    {
      EXPECT_TRUE(isFloat(field.means[i][axis]) && isFloat(field.scales[i][axis]));
    }
    for (int k = 0; k < 4; ++k)
    {
      EXPECT_TRUE(isFloat(field.rotations[i][k]));
    }
    EXPECT_TRUE(isFloat(field.reflectivities[i]));
  }
}

TEST(FieldRounding, EveryValidFieldStaysValid)
{
  GaussianField field;
  field.Resize(3);
  for (std::size_t i = 0; i < 3; ++i)
  {
    const bool isLarge = i > 0;
    field.means[i].setConstant(isLarge ? -GaussianField::kLargestCoordinate : 1e-300);
    field.scales[i].setConstant(isLarge ? GaussianField::kLargestScale : GaussianField::kSmallestScale);
    field.rotations[i].setConstant(isLarge ? 1e200 : 1e-200);
    field.reflectivities[i] = isLarge ? -GaussianField::kLargestReflectivity : 0;
  }
  field.scales[2][1] = GaussianField::kSmallestScale;
  ASSERT_NO_THROW(field.Validate());
  RoundField(field);
  EXPECT_NO_THROW(field.Validate());
  EXPECT_NEAR(field.rotations[0].norm(), 1, 1e-3);
  EXPECT_NEAR(field.rotations[1].norm(), 1, 1e-3);
  EXPECT_EQ(field.reflectivities[0], 0);
}

}  // namespace
