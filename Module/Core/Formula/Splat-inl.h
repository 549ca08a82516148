// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A Gaussian seen by a slice plane through a beam: its footprint in the image, and the way back from image to Gaussian.
//
// Whitened coordinates. In the Gaussian's own axes, scaled to unit size, space is y = S^-1 R^T (x - mu) and the
// Gaussian is exp(-|y|^2 / 2). A plane point d = p - (mu'_u, mu'_v) pixels from the foot of the mean, z mm off the
// plane, is
//
//     y = cu d_u + cv d_v + cz (z - mu'_z),    cu = S^-1 R^T a,  cv = S^-1 R^T b,  cz = S^-1 R^T n.
//
// The beam integral (paper eq 4, normalised to unit area) over N(z; 0, sigma_E^2) acts along e = cz / |cz| alone: with
// N = 1 + sigma_E^2 |cz|^2 it shrinks that component by 1 / sqrt(N) and multiplies the result by the same factor:
//
//     w(p) = 1 / sqrt(N) exp(-|y'|^2 / 2),   y' = D (cu d_u + cv d_v - cz mu'_z),
//     D = I - (1 - 1 / sqrt(N)) e e^T.
//
// So a thick beam costs no more than a thin plane, sigma_E = 0 needs no special case (D = I), and no exponent is ever
// positive. A QR of [D cu, D cv] gives the upper triangular factor U of the footprint's precision; the determinant and
// the residual have closed forms free of cancellation: with t = n^T Sigma n + sigma_E^2,
//
//     U22 = |a x b| sqrt(t / N) / (det S U11),   residual rho = -mu'_z / sqrt(t),
//     w(p) = amplitude exp(-|U (p - m)|^2 / 2).
//
// This equals paper eq 8 to 11 (A~ = U^T U up to pixel units, kappa_0 and parallax folded into amplitude and m).
//
// Written once for every number type: float and double, host and device, and the SIMD vectors of CpuKernels.cxx. So
// there are no branches here. It has no include guard: Splat.h includes it into namespace bigus, CpuKernels.cxx once
// more for each instruction set (code for an instruction set must be compiled for it as a whole).

template <class Real>
struct Vector3
{
  Real x, y, z;
};

template <class Real>
BIGUS_FORMULA Real Dot(const Vector3<Real>& p, const Vector3<Real>& q)
{
  return p.x * q.x + p.y * q.y + p.z * q.z;
}

template <class Real>
BIGUS_FORMULA Vector3<Real> Cross(const Vector3<Real>& p, const Vector3<Real>& q)
{
  return {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
}

/// Component by component.
template <class Real>
BIGUS_FORMULA Vector3<Real> Times(const Vector3<Real>& p, const Vector3<Real>& q)
{
  return {p.x * q.x, p.y * q.y, p.z * q.z};
}

template <class Real>
BIGUS_FORMULA Vector3<Real> Scaled(Real alpha, const Vector3<Real>& p)
{
  return {alpha * p.x, alpha * p.y, alpha * p.z};
}

/// alpha p + q
template <class Real>
BIGUS_FORMULA Vector3<Real> MultiplyAdd(Real alpha, const Vector3<Real>& p, const Vector3<Real>& q)
{
  return {alpha * p.x + q.x, alpha * p.y + q.y, alpha * p.z + q.z};
}

/// One Gaussian as engines hold it: positions relative to the engine's origin, scales as logarithms.
template <class Real>
struct Gaussian
{
  Vector3<Real> mean;      ///< mm
  Vector3<Real> logScale;  ///< ln mm
  Real rotation[4];        ///< unit quaternion w, x, y, z
  Real reflectivity;
};

/// A slice plane as kernels use it; see SlicePlane. Positions relative to the engine's origin.
template <class Real>
struct View
{
  Vector3<Real> origin;        ///< centre of pixel (0, 0), mm
  Vector3<Real> a, b, n;       ///< column step, row step (mm), unit normal
  Vector3<Real> dualA, dualB;  ///< first two rows of T: world offset to pixels
  Real area;                   ///< |a x b|, mm^2
  Real elevationVariance;      ///< sigma_E^2, mm^2
};

/// A footprint: w(p) = amplitude exp(-|U (p - m)|^2 / 2), U = [u11 u12; 0 u22], p and m in pixels.
template <class Real>
struct Splat
{
  Real u11, u12, u22;
  Real mu, mv;
  Real amplitude, logAmplitude;
};

/// A splat with what its adjoint needs. All vectors are in the Gaussian's own axes.
template <class Real>
struct Projection
{
  Splat<Real> splat;
  Vector3<Real> scale, inverseScale;  ///< s, mm, and 1 / s
  Vector3<Real> e;                    ///< cz / |cz|
  Vector3<Real> q1, q2, q3;           ///< orthonormal: y' = q1 eta_1 + q2 eta_2 + q3 rho, eta = U (p - m)
  Real kappa;                         ///< 1 - 1 / sqrt(N)
  Real spread;                        ///< (N - 1) / N: variance of y along e that the beam adds
  Real rho;
};

/// Rows of R^T are the Gaussian's axes in the world: local = R^T world.
template <class Real>
struct Axes
{
  Vector3<Real> x, y, z;
};

template <class Real>
BIGUS_FORMULA Axes<Real> AxesOf(const Real q[4])
{
  const Real w = q[0], x = q[1], y = q[2], z = q[3];
  return {{1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)},
          {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)},
          {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}};
}

