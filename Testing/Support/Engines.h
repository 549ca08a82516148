// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Tests that every engine must pass: which engines there are, and what may be asked of each.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"

namespace bigus::test
{

/// Every engine but the reference: one more registered engine is one more column of tests. "cuda" is among them also
/// where it cannot be used: its tests are then skipped, and say why.
inline std::vector<std::string> FastEngines()
{
  std::vector<std::string> names = Engine::Names();
  for (const auto& missing : Engine::Missing())
  {
    names.push_back(missing.first);
  }
  names.erase(std::remove(names.begin(), names.end(), "reference"), names.end());
  std::sort(names.begin(), names.end());
  return names;
}

/// For INSTANTIATE_TEST_SUITE_P: "cpu-double" becomes "cpu_double".
inline std::string EngineTestName(const ::testing::TestParamInfo<std::string>& test)
{
  std::string name = test.param;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return !std::isalnum(c); }, '_');
  return name;
}

/// Whether an engine computes in double: by convention its name says so.
inline bool IsDouble(const std::string& engine)
{
  return engine.find("double") != std::string::npos;
}

/// Half the distance from 1 to the next number an engine computes with.
inline double UnitRoundoff(const std::string& engine)
{
  return std::ldexp(1.0, IsDouble(engine) ? -53 : -24);
}

/// Whether an engine runs where tests must be small: on an emulated device.
inline bool IsEmulated(const std::string& engine)
{
  return engine.find("emulated") != std::string::npos;
}

/// A test of one engine.
class EngineTest : public ::testing::TestWithParam<std::string>
{
protected:
  void SetUp() override
  {
    if (!engine_)
    {
      for (const auto& [name, reason] : Engine::Missing())
      {
        if (name == GetParam())
        {
          GTEST_SKIP() << "the engine '" << name << "' cannot be used here: " << reason;
        }
      }
      FAIL() << GetParam();
    }
  }

  static std::unique_ptr<Engine> CreateIfThere()
  {
    const std::vector<std::string> names = Engine::Names();
    return std::count(names.begin(), names.end(), GetParam()) > 0 ? Engine::Create(GetParam()) : nullptr;
  }

  const std::unique_ptr<Engine> engine_ = CreateIfThere();
};

}  // namespace bigus::test
