// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Numerics/Fourier.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>

#include "Core/Numerics/Constants.h"

namespace bigus
{
namespace
{

// Beyond this prime factor two transforms of a padded length take fewer steps than one of the length itself.
constexpr int kLargestFactor = 64;

// std::complex's own product looks for infinities that do not occur here.
template <class Real>
std::complex<Real> Product(std::complex<Real> a, std::complex<Real> b)
{
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

int LargestPrimeFactor(int n)
{
  int largest = 1;
  for (int p = 2; n > 1; p = p * p > n ? n : p + 1)
  {
    for (; n % p == 0; n /= p)
    {
      largest = p;
    }
  }
  return largest;
}

/// The transform of `rows` rows of n numbers in two dimensions, or as the flags say.
template <class Real>
void PlainTransform(const std::complex<Real>* in, std::complex<Real>* out, int n, int rows = 1, int flags = 0)
{
  constexpr int kType = sizeof(Real) == sizeof(float) ? CV_32FC2 : CV_64FC2;
  cv::Mat result(rows, n, kType, out);
  cv::dft(cv::Mat(rows, n, kType, const_cast<std::complex<Real>*>(in)), result, flags);
}

}  // namespace

void FourierTransform(const std::complex<double>* in, std::complex<double>* out, int width, int height)
{
  PlainTransform(in, out, width, height);
}

template <class Real>
FourierTable<Real>::FourierTable(int n) : length(n)
{
  if (LargestPrimeFactor(n) <= kLargestFactor)
  {
    return;
  }
  padded = cv::getOptimalDFTSize(2 * n - 1);
  chirp.resize(n);
  std::vector<std::complex<Real>> wrapped(padded);
  for (std::int64_t j = 0; j < n; ++j)
  {
    const double angle = -kPi * static_cast<double>(j * j % (2 * n)) / n;
    chirp[j] = std::complex<Real>(std::complex<double>(std::cos(angle), std::sin(angle)));
    wrapped[j] = std::conj(chirp[j]);
    wrapped[j ? padded - j : 0] = wrapped[j];
  }
  filter.resize(padded);
  PlainTransform(wrapped.data(), filter.data(), padded);
}

template <class Real>
void Fourier<Real>::Transform(const std::complex<Real>* in, std::complex<Real>* out)
{
  const int n = table_.length;
  if (table_.padded == 0)
  {
    PlainTransform(in, out, n);
    return;
  }
  for (int j = 0; j < n; ++j)
  {
    a_[j] = Product(in[j], table_.chirp[j]);
  }
  std::fill(a_.begin() + n, a_.end(), std::complex<Real>(0));
  PlainTransform(a_.data(), b_.data(), table_.padded);
  for (int j = 0; j < table_.padded; ++j)
  {
    b_[j] = Product(b_[j], table_.filter[j]);
  }
  PlainTransform(b_.data(), a_.data(), table_.padded, 1, cv::DFT_INVERSE | cv::DFT_SCALE);
  for (int k = 0; k < n; ++k)
  {
    out[k] = Product(a_[k], table_.chirp[k]);
  }
}

template struct FourierTable<float>;
template struct FourierTable<double>;
template class Fourier<float>;
template class Fourier<double>;

}  // namespace bigus
