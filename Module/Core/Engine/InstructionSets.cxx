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
  // Highway falls back to the static target, which every processor of this kind has.
  const std::int64_t usable = (hwy::SupportedTargets() | HWY_STATIC_TARGET) & HWY_TARGETS;
  constexpr int kLastBit = 62;  // the static target's; the better one is, the lower its bit
  for (int k = 0; k <= kLastBit; ++k)
  {
    if (const std::int64_t bit = std::int64_t(1) << k; bit & usable)
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
  Require(targets != 0, "There is no instruction set '", name, "' here. Available: ", known, ".");
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