template <class Real>
BIGUS_FORMULA Vector3<Real> ToLocal(const Axes<Real>& axes, const Vector3<Real>& world)
{
  return {Dot(axes.x, world), Dot(axes.y, world), Dot(axes.z, world)};
}

template <class Real>
BIGUS_FORMULA Projection<Real> Project(const Gaussian<Real>& gaussian, const View<Real>& view)
{
  using std::exp;
  using std::log;
  Projection<Real> out;
  const Axes<Real> axes = AxesOf(gaussian.rotation);
  const Vector3<Real> s{exp(gaussian.logScale.x), exp(gaussian.logScale.y), exp(gaussian.logScale.z)};
  const Vector3<Real> a = ToLocal(axes, view.a), b = ToLocal(axes, view.b), n = ToLocal(axes, view.n);
  // Divisions and roots are what takes longest here: one for each number divided by.
  const Real one = Real(1);
  const Vector3<Real> inverse{one / s.x, one / s.y, one / s.z};
  const Vector3<Real> cu = Times(a, inverse), cv = Times(b, inverse), cz = Times(n, inverse);

  const Real squaredLength = Dot(cz, cz), inverseLength = InverseRoot(squaredLength);
  const Vector3<Real> e = Scaled(inverseLength, cz);
  const Real g = view.elevationVariance * squaredLength;  // N - 1
  const Real inverseRootN = InverseRoot(one + g), rootN = (one + g) * inverseRootN;
  const Real excess = g / (rootN + 1);  // sqrt(N) - 1, free of cancellation
  out.kappa = excess * inverseRootN;
  out.spread = g * inverseRootN * inverseRootN;

  const Vector3<Real> du = MultiplyAdd(-out.kappa * Dot(e, cu), e, cu);
  const Vector3<Real> dv = MultiplyAdd(-out.kappa * Dot(e, cv), e, cv);

  // The normal of the whitened slice is D^-1 S n / sqrt(t), since cu x cv = |a x b| S n / det S.
  const Vector3<Real> sn = Times(s, n);
  const Real t = Dot(sn, sn) + view.elevationVariance;
  const Real inverseRootT = InverseRoot(t), rootT = t * inverseRootT;
  const Vector3<Real> normal = MultiplyAdd(excess * inverseLength, e, sn);
  out.q3 = Scaled(inverseRootT, normal);

  Splat<Real>& splat = out.splat;
  const Real squaredU11 = Dot(du, du), inverseU11 = InverseRoot(squaredU11);
  splat.u11 = squaredU11 * inverseU11;
  out.q1 = Scaled(inverseU11, du);
  out.q2 = Cross(out.q3, out.q1);
  splat.u12 = Dot(out.q1, dv);
  splat.u22 = view.area * inverse.x * inverse.y * inverse.z * rootT * inverseRootN * inverseU11;

  const Vector3<Real> offset = MultiplyAdd(Real(-1), view.origin, gaussian.mean);
  const Real muZ = Dot(view.n, offset);
  const Vector3<Real> ssn = Times(s, sn);
  const Real parallax = muZ * inverseRootT * inverseRootT;
  splat.mu = Dot(view.dualA, offset) - Dot(ToLocal(axes, view.dualA), ssn) * parallax;
  splat.mv = Dot(view.dualB, offset) - Dot(ToLocal(axes, view.dualB), ssn) * parallax;
  out.rho = -muZ * inverseRootT;
  const Real fall = Real(-0.5) * out.rho * out.rho;
  splat.amplitude = exp(fall) * inverseRootN;
  splat.logAmplitude = fall + log(inverseRootN);
  out.e = e;
  out.scale = s;
  out.inverseScale = inverse;
  return out;
}

/// What a walk over a footprint leaves: sums over pixels of g w times powers of eta = U (p - m), g = dL/dS(p).
template <class Real>
struct Moments
{
  Real m0;             ///< sum g w
  Real m1, m2;         ///< sum g w eta
  Real m11, m12, m22;  ///< sum g w eta eta^T
  Real error;          ///< sum |g| w: E_i of paper eq 14
};

