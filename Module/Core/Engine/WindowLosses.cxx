// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/WindowLosses.h"

#include <algorithm>
#include <array>
#include <memory>
#include <string>

#include "Core/Engine/RowRanges.h"
#include "Core/Formula/WindowLoss.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

constexpr int kMargin = kSsimTaps - 1;  // so many fewer windows than pixels along an axis

/// SSIM's kernel from its centre outwards.
template <class Real>
using HalfKernel = std::array<Real, kSsimRadius + 1>;

template <class Real>
HalfKernel<Real> MakeHalfKernel()
{
  const std::array<double, kSsimTaps> kernel = SsimKernel();
  HalfKernel<Real> half;
  for (int t = 0; t <= kSsimRadius; ++t)
  {
    half[t] = static_cast<Real>(kernel[kSsimRadius + t]);
  }
  return half;
}

/// out[x] = sum_t kernel[t] in[x + t step] for x in [0, count): along a row with step 1, down the columns with the
/// rows' distance.
template <class Real>
void Filter(const HalfKernel<Real>& k, const Real* in, std::size_t step, std::size_t count, Real* __restrict out)
{
  const Real* c = in + kSsimRadius * step;
  for (std::size_t x = 0; x < count; ++x)
  {
    out[x] = k[0] * c[x] + k[1] * (c[x - step] + c[x + step]) + k[2] * (c[x - 2 * step] + c[x + 2 * step]) +
             k[3] * (c[x - 3 * step] + c[x + 3 * step]) + k[4] * (c[x - 4 * step] + c[x + 4 * step]) +
             k[5] * (c[x - 5 * step] + c[x + 5 * step]);
  }
}

/// What is compared, [height][stride] each.
template <class Real>
struct Frames
{
  std::size_t width, height;
  const Real *image, *truth;
  std::size_t stride;
};

template <class Real>
struct Planes
{
  std::size_t rows, columns;
  std::unique_ptr<Real[]> values;  // [planes][rows][columns]

  Real* Row(int k, std::size_t y) const { return values.get() + (k * rows + y) * columns; }
};

/// x, y, x^2, y^2 and xy, filtered along the rows.
template <class Real>
Planes<Real> FilterRows(const HalfKernel<Real>& kernel, const Frames<Real>& frames)
{
  const std::size_t width = frames.width, across = width - kMargin;
  Planes<Real> means{frames.height, across, std::unique_ptr<Real[]>(new Real[5 * frames.height * across])};
  ForRanges(static_cast<int>(frames.height),
            [&](int begin, int end)
            {
              std::vector<Real> products[3];
              for (std::vector<Real>& product : products)
              {
                product.resize(width);
              }
              for (int y = begin; y < end; ++y)
              {
                const Real *a = frames.image + y * frames.stride, *b = frames.truth + y * frames.stride;
                for (std::size_t x = 0; x < width; ++x)
                {
                  products[0][x] = a[x] * a[x];
                  products[1][x] = b[x] * b[x];
                  products[2][x] = a[x] * b[x];
                }
                Filter(kernel, a, 1, across, means.Row(0, y));
                Filter(kernel, b, 1, across, means.Row(1, y));
                for (int k = 0; k < 3; ++k)
                {
                  Filter(kernel, products[k].data(), 1, across, means.Row(2 + k, y));
                }
              }
            });
  return means;
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

/// The windows whose first row is y, from what was filtered along the rows. Nothing follows from them yet.
template <class Real>
void FilterColumns(const HalfKernel<Real>& kernel, const Planes<Real>& means, std::size_t y, WindowRow<Real>& row)
{
  for (int k = 0; k < 5; ++k)
  {
    row.means[k].resize(means.columns);
    Filter(kernel, means.Row(k, y), means.columns, means.columns, row.means[k].data());
  }
  row.value.assign(means.columns, Real(0));
  for (std::vector<Real>& values : row.slope)
  {
    values.assign(means.columns, Real(0));
  }
}

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

template <class Real>
void AddTerms(const Loss& loss, WindowRow<Real>& row)
{
  const int count = static_cast<int>(row.value.size());
  if (loss.dssim > 0)
  {
    AddTerm(static_cast<Real>(loss.dssim), count, row,
            [](Real w, Real x, Real y, Real xx, Real yy, Real xy, WindowLoss<Real>& out)
            { AddDssim(w, x, y, xx, yy, xy, out); });
  }
  if (loss.contrast > 0)
  {
    AddTerm(static_cast<Real>(loss.contrast), count, row,
            [](Real w, Real x, Real y, Real xx, Real yy, Real, WindowLoss<Real>& out)
            { AddContrast(w, x, y, xx, yy, out); });
  }
}

/// Every pixel from the windows it lies in: dL/dx = sum_windows kernel (dL/dmx + 2 x dL/dmxx + y dL/dmxy).
template <class Real>
void AddDerivative(const HalfKernel<Real>& kernel, const Frames<Real>& frames, const Planes<Real>& slopes,
                   Real* derivative)
{
  const std::size_t width = frames.width, wide = slopes.columns;
  ForRanges(static_cast<int>(frames.height),
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
                  Filter(kernel, slopes.Row(k, y), wide, wide, column.data());
                  Filter(kernel, column.data(), 1, width, result[k].data());
                }
                const Real *a = frames.image + y * frames.stride, *b = frames.truth + y * frames.stride;
                Real* out = derivative + y * frames.stride;
                for (std::size_t x = 0; x < width; ++x)
                {
                  out[x] += result[0][x] + 2 * a[x] * result[1][x] + b[x] * result[2][x];
                }
              }
            });
}

}  // namespace

