// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/InstructionSets.h"

#include "Core/Engine/Cpu/Targets.h"
// Targets.h comes first.
#include <hwy/highway.h>

#include <cstdint>
#include <cstdlib>

#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

/// Highway calls AVX-512 AVX3.
std::string NameOf(std::int64_t target)
{
  const std::string theirs = "AVX3", name = hwy::TargetName(target);
  return name.compare(0, theirs.size(), theirs) == 0 ? "AVX-512" + name.substr(theirs.size()) : name;
}

}  // namespace

std::vector<std::string> InstructionSets()
{
  std::vector<std::string> names;
  for (std::int64_t bit = 1; bit < std::int64_t(1) << 62; bit <<= 1)  // the better, the lower its bit
  {
    if (bit & hwy::SupportedTargets() & HWY_TARGETS)
    {
      names.push_back(NameOf(bit));
    }
  }
  return names;
}

void UseInstructionSet(const std::string& name)
{
  std::string known;
  for (const std::string& set : InstructionSets())
  {
    known += (known.empty() ? "" : ", ") + set;
  }
  std::int64_t targets = hwy::SupportedTargets();
  for (std::int64_t bit = 1; targets != 0 && !((bit & targets & HWY_TARGETS) && NameOf(bit) == name); bit <<= 1)
  {
    targets &= ~bit;
  }
  if (targets == 0)
  {
    throw Error("There is no instruction set '" + name + "' here. Available: " + known + ".");
  }
  hwy::SetSupportedTargetsForTest(targets);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

void UseInstructionSetOfEnvironment()
{
  static const bool done = []
  {
    if (const char* name = std::getenv("BIGUS_SIMD"); name && *name)
    {
      try
      {
        UseInstructionSet(name);
      }
      catch (const Error& error)
      {
        throw Error(std::string("The environment variable BIGUS_SIMD: ") + error.what());
      }
    }
    return true;
  }();
  (void)done;
}

}  // namespace bigus
