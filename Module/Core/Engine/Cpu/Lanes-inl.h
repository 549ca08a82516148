// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A SIMD vector as a number, the formulas compiled for it, and Gaussians of a block in its lanes. Compiled once for
// every instruction set, hence the guard that foreach_target.h turns over.
#if defined(BIGUS_CPU_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BIGUS_CPU_LANES_INL_H
#undef BIGUS_CPU_LANES_INL_H
#else
#define BIGUS_CPU_LANES_INL_H
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <cstdint>

#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/Cpu/Exp-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bigus::HWY_NAMESPACE
{

namespace hn = hwy::HWY_NAMESPACE;

template <class T>
struct Lanes
{
  using D = hn::ScalableTag<T>;
  using V = hn::Vec<D>;
  V v;
  Lanes() = default;
  HWY_INLINE Lanes(V vector) : v(vector) {}
  HWY_INLINE Lanes(T scalar) : v(hn::Set(D(), scalar)) {}
  static int Count() { return static_cast<int>(hn::Lanes(D())); }
  static HWY_INLINE Lanes Load(const T* p) { return hn::LoadU(D(), p); }
  HWY_INLINE void Store(T* p) const { hn::StoreU(v, D(), p); }

  friend HWY_INLINE Lanes operator+(Lanes a, Lanes b) { return hn::Add(a.v, b.v); }
  friend HWY_INLINE Lanes operator-(Lanes a, Lanes b) { return hn::Sub(a.v, b.v); }
  friend HWY_INLINE Lanes operator*(Lanes a, Lanes b) { return hn::Mul(a.v, b.v); }
  friend HWY_INLINE Lanes operator/(Lanes a, Lanes b) { return hn::Div(a.v, b.v); }
  friend HWY_INLINE Lanes operator-(Lanes a) { return hn::Neg(a.v); }
  friend HWY_INLINE Lanes& operator+=(Lanes& a, Lanes b) { return a = a + b; }
  friend HWY_INLINE auto operator<(Lanes a, Lanes b) { return hn::Lt(a.v, b.v); }
  friend HWY_INLINE auto operator>(Lanes a, Lanes b) { return hn::Gt(a.v, b.v); }
  friend HWY_INLINE auto operator<=(Lanes a, Lanes b) { return hn::Le(a.v, b.v); }
  friend HWY_INLINE auto operator>=(Lanes a, Lanes b) { return hn::Ge(a.v, b.v); }
  friend HWY_INLINE auto operator==(Lanes a, Lanes b) { return hn::Eq(a.v, b.v); }
  friend HWY_INLINE Lanes sqrt(Lanes a) { return hn::Sqrt(a.v); }
  friend HWY_INLINE Lanes exp(Lanes a) { return QuickExp(D(), a.v); }
  friend HWY_INLINE Lanes log(Lanes a) { return QuickLog(D(), a.v); }
  friend HWY_INLINE Lanes InverseRoot(Lanes a) { return QuickInverseRoot(D(), a.v); }
  friend HWY_INLINE Lanes abs(Lanes a) { return hn::Abs(a.v); }
  friend HWY_INLINE Lanes floor(Lanes a) { return hn::Floor(a.v); }
  friend HWY_INLINE Lanes ceil(Lanes a) { return hn::Ceil(a.v); }
  friend HWY_INLINE Lanes min(Lanes a, Lanes b) { return hn::Min(a.v, b.v); }
  friend HWY_INLINE Lanes max(Lanes a, Lanes b) { return hn::Max(a.v, b.v); }
};

template <class M, class T>
HWY_INLINE Lanes<T> Select(M condition, Lanes<T> a, Lanes<T> b)
{
  return hn::IfThenElse(condition, a.v, b.v);
}

/// Which lanes a mask chooses, in their order, by the bits of the mask: four bits for each index.
template <int N>
struct ChosenIndices
{
  std::uint32_t packed[1 << N];
  constexpr ChosenIndices() : packed()
  {
    for (int bits = 0; bits < 1 << N; ++bits)
    {
      for (int lane = 0, found = 0; lane < N; ++lane)
      {
        if (bits >> lane & 1)
        {
          packed[bits] |= static_cast<std::uint32_t>(lane) << 4 * found++;
        }
      }
    }
  }
};
template <int N>
constexpr ChosenIndices<N> kChosenIndices{};

/// Moves the chosen lanes of vectors together, in their order. The permutation is found once for any number of vectors.
/// Highway's CompressStore finds it for each. With AVX2, GCC 12 copies Highway's whole table of permutations to the
/// stack to do so. With AVX-512, Zen 4 runs the compression to memory as microcode.
template <class T>
class ChosenLanes
{
public:
  template <class M>
  HWY_INLINE explicit ChosenLanes(M chosen)
      : count_(static_cast<int>(hn::CountTrue(D(), chosen))), indices_(hn::IndicesFromVec(D(), IndicesOf(chosen)))
  {
  }
  HWY_INLINE int Count() const { return count_; }
  /// Writes a whole vector of numbers of the size of T, of which the first Count() have a meaning.
  template <class V, class P>
  HWY_INLINE void Store(V v, P* p) const
  {
    const D d;
    const hn::Rebind<P, D> dp;
    hn::StoreU(hn::BitCast(dp, hn::TableLookupLanes(hn::BitCast(d, v), indices_)), dp, p);
  }

private:
  using D = hn::ScalableTag<T>;
  using Whole = hn::RebindToUnsigned<D>;

  template <class M>
  static HWY_INLINE hn::Vec<Whole> IndicesOf(M chosen)
  {
    constexpr int kLanes = static_cast<int>(hn::MaxLanes(D()));
    const Whole du;
    if constexpr (kLanes <= 8)
    {
      std::uint8_t bits[8];
      hn::StoreMaskBits(D(), chosen, bits);
      const auto packed = hn::Set(du, kChosenIndices<kLanes>.packed[bits[0]]);
      return hn::And(packed >> hn::ShiftLeft<2>(hn::Iota(du, 0)), hn::Set(du, kLanes - 1));
    }
    else
    {
      // A table of 2^16 would be too large, but these instruction sets compress in a register.
      return hn::Compress(hn::Iota(du, 0), hn::MaskFromVec(hn::BitCast(du, hn::VecFromMask(D(), chosen))));
    }
  }

  int count_;
  decltype(hn::IndicesFromVec(D(), hn::Zero(Whole()))) indices_;
};

#include "Core/Formula/PixelLoss-inl.h"
#include "Core/Formula/Splat-inl.h"
// Use the types above.
#include "Core/Formula/Adam-inl.h"
#include "Core/Formula/Footprint-inl.h"

/// One number in every lane.
template <class T>
static HWY_INLINE View<Lanes<T>> Broadcast(const bigus::View<T>& v)
{
  const auto vector = [](const bigus::Vector3<T>& p) { return Vector3<Lanes<T>>{p.x, p.y, p.z}; };
  return {vector(v.origin), vector(v.a),     vector(v.b), vector(v.n),
          vector(v.dualA),  vector(v.dualB), v.area,      v.elevationVariance};
}

/// The block's arrays one after the other: mean, logScale, rotation, reflectivity.
constexpr int kRows = 11;
template <class T>
static HWY_INLINE const T (*RowsOf(const GaussianBlock<T>& block))[kBlock]
{
  static_assert(sizeof(GaussianBlock<T>) == kRows * kBlock * sizeof(T));
  return block.mean;
}

/// The Gaussians of numbers at(row), with rows as above.
template <class At>
static HWY_INLINE auto GaussianOf(At&& at) -> Gaussian<decltype(at(0))>
{
  return {{at(0), at(1), at(2)}, {at(3), at(4), at(5)}, {at(6), at(7), at(8), at(9)}, at(10)};
}

}  // namespace bigus::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // BIGUS_CPU_LANES_INL_H
