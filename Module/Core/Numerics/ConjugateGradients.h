// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Least squares of many unknowns, whose matrix is known by its products only.
#pragma once

#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

namespace bigus
{

// What ConjugateGradients asks of vectors, here those of the host. Sums are serial: the same order for any number
// of threads.

template <class Real>
double Dot(const std::vector<Real>& p, const std::vector<Real>& q)
{
  double sum = 0;
  for (std::size_t i = 0; i < p.size(); ++i)
  {
    sum += static_cast<double>(p[i]) * q[i];
  }
  return sum;
}

/// y <- y + alpha x
template <class Real>
void AddScaled(std::vector<Real>& y, double alpha, const std::vector<Real>& x)
{
  for (std::size_t i = 0; i < y.size(); ++i)
  {
    y[i] += static_cast<Real>(alpha * x[i]);
  }
}

/// y <- x + beta y
template <class Real>
void ScaleAndAdd(std::vector<Real>& y, double beta, const std::vector<Real>& x)
{
  for (std::size_t i = 0; i < y.size(); ++i)
  {
    y[i] = x[i] + static_cast<Real>(beta * y[i]);
  }
}

/// Reduces a sum of squares that is quadratic in x, by conjugate gradients on its normal equations A x = b.
/// `product(x, withTarget)` returns A x - b, or A x without the target, as std::optional; nothing means: stop here.
/// `Vector` is any type with Dot, AddScaled and ScaleAndAdd as above. Returns |A x - b| at the end over that at the
/// start.
template <class Vector, class Product>
double ConjugateGradients(Vector& x, int iterations, Product&& product)
{
  const std::optional<Vector> gradient = product(x, true);
  if (!gradient)
  {
    return 1.0;
  }
  // The gradient g falls by alpha A d where x falls by alpha d; d are the directions, made of gradients.
  Vector g = *gradient, direction = *gradient;
  const double start = Dot(g, g);
  double now = start;
  for (int iteration = 0; iteration < iterations && now > 0; ++iteration)
  {
    const std::optional<Vector> image = product(direction, false);
    const double curvature = image ? Dot(direction, *image) : 0.0;
    if (!(curvature > 0))
    {
      break;
    }
    const double alpha = now / curvature;
    AddScaled(x, -alpha, direction);
    AddScaled(g, -alpha, *image);
    const double next = Dot(g, g);
    ScaleAndAdd(direction, next / now, g);
    now = next;
  }
  return start > 0 ? std::sqrt(now / start) : 0.0;
}

}  // namespace bigus
