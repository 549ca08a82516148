// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/ImageLoss.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <memory>
#include <string>
#include <utility>

#include "Core/Formula/WindowLoss.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/Fourier.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

constexpr int kGrain = 16;  // rows a task takes at least: its buffers and tables should be worth making

/// body(first, last) for ranges of [0, count). What a row gets must not depend on its range.
template <class Body>
void ForRanges(int count, Body&& body)
{
  tbb::parallel_for(tbb::blocked_range<int>(0, count, kGrain),
                    [&](const tbb::blocked_range<int>& range) { body(range.begin(), range.end()); });
}

// ---- Windows
// -----------------------------------------------------------------------------------------------------

constexpr int kMargin = ssimTaps - 1;  // so many fewer windows than pixels along an axis

/// SSIM's kernel from its centre outwards.
template <class Real>
std::array<Real, ssimRadius + 1> HalfKernel()
{
  const std::array<double, ssimTaps> kernel = SsimKernel();
  std::array<Real, ssimRadius + 1> half;
  for (int t = 0; t <= ssimRadius; ++t)
  {
    half[t] = static_cast<Real>(kernel[ssimRadius + t]);
  }
  return half;
}

/// out[x] = sum_t kernel[t] in[x + t step] for x in [0, count): along a row with step 1, down the columns
/// with the rows' distance.
template <class Real>
void Filter(const std::array<Real, ssimRadius + 1>& k, const Real* in, std::size_t step, std::size_t count,
            Real* __restrict out)
{
  const Real* c = in + ssimRadius * step;
  for (std::size_t x = 0; x < count; ++x)
  {
    out[x] = k[0] * c[x] + k[1] * (c[x - step] + c[x + step]) + k[2] * (c[x - 2 * step] + c[x + 2 * step]) +
             k[3] * (c[x - 3 * step] + c[x + 3 * step]) + k[4] * (c[x - 4 * step] + c[x + 4 * step]) +
             k[5] * (c[x - 5 * step] + c[x + 5 * step]);
  }
}

/// One row of windows: their weighted means of x, y, x^2, y^2 and xy, and room for what follows from them.
template <class Real>
struct WindowRow
{
  std::vector<Real> means[5];
  std::vector<Real> share;     // of the whole loss; 0 where a window does not count
  std::vector<Real> value;     // share * loss
  std::vector<Real> slope[3];  // dL/d means[0], [2] and [4]
};

/// term(weight, x, y, xx, yy, xy, loss) of every window of a row.
template <class Real, class Term>
void AddTerm(Real weight, int count, WindowRow<Real>& row, Term&& term)
{
  const Real *x = row.means[0].data(), *y = row.means[1].data(), *xx = row.means[2].data(), *yy = row.means[3].data(),
             *xy = row.means[4].data(), *share = row.share.data();
  Real* __restrict value = row.value.data();
  Real* __restrict p = row.slope[0].data();
  Real* __restrict q = row.slope[1].data();
  Real* __restrict r = row.slope[2].data();
  for (int i = 0; i < count; ++i)
  {
    WindowLoss<Real> loss{value[i], p[i], q[i], r[i]};
    term(weight * share[i], x[i], y[i], xx[i], yy[i], xy[i], loss);
    value[i] = loss.value;
    p[i] = loss.slopeX;
    q[i] = loss.slopeXX;
    r[i] = loss.slopeXY;
  }
}

}  // namespace

ImageLoss::ImageLoss(int width, int height, std::vector<std::uint8_t> counted)
    : width_(width), height_(height), counted_(std::move(counted))
{
  const std::size_t w = width, h = height;
  countedPixels_ = counted_.empty() ? w * h : std::count(counted_.begin(), counted_.end(), 1);
  countedWindows_ = 0;
  if (width < ssimTaps || height < ssimTaps)
  {
    return;
  }
  countedWindows_ = (w - kMargin) * (h - kMargin);
  if (countedPixels_ == w * h)
  {
    return;
  }
  // A window counts when the last ssimTaps rows all have ssimTaps counted pixels in a row.
  countedWindows_ = 0;
  windows_.assign((w - kMargin) * (h - kMargin), 0);
  std::vector<int> above(w, 0);
  for (std::size_t y = 0; y < h; ++y)
  {
    int run = 0;
    for (std::size_t x = 0; x < w; ++x)
    {
      run = counted_[y * w + x] ? run + 1 : 0;
      above[x] = run >= ssimTaps ? above[x] + 1 : 0;
      if (above[x] >= ssimTaps)
      {
        windows_[(y - kMargin) * (w - kMargin) + x - kMargin] = 1;
        ++countedWindows_;
      }
    }
  }
}

void ImageLoss::Check(const Loss& loss) const
{
  if ((loss.dssim == 0 && loss.contrast == 0) || countedWindows_ > 0)
  {
    return;
  }
  const std::string size = std::to_string(width_) + " x " + std::to_string(height_);
  throw Error(width_ < ssimTaps || height_ < ssimTaps
                  ? "Loss: frames of " + size +
                        " pixels are smaller than one window of 11 x 11, which dssim and contrast need."
                  : "Loss: no window of 11 x 11 pixels of the frames (" + size +
                        ") is wholly lit, as dssim and contrast need; count masked pixels or leave these "
                        "terms out.");
}

