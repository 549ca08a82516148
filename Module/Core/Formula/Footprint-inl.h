// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where a splat ends: the pixels in which it matters. Written for scalars and SIMD vectors, like Splat-inl.h: no
// include guard.

/// A footprint, w(p) = exp(logAmplitude - |U (p - m)|^2 / 2): the ellipse |U (p - m)|^2 <= cut, relative to the pixel
/// where the view's origin lies. Its centre m is kept as a pixel and a fraction, |mu| <= 1/2 and -1 < mv <= 0: so float
/// loses nothing in a large image.
template <class Real>
struct Footprint
{
  Real logAmplitude;
  Real cut;                       ///< k^2
  Real column, row, mu, mv;       ///< m = (column + mu, row + mv)
  Real columnBegin, columnEnd;    ///< half-open
  Real half;                      ///< rows [row - half, row + half): as many on either side of the centre
  Real curvature, rootCurvature;  ///< of -ln w along a column, u12^2 + u22^2, and its root
  Real margin;  ///< standard deviations along a column that w has left, where it is cut, before it underflows
};

/// k^2, the squared number of standard deviations within which magnitude * w can reach the tolerance: 2 ln(magnitude /
/// tolerance), 0 when it never does. Without a tolerance everything counts until T underflows.
template <class Real, class T>
BIGUS_FORMULA Real CutFor(Real magnitude, T tolerance)
{
  using std::log;
  const Real zero = Real(T(0)), everything = Real(kWholeCut<T>);
  if (!(tolerance > 0))
  {
    return Select(magnitude > zero, everything, zero);
  }
  const Real cut = Real(T(2)) * log(max(magnitude * Real(T(1) / tolerance), Real(T(1))));
  return min(cut, everything);
}

/// `cut` is CutFor the Gaussian's magnitude, T the scalar type of Real. Beyond `lowestExponent` exp underflows in the
/// type that evaluates footprints.
template <class Real, class T>
BIGUS_FORMULA Footprint<Real> FootprintOf(const Splat<Real>& s, Real cut, T lowestExponent)
{
  using std::ceil;
  using std::floor;
  using std::sqrt;
  Footprint<Real> out;
  const Real zero = Real(T(0)), one = Real(T(1)), far = Real(T(kFarthestPixel));
  const auto bounded = [far](Real value) { return min(max(value, Real(T(-kFarthestPixel))), far); };
  out.cut = max(cut + (s.logAmplitude + s.logAmplitude), zero);
  out.logAmplitude = s.logAmplitude;
  const Real k = sqrt(out.cut);
  out.curvature = s.u12 * s.u12 + s.u22 * s.u22;
  out.rootCurvature = sqrt(out.curvature);
  const Real inverse = k / (s.u11 * s.u22);
  const Real halfU = inverse * out.rootCurvature, halfV = inverse * s.u11;
  out.column = bounded(floor(s.mu + Real(T(0.5))));
  out.row = bounded(ceil(s.mv));
  out.mu = s.mu - out.column;
  out.mv = s.mv - out.row;
  out.half = bounded(max(floor(out.mv + halfV) + one, floor(halfV - out.mv)));
  // A centre that had to be bounded lies further away than any row can be counted from: no row is its own.
  out.half = Select(out.mv <= one, Select(out.mv >= -one, out.half, zero), zero);
  out.columnBegin = bounded(ceil(s.mu - halfU));
  out.columnEnd = bounded(floor(s.mu + halfU) + one);
  out.margin = sqrt(max(Real(T(2)) * (out.logAmplitude - Real(lowestExponent)), zero)) - k;
  return out;
}

/// Along a column ln w is a parabola of curvature c = u12^2 + u22^2. A recurrence (rows w <- w q, q <- q exp(-c)) may
/// run over it where neither w nor q underflows.
///
/// w: a pixel that matters lies within k of the parabola's vertex, in units of 1 / sqrt(c). Started n rows away, ln w
/// there is at least ln amplitude - (k + n sqrt(c))^2 / 2.
template <class Real>
BIGUS_FORMULA auto WeightsHold(const Footprint<Real>& f, Real rows)
{
  return f.margin >= rows * f.rootCurvature;
}

/// q: where w does not underflow, it lies within E = sqrt(-2 lowest) of the vertex, so |ln q| <= E sqrt(c) + c / 2,
/// which stays below -lowest for c <= (0.4 E)^2 = -0.32 lowest.
template <class Real, class T>
BIGUS_FORMULA auto RatiosHold(const Footprint<Real>& f, T lowestExponent)
{
  return f.curvature <= Real(T(-kSteepestRecurrence) * lowestExponent);
}
