// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The discrete Fourier transform, by OpenCV's cv::dft.
#pragma once

#include <complex>
#include <vector>

namespace bigus
{

/// out[v][u] = sum_y sum_x in[y][x] exp(-2 pi i (u x / width + v y / height)). Images are [height][width]. It takes
/// width height (p + q) steps, p and q being the largest prime factors of the sides.
void FourierTransform(const std::complex<double>* in, std::complex<double>* out, int width, int height);

/// What transforms of one length have in common; may be shared by threads.
///
/// cv::dft takes n p steps for a prime factor p of the length n. Where p is large, Bluestein's way is shorter: with
/// jk = (j^2 + k^2 - (k - j)^2) / 2 and c_j = exp(-i pi j^2 / n),
///   X_k = c_k sum_j (x_j c_j) conj(c_(k-j)),
/// which is a convolution, done by transforms of a padded length that has small prime factors only.
template <class Real>
struct FourierTable
{
  int length;
  int padded = 0;                          ///< 0: the length has small prime factors and needs no detour
  std::vector<std::complex<Real>> chirp;   ///< [length] c
  std::vector<std::complex<Real>> filter;  ///< [padded] transform of conj(c)

  explicit FourierTable(int n);
};

/// One thread's means to do transforms of one length. `table` must outlive it.
template <class Real>
class Fourier
{
public:
  explicit Fourier(const FourierTable<Real>& table) : table_(table), a_(table.padded), b_(table.padded) {}

  /// out_k = sum_j in_j exp(-2 pi i j k / n); `in` and `out` have `length` numbers and must not overlap.
  void Transform(const std::complex<Real>* in, std::complex<Real>* out);

private:
  const FourierTable<Real>& table_;
  std::vector<std::complex<Real>> a_, b_;  // [padded]
};

}  // namespace bigus