template <class Real>
double ImageLoss::Evaluate(const Loss& loss, double weight, const Real* image, const Real* truth, std::size_t stride,
                           Real* derivative) const
{
  double sum = 0;
  if (loss.dssim > 0 || loss.contrast > 0)
  {
    sum += EvaluateWindows(loss, weight, image, truth, stride, derivative);
  }
  if (loss.ffl > 0)
  {
    sum += EvaluateSpectrum(weight * loss.ffl, image, truth, stride, derivative);
  }
  return sum;
}

template <class Real>
double ImageLoss::EvaluateWindows(const Loss& loss, double weight, const Real* image, const Real* truth,
                                  std::size_t stride, Real* derivative) const
{
  const std::size_t width = width_, height = height_, across = width - kMargin, down = height - kMargin;
  const auto kernel = HalfKernel<Real>();

  // Along the rows ...
  const std::unique_ptr<Real[]> filtered(new Real[5 * height * across]);
  const auto means = [&](int k, std::size_t y) { return filtered.get() + (k * height + y) * across; };
  ForRanges(height_,
            [&](int begin, int end)
            {
              std::vector<Real> products[3];
              for (std::vector<Real>& product : products)
              {
                product.resize(width);
              }
              for (int y = begin; y < end; ++y)
              {
                const Real *a = image + y * stride, *b = truth + y * stride;
                for (std::size_t x = 0; x < width; ++x)
                {
                  products[0][x] = a[x] * a[x];
                  products[1][x] = b[x] * b[x];
                  products[2][x] = a[x] * b[x];
                }
                Filter(kernel, a, 1, across, means(0, y));
                Filter(kernel, b, 1, across, means(1, y));
                for (int k = 0; k < 3; ++k)
                {
                  Filter(kernel, products[k].data(), 1, across, means(2 + k, y));
                }
              }
            });

  // ... and down the columns: the windows, their loss and its slopes. These get a margin of zeros on all
  // sides, for the way back.
  const std::size_t wide = across + 2 * kMargin, tall = down + 2 * kMargin;
  const std::unique_ptr<Real[]> slopes(new Real[3 * tall * wide]());
  const auto slope = [&](int k, std::size_t y) { return slopes.get() + (k * tall + y) * wide; };
  std::vector<double> sums(down);
  ForRanges(static_cast<int>(down),
            [&](int begin, int end)
            {
              WindowRow<Real> row;
              for (std::vector<Real>& mean : row.means)
              {
                mean.resize(across);
              }
              const Real share = static_cast<Real>(weight / static_cast<double>(countedWindows_));
              row.share.assign(across, share);
              for (int y = begin; y < end; ++y)
              {
                for (int k = 0; k < 5; ++k)
                {
                  Filter(kernel, means(k, y), across, across, row.means[k].data());
                }
                for (std::size_t x = 0; x < (windows_.empty() ? 0 : across); ++x)
                {
                  row.share[x] = windows_[y * across + x] ? share : Real(0);
                }
                row.value.assign(across, Real(0));
                for (std::vector<Real>& values : row.slope)
                {
                  values.assign(across, Real(0));
                }
                if (loss.dssim > 0)
                {
                  AddTerm(static_cast<Real>(loss.dssim), static_cast<int>(across), row,
                          [](Real w, Real x, Real y, Real xx, Real yy, Real xy, WindowLoss<Real>& out)
                          { AddDssim(w, x, y, xx, yy, xy, out); });
                }
                if (loss.contrast > 0)
                {
                  AddTerm(static_cast<Real>(loss.contrast), static_cast<int>(across), row,
                          [](Real w, Real x, Real y, Real xx, Real yy, Real, WindowLoss<Real>& out)
                          { AddContrast(w, x, y, xx, yy, out); });
                }
                sums[y] = SumInOrder(row.value);
                for (int k = 0; k < 3; ++k)
                {
                  std::copy(row.slope[k].begin(), row.slope[k].end(), slope(k, y + kMargin) + kMargin);
                }
              }
            });

  // Every pixel from the windows it lies in: dL/dx = sum_windows kernel (dL/dmx + 2 x dL/dmxx + y dL/dmxy).
  ForRanges(height_,
            [&](int begin, int end)
            {
              std::vector<Real> column(wide), result[3];
              for (std::vector<Real>& values : result)
              {
                values.resize(width);
              }
              for (int y = begin; y < end; ++y)
              {
                for (int k = 0; k < 3; ++k)
                {
                  Filter(kernel, slope(k, y), wide, wide, column.data());
                  Filter(kernel, column.data(), 1, width, result[k].data());
                }
                const Real *a = image + y * stride, *b = truth + y * stride;
                Real* out = derivative + y * stride;
                for (std::size_t x = 0; x < width; ++x)
                {
                  out[x] += result[0][x] + 2 * a[x] * result[1][x] + b[x] * result[2][x];
                }
              }
            });
  return SumInOrder(sums);
}

template <class Real>
double ImageLoss::EvaluateSpectrum(double weight, const Real* image, const Real* truth, std::size_t stride,
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

  // The loss is sum w |dF|^2 with w = |dF| / most held, so its derivative is twice the inverse transform of w
  // dF. It is done with the forward transform, of conjugates.
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

template double ImageLoss::Evaluate(const Loss&, double, const float*, const float*, std::size_t, float*) const;
template double ImageLoss::Evaluate(const Loss&, double, const double*, const double*, std::size_t, double*) const;

}  // namespace bigus
