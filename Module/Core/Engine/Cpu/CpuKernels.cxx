// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/Cpu/CpuKernels.h"

#include "Core/Engine/Cpu/Targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Core/Engine/Cpu/CpuKernels.cxx"
// foreach_target.h comes first: it compiles the rest once for every instruction set.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

#include "Core/Engine/Cpu/BlockBounds-inl.h"
#include "Core/Engine/Cpu/ChainRule-inl.h"
#include "Core/Engine/Cpu/Footprints-inl.h"
#include "Core/Engine/Cpu/Pixels-inl.h"
#include "Core/Engine/Cpu/Project-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bigus::HWY_NAMESPACE
{

template <class T>
static Kernels<T> Table()
{
  return {CountInSlab<T>, ProjectBlock<T>, AddFootprints<T>, GatherMoments<T>, AddAdjoints<T>,
          UpdateBlock<T>, BoundsOf<T>,     ToIntensity<T>,   ToDerivative<T>};
}
Kernels<float> FloatTable()
{
  return Table<float>();
}
Kernels<double> DoubleTable()
{
  return Table<double>();
}

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bigus
{

HWY_EXPORT(FloatTable);
HWY_EXPORT(DoubleTable);

template <>
Kernels<float> KernelsOfThisMachine()
{
  return HWY_DYNAMIC_DISPATCH(FloatTable)();
}
template <>
Kernels<double> KernelsOfThisMachine()
{
  return HWY_DYNAMIC_DISPATCH(DoubleTable)();
}

}  // namespace bigus
#endif  // HWY_ONCE