/// Derivatives of the loss with respect to one Gaussian; see FieldGradient for units.
template <class Real>
struct GaussianGradient
{
  Vector3<Real> mean, logScale, rotation;
  Real reflectivity;
};

/// The adjoint of Project. The beam integral commutes with the derivative, so with <.> the average over the elevation z
/// that the beam sees at a pixel, dw/dtheta = w <d ln G / dtheta> where ln G = -|y|^2 / 2:
///
///     dL/dmu = r R S^-1 Y1,   dL/d ln s_k = r Y2_kk,   dL/domega_i = r Y2_jk (s_j^2 - s_k^2) / (s_j s_k),
///     dL/dr = m0,
///     Y1 = sum g w <y> = D Y1',   Y2 = sum g w <y y^T> = D Y2' D + m0 (N - 1) / N e e^T
///
/// with Y1', Y2' the same sums of y' = q1 eta_1 + q2 eta_2 + q3 rho. (i, j, k) is cyclic.
template <class Real>
BIGUS_FORMULA GaussianGradient<Real> ProjectAdjoint(const Gaussian<Real>& gaussian, const Projection<Real>& p,
                                                    const Moments<Real>& m)
{
  const Real r = gaussian.reflectivity;
  // Sums of y' and y' y'^T in the frame (q1, q2, q3), then in the Gaussian's axes: v_i = Y2' q_i.
  const Real m3 = p.rho * m.m0, m13 = p.rho * m.m1, m23 = p.rho * m.m2, m33 = p.rho * m3;
  Vector3<Real> y1 = MultiplyAdd(m.m1, p.q1, MultiplyAdd(m.m2, p.q2, Scaled(m3, p.q3)));
  const Vector3<Real> v1 = MultiplyAdd(m.m11, p.q1, MultiplyAdd(m.m12, p.q2, Scaled(m13, p.q3)));
  const Vector3<Real> v2 = MultiplyAdd(m.m12, p.q1, MultiplyAdd(m.m22, p.q2, Scaled(m23, p.q3)));
  const Vector3<Real> v3 = MultiplyAdd(m13, p.q1, MultiplyAdd(m23, p.q2, Scaled(m33, p.q3)));
  Real xx = p.q1.x * v1.x + p.q2.x * v2.x + p.q3.x * v3.x;
  Real yy = p.q1.y * v1.y + p.q2.y * v2.y + p.q3.y * v3.y;
  Real zz = p.q1.z * v1.z + p.q2.z * v2.z + p.q3.z * v3.z;
  Real xy = p.q1.x * v1.y + p.q2.x * v2.y + p.q3.x * v3.y;
  Real xz = p.q1.x * v1.z + p.q2.x * v2.z + p.q3.x * v3.z;
  Real yz = p.q1.y * v1.z + p.q2.y * v2.z + p.q3.y * v3.z;

  // D (.) D + spread m0 e e^T, D = I - kappa e e^T.
  const Vector3<Real>& e = p.e;
  const Vector3<Real> f{xx * e.x + xy * e.y + xz * e.z, xy * e.x + yy * e.y + yz * e.z, xz * e.x + yz * e.y + zz * e.z};
  const Real ee = p.kappa * p.kappa * Dot(e, f) + p.spread * m.m0;
  xx += ee * e.x * e.x - 2 * p.kappa * e.x * f.x;
  yy += ee * e.y * e.y - 2 * p.kappa * e.y * f.y;
  zz += ee * e.z * e.z - 2 * p.kappa * e.z * f.z;
  xy += ee * e.x * e.y - p.kappa * (e.x * f.y + e.y * f.x);
  xz += ee * e.x * e.z - p.kappa * (e.x * f.z + e.z * f.x);
  yz += ee * e.y * e.z - p.kappa * (e.y * f.z + e.z * f.y);
  y1 = MultiplyAdd(-p.kappa * Dot(e, y1), e, y1);

  const Vector3<Real>& s = p.scale;
  const Axes<Real> axes = AxesOf(gaussian.rotation);
  GaussianGradient<Real> out;
  const Vector3<Real>& t = p.inverseScale;
  const Real gx = r * y1.x * t.x, gy = r * y1.y * t.y, gz = r * y1.z * t.z;
  out.mean = MultiplyAdd(gx, axes.x, MultiplyAdd(gy, axes.y, Scaled(gz, axes.z)));
  out.logScale = {r * xx, r * yy, r * zz};
  out.rotation = {r * yz * (s.y * t.z - s.z * t.y), r * xz * (s.z * t.x - s.x * t.z), r * xy * (s.x * t.y - s.y * t.x)};
  out.reflectivity = m.m0;
  return out;
}
