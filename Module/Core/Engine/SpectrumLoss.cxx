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
namespace
{

/// The spectrum dF of a frame's error, orthonormal, and what follows from it. Columns above width / 2 hold conjugates
/// and are left out.
template <class Real>
class ErrorSpectrum
{
public:
  /// `counted` as SpectrumLoss takes it.
  ErrorSpectrum(int width, int height, const std::vector<std::uint8_t>& counted)
      : width_(width),
        height_(height),
        counted_(counted),
        across_(width),
        down_(height),
        values_(static_cast<std::size_t>(columns_) * height_)
  {
  }

  Real Scale() const { return scale_; }

  /// Two real rows a and b share a transform: of a + ib.
  void TransformRows(const Real* image, const Real* truth, std::size_t stride)
  {
    const auto difference = [&](int x, int y)
    { return Counts(x, y) ? image[y * stride + x] - truth[y * stride + x] : Real(0); };
    ForRanges(pairs_,
              [&](int begin, int end)
              {
                Fourier<Real> fourier(across_);
                std::vector<Complex> rows(width_), transform(width_);
                for (int y = 2 * begin; y < 2 * end; y += 2)
                {
                  for (int x = 0; x < width_; ++x)
                  {
                    rows[x] = Complex(difference(x, y), difference(x, y + 1));
                  }
                  fourier.Transform(rows.data(), transform.data());
                  for (int k = 0; k < columns_; ++k)
                  {
                    const Complex z = transform[k], mirrored = std::conj(transform[k ? width_ - k : 0]);
                    const Complex odd = z - mirrored;  // 2 i B
                    At(k, y) = (z + mirrored) * (scale_ / 2);
                    if (y + 1 < height_)
                    {
                      At(k, y + 1) = Complex(odd.imag(), -odd.real()) * (scale_ / 2);
                    }
                  }
                }
              });
  }

  /// Completes the spectrum and returns the largest |dF|.
  Real TransformColumns()
  {
    std::vector<Real> largest(columns_);  // |dF|^2
    ForRanges(columns_,
              [&](int begin, int end)
              {
                Fourier<Real> fourier(down_);
                std::vector<Complex> transform(height_);
                for (int k = begin; k < end; ++k)
                {
                  fourier.Transform(&At(k, 0), transform.data());
                  std::copy(transform.begin(), transform.end(), &At(k, 0));
                  for (const Complex& f : transform)
                  {
                    largest[k] = std::max(largest[k], std::norm(f));
                  }
                }
              });
    return std::sqrt(*std::max_element(largest.begin(), largest.end()));
  }

  /// Returns sum w |dF|^2 with w = |dF| / most, and begins the way back: transforms the columns of conj(w dF).
  double Weigh(Real most)
  {
    std::vector<double> sums(columns_);
    ForRanges(columns_,
              [&](int begin, int end)
              {
                Fourier<Real> fourier(down_);
                std::vector<Complex> weighted(height_);
                for (int k = begin; k < end; ++k)
                {
                  double sum = 0;
                  for (int row = 0; row < height_; ++row)
                  {
                    const Complex f = At(k, row);
                    const Real square = std::norm(f), w = std::sqrt(square) / most;
                    sum += static_cast<double>(w) * square;
                    weighted[row] = std::conj(f) * w;
                  }
                  sums[k] = k == 0 || 2 * k == width_ ? sum : 2 * sum;
                  fourier.Transform(weighted.data(), &At(k, 0));
                }
              });
    return SumInOrder(sums);
  }

  /// Ends the way back: adds slope times the transformed rows. Two of them share a transform again.
  void AddRows(Real slope, std::size_t stride, Real* derivative)
  {
    const auto value = [&](int k, int row) {
      return row >= height_ ? Complex(0) : k < columns_ ? At(k, row) : std::conj(At(width_ - k, row));
    };
    const auto add = [&](int x, int y, Real change)
    {
      if (Counts(x, y))
      {
        derivative[y * stride + x] += slope * change;
      }
    };
    ForRanges(pairs_,
              [&](int begin, int end)
              {
                Fourier<Real> fourier(across_);
                std::vector<Complex> transform(width_), rows(width_);
                for (int y = 2 * begin; y < 2 * end; y += 2)
                {
                  for (int k = 0; k < width_; ++k)
                  {
                    const Complex a = value(k, y), b = value(k, y + 1);
                    transform[k] = Complex(a.real() - b.imag(), a.imag() + b.real());  // a + ib
                  }
                  fourier.Transform(transform.data(), rows.data());
                  for (int x = 0; x < width_; ++x)
                  {
                    add(x, y, rows[x].real());
                    add(x, y + 1, rows[x].imag());
                  }
                }
              });
  }

private:
  using Complex = std::complex<Real>;

  Complex& At(int column, int row) { return values_[static_cast<std::size_t>(column) * height_ + row]; }

  bool Counts(int x, int y) const
  {
    return y < height_ && (counted_.empty() || counted_[static_cast<std::size_t>(y) * width_ + x]);
  }

  const int width_, height_;
  const int pairs_ = (height_ + 1) / 2, columns_ = width_ / 2 + 1;
  const Real scale_ = static_cast<Real>(1 / std::sqrt(static_cast<double>(width_) * height_));
  const std::vector<std::uint8_t>& counted_;
  const FourierTable<Real> across_, down_;
  std::vector<Complex> values_;  // [column][row]
};

}  // namespace

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
  ErrorSpectrum<Real> spectrum(width_, height_, counted_);
  spectrum.TransformRows(image, truth, stride);
  const Real most = spectrum.TransformColumns();
  if (!(most > 0))
  {
    return 0;
  }
  // The loss is sum w |dF|^2 with w = |dF| / most held, so its derivative is twice the inverse transform of w dF. It is
  // done with the forward transform, of conjugates.
  const double share = weight / static_cast<double>(countedPixels_);
  const double loss = share * spectrum.Weigh(most);
  spectrum.AddRows(static_cast<Real>(2 * share) * spectrum.Scale(), stride, derivative);
  return loss;
}

template double SpectrumLoss::Evaluate(double, const float*, const float*, std::size_t, float*) const;
template double SpectrumLoss::Evaluate(double, const double*, const double*, std::size_t, double*) const;

}  // namespace bigus
