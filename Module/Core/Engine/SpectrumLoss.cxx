// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/SpectrumLoss.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>

#include "Core/Engine/RowRanges.h"
#include "Core/Numerics/Fourier.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{

SpectrumLoss::SpectrumLoss(int width, int height, std::vector<std::uint8_t> counted)
    : width_(width),
      height_(height),
      counted_(std::move(counted)),
      countedPixels_(counted_.empty() ? static_cast<std::size_t>(width) * height
                                      : std::count(counted_.begin(), counted_.end(), 1))
{
}

template <class Real>
double SpectrumLoss::Evaluate(double weight, const Real* image, const Real* truth, std::size_t stride,
                              Real* derivative) const
{
  using Complex = std::complex<Real>;
  const int width = width_, height = height_, pairs = (height + 1) / 2;
  const int columns = width / 2 + 1;  // the others hold their conjugates
  const FourierTable<Real> across(width), down(height);
  const Real scale = static_cast<Real>(1 / std::sqrt(static_cast<double>(width) * height));  // orthonormal
  std::vector<Complex> spectrum(static_cast<std::size_t>(columns) * height);                 // [column][row]
  const auto at = [&](int column, int row) -> Complex&
  { return spectrum[static_cast<std::size_t>(column) * height + row]; };

  // Two real rows a and b share a transform: of a + ib.
  ForRanges(pairs,
            [&](int begin, int end)
            {
              Fourier<Real> fourier(across);
              std::vector<Complex> rows(width), transform(width);
              const auto difference = [&](int x, int y)
              {
                const bool counts =
                    y < height && (counted_.empty() || counted_[static_cast<std::size_t>(y) * width + x]);
                return counts ? image[y * stride + x] - truth[y * stride + x] : Real(0);
              };
              for (int pair = begin; pair < end; ++pair)
              {
                const int y = 2 * pair;
                for (int x = 0; x < width; ++x)
                {
                  rows[x] = Complex(difference(x, y), difference(x, y + 1));
                }
                fourier.Transform(rows.data(), transform.data());
                for (int k = 0; k < columns; ++k)
                {
                  const Complex z = transform[k], mirrored = std::conj(transform[k ? width - k : 0]);
                  const Complex odd = z - mirrored;  // 2 i B
                  at(k, y) = (z + mirrored) * (scale / 2);
                  if (y + 1 < height)
                  {
                    at(k, y + 1) = Complex(odd.imag(), -odd.real()) * (scale / 2);
                  }
                }
              }
            });

  std::vector<Real> largest(columns);  // |dF|^2
  ForRanges(columns,
            [&](int begin, int end)
            {
              Fourier<Real> fourier(down);
              std::vector<Complex> transform(height);
              for (int k = begin; k < end; ++k)
              {
                fourier.Transform(&at(k, 0), transform.data());
                std::copy(transform.begin(), transform.end(), &at(k, 0));
                for (const Complex& f : transform)
                {
                  largest[k] = std::max(largest[k], std::norm(f));
                }
              }
            });
  const Real most = std::sqrt(*std::max_element(largest.begin(), largest.end()));
  if (!(most > 0))
  {
    return 0;
  }

  // The loss is sum w |dF|^2 with w = |dF| / most held, so its derivative is twice the inverse transform of w dF. It is
  // done with the forward transform, of conjugates.
  std::vector<double> sums(columns);
  ForRanges(columns,
            [&](int begin, int end)
            {
              Fourier<Real> fourier(down);
              std::vector<Complex> weighted(height);
              for (int k = begin; k < end; ++k)
              {
                double sum = 0;
                for (int row = 0; row < height; ++row)
                {
                  const Complex f = at(k, row);
                  const Real square = std::norm(f), w = std::sqrt(square) / most;
                  sum += static_cast<double>(w) * square;
                  weighted[row] = std::conj(f) * w;
                }
                sums[k] = k == 0 || 2 * k == width ? sum : 2 * sum;
                fourier.Transform(weighted.data(), &at(k, 0));
              }
            });
  const double share = weight / static_cast<double>(countedPixels_);
  const Real slope = static_cast<Real>(2 * share) * scale;
  ForRanges(pairs,
            [&](int begin, int end)
            {
              Fourier<Real> fourier(across);
              std::vector<Complex> transform(width), rows(width);
              for (int pair = begin; pair < end; ++pair)
              {
                const int y = 2 * pair;
                for (int k = 0; k < width; ++k)
                {
                  const auto value = [&](int row) {
                    return row >= height ? Complex(0) : k < columns ? at(k, row) : std::conj(at(width - k, row));
                  };
                  const Complex a = value(y), b = value(y + 1);
                  transform[k] = Complex(a.real() - b.imag(), a.imag() + b.real());  // a + ib
                }
                fourier.Transform(transform.data(), rows.data());
                for (int x = 0; x < width; ++x)
                {
                  const auto add = [&](int row, Real value)
                  {
                    if (row < height && (counted_.empty() || counted_[static_cast<std::size_t>(row) * width + x]))
                    {
                      derivative[row * stride + x] += slope * value;
                    }
                  };
                  add(y, rows[x].real());
                  add(y + 1, rows[x].imag());
                }
              }
            });
  return share * SumInOrder(sums);
}

template double SpectrumLoss::Evaluate(double, const float*, const float*, std::size_t, float*) const;
template double SpectrumLoss::Evaluate(double, const double*, const double*, std::size_t, double*) const;

}  // namespace bigus
