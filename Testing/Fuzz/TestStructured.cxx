// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Thousands of sweeps, fields and checkpoints of odd numbers, the same ones in every run, go behind the parsers: they are
// refused with an Error, or trained on and rendered with finite pixels. Run it under the sanitizers too.
#include <gtest/gtest.h>

#include <random>

#include "Fuzz/Structured.h"

namespace bigus::fuzz
{
namespace
{

template <class Try>
void ExpectNothingWrong(int count, std::uint64_t seed, const Try& attempt)
{
  std::mt19937_64 random(seed);
  int accepted = 0;
  for (int k = 0; k < count; ++k)
  {
    // Kinds of numbers are told by single bytes, so the share of odd ones is set by keeping most bytes high.
    const auto odd = random() % 4;
    std::string bytes(2000 + random() % 4000, '\0');
    for (char& byte : bytes)
    {
      const auto value = random();
      byte = static_cast<char>(odd == 0 || value % 64 > odd ? 64 + value / 64 % 192 : value / 64 % 256);
    }
    const std::optional<std::string> wrong = attempt(bytes);
    accepted += wrong.has_value();
    ASSERT_EQ(wrong.value_or(""), "") << "input " << k;
  }
  // A test that everything is refused in would say nothing.
  EXPECT_GT(accepted, count / 10);
  EXPECT_LT(accepted, count);
}

TEST(Structured, SweepsAreRefusedOrTrainedOn)
{
  ExpectNothingWrong(400, 41, TrySweep);
}

TEST(Structured, FieldsAreRefusedOrRendered)
{
  ExpectNothingWrong(4000, 42, TryField);
}

TEST(Structured, ForgedCheckpointsAreRefusedOrGoOn)
{
  ExpectNothingWrong(300, 43, TryCheckpoint);
}

}  // namespace
}  // namespace bigus::fuzz