WindowLosses::WindowLosses(int width, int height, const std::vector<std::uint8_t>& counted)
    : width_(width), height_(height)
{
  const std::size_t w = width, h = height;
  if (width < kSsimTaps || height < kSsimTaps)
  {
    return;
  }
  if (std::count(counted.begin(), counted.end(), 0) == 0)
  {
    countedWindows_ = (w - kMargin) * (h - kMargin);
    return;
  }
  // A window counts when the last kSsimTaps rows all have kSsimTaps counted pixels in a row.
  windows_.assign((w - kMargin) * (h - kMargin), 0);
  std::vector<int> above(w, 0);
  for (std::size_t y = 0; y < h; ++y)
  {
    int run = 0;
    for (std::size_t x = 0; x < w; ++x)
    {
      run = counted[y * w + x] ? run + 1 : 0;
      above[x] = run >= kSsimTaps ? above[x] + 1 : 0;
      if (above[x] >= kSsimTaps)
      {
        windows_[(y - kMargin) * (w - kMargin) + x - kMargin] = 1;
        ++countedWindows_;
      }
    }
  }
}

void WindowLosses::Check(const Loss& loss) const
{
  if ((loss.dssim == 0 && loss.contrast == 0) || countedWindows_ > 0)
  {
    return;
  }
  const std::string size = std::to_string(width_) + " x " + std::to_string(height_);
  throw Error(width_ < kSsimTaps || height_ < kSsimTaps
                  ? "Loss: frames of " + size +
                        " pixels are smaller than one window of 11 x 11, which dssim and contrast need."
                  : "Loss: no window of 11 x 11 pixels of the frames (" + size +
                        ") is wholly lit, as dssim and contrast need; count masked pixels or leave these "
                        "terms out.");
}

template <class Real>
double WindowLosses::Evaluate(const Loss& loss, double weight, const Real* image, const Real* truth, std::size_t stride,
                              Real* derivative) const
{
  const Frames<Real> frames{static_cast<std::size_t>(width_), static_cast<std::size_t>(height_), image, truth, stride};
  const std::size_t across = frames.width - kMargin, down = frames.height - kMargin;
  const Real share = static_cast<Real>(weight / static_cast<double>(countedWindows_));
  const HalfKernel<Real> kernel = MakeHalfKernel<Real>();
  const Planes<Real> means = FilterRows(kernel, frames);

  // Slopes get a margin of zeros on all sides, for the way back.
  const std::size_t wide = across + 2 * kMargin, tall = down + 2 * kMargin;
  const Planes<Real> slopes{tall, wide, std::unique_ptr<Real[]>(new Real[3 * tall * wide]())};
  std::vector<double> sums(down);
  ForRanges(static_cast<int>(down),
            [&](int begin, int end)
            {
              WindowRow<Real> row;
              for (int y = begin; y < end; ++y)
              {
                FilterColumns(kernel, means, y, row);
                row.share.assign(across, share);
                for (std::size_t x = 0; x < (windows_.empty() ? 0 : across); ++x)
                {
                  row.share[x] = windows_[y * across + x] ? share : Real(0);
                }
                AddTerms(loss, row);
                sums[y] = SumInOrder(row.value);
                for (int k = 0; k < 3; ++k)
                {
                  std::copy(row.slope[k].begin(), row.slope[k].end(), slopes.Row(k, y + kMargin) + kMargin);
                }
              }
            });
  AddDerivative(kernel, frames, slopes, derivative);
  return SumInOrder(sums);
}

template double WindowLosses::Evaluate(const Loss&, double, const float*, const float*, std::size_t, float*) const;
template double WindowLosses::Evaluate(const Loss&, double, const double*, const double*, std::size_t, double*) const;

}  // namespace bigus
