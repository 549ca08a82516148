// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// PSNR, SSIM and BFS against closed forms, other implementations and slow literal ones.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "Core/Metrics/BackscatterFidelity.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Model/Error.h"
#include "Support/Images.h"

using bigus::BackscatterFidelity;
using bigus::Bfs;
using bigus::Error;
using bigus::Psnr;
using bigus::Ssim;
using bigus::test::Constant;
using bigus::test::Image;
using bigus::test::Mixed;
using bigus::test::Noise;
using bigus::test::Ramp;
using bigus::test::RandomImage;

namespace
{

/// Speckle as an image holds it: clamped to 1.
Image ClampedSpeckle(int w, int h, double mean, std::uint64_t seed)
{
  Image image = bigus::test::Speckle(w, h, mean, seed);
  for (float& pixel : image.pixels)
  {
    pixel = std::min(pixel, 1.0f);
  }
  return image;
}

double PsnrOf(const Image& a, const Image& b)
{
  return Psnr(a.pixels.data(), b.pixels.data(), a.pixels.size());
}
double SsimOf(const Image& a, const Image& b)
{
  return Ssim(a.pixels.data(), b.pixels.data(), a.width, a.height);
}
BackscatterFidelity BfsOf(const Image& a, const Image& b)
{
  return Bfs(a.pixels.data(), b.pixels.data(), a.width, a.height);
}

/// SSIM straight from its definition: every window a double sum over its 121 pixels, centred moments.
double LiteralSsim(const Image& a, const Image& b)
{
  double total = 0;
  for (int t = -5; t <= 5; ++t)
  {
    total += std::exp(-t * t / 4.5);
  }
  const auto sum = [&](int x, int y, const std::function<double(double, double)>& f)
  {
    double s = 0;
    for (int dy = -5; dy <= 5; ++dy)
    {
      for (int dx = -5; dx <= 5; ++dx)
      {
        s += std::exp(-(dx * dx + dy * dy) / 4.5) / (total * total) * f(a.At(x + dx, y + dy), b.At(x + dx, y + dy));
      }
    }
    return s;
  };
  constexpr int margin = 5;
  double mean = 0;
  for (int y = margin; y < a.height - margin; ++y)
  {
    for (int x = margin; x < a.width - margin; ++x)
    {
      const double ma = sum(x, y, [](double p, double) { return p; });
      const double mb = sum(x, y, [](double, double q) { return q; });
      const double va = sum(x, y, [](double p, double) { return p * p; }) - ma * ma;
      const double vb = sum(x, y, [](double, double q) { return q * q; }) - mb * mb;
      const double cov = sum(x, y, [](double p, double q) { return p * q; }) - ma * mb;
      mean += (2 * ma * mb + 1e-4) * (2 * cov + 9e-4) / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4));
    }
  }
  return mean / ((a.width - 2 * margin) * (a.height - 2 * margin));
}

/// Wasserstein-1 as the area between two distribution functions.
double AreaBetween(std::vector<double> a, std::vector<double> b)
{
  std::vector<double> jumps = a;
  jumps.insert(jumps.end(), b.begin(), b.end());
  std::sort(jumps.begin(), jumps.end());
  const auto below = [](const std::vector<double>& v, double x)
  { return std::count_if(v.begin(), v.end(), [x](double w) { return w <= x; }) / static_cast<double>(v.size()); };
  double area = 0;
  for (std::size_t k = 1; k < jumps.size(); ++k)
  {
    area += std::abs(below(a, jumps[k - 1]) - below(b, jumps[k - 1])) * (jumps[k] - jumps[k - 1]);
  }
  return area;
}

/// BFS by the letter of its definition, one patch at a time.
BackscatterFidelity LiteralBfs(const Image& image, const Image& truth)
{
  const auto contrast = [](const Image& of, int x0, int y0, double* mean)
  {
    long double sum = 0, squares = 0;
    for (int k = 0; k < 49; ++k)
    {
      const long double v = of.At(x0 + k % 7, y0 + k / 7);
      sum += v;
      squares += v * v;
    }
    *mean = static_cast<double>(sum / 49);
    return static_cast<double>(std::sqrt(std::max(0.0L, squares / 49 - sum / 49 * sum / 49)) / (sum / 49));
  };
  std::vector<double> rec, gt, recRayleigh, gtRayleigh;
  for (int y = 0; y + 7 <= truth.height; y += 3)
  {
    for (int x = 0; x + 7 <= truth.width; x += 3)
    {
      double mean = 0, ignored = 0;
      const double c = contrast(truth, x, y, &mean);
      if (mean < 0.02)
      {
        continue;
      }
      gt.push_back(c);
      rec.push_back(contrast(image, x, y, &ignored));
      if (std::abs(c - 0.5227) < 0.1)
      {
        gtRayleigh.push_back(c);
        recRayleigh.push_back(rec.back());
      }
    }
  }
  const auto mean = [](const std::vector<double>& v)
  {
    double s = 0;
    for (double x : v)
    {
      s += x;
    }
    return s / v.size();
  };
  double variance = 0;
  for (double c : gt)
  {
    variance += std::pow(c - mean(gt), 2) / gt.size();
  }
  BackscatterFidelity out;
  out.meanContrast = std::max(0.0, 1 - std::abs(mean(rec) - mean(gt)) / mean(gt));
  out.contrastDistribution = std::exp(-AreaBetween(rec, gt) / std::sqrt(variance));
  out.rayleigh = gtRayleigh.empty() ? 1 : std::exp(-std::abs(mean(recRayleigh) - mean(gtRayleigh)) / 0.5227);
  out.score = 0.4 * out.meanContrast + 0.4 * out.contrastDistribution + 0.2 * out.rayleigh;
  return out;
}

void ExpectSame(const BackscatterFidelity& a, const BackscatterFidelity& b, double tolerance)
{
  EXPECT_NEAR(a.meanContrast, b.meanContrast, tolerance);
  EXPECT_NEAR(a.contrastDistribution, b.contrastDistribution, tolerance);
  EXPECT_NEAR(a.rayleigh, b.rayleigh, tolerance);
  EXPECT_NEAR(a.score, b.score, tolerance);
}

}  // namespace

TEST(Psnr, OfAConstantDifference)
{
  for (double d : {1.0, 0.5, 0.1, 1e-3})
  {
    EXPECT_NEAR(PsnrOf(Constant(63, 71, d), Constant(63, 71, 0)), -20 * std::log10(d), 1e-6);
  }
}

TEST(Psnr, OfOneWrongPixel)
{
  Image image = Constant(100, 80, 0.5);
  image.pixels[1234] = 0.75f;
  EXPECT_NEAR(PsnrOf(image, Constant(100, 80, 0.5)), 10 * std::log10(8000 / 0.0625), 1e-9);
}

TEST(Psnr, OfRoundingToBytesIsThatOfUniformNoise)
{
  const Image truth = RandomImage(700, 500, 1);
  Image rounded = truth;
  for (float& p : rounded.pixels)
  {
    p = std::round(p * 255) / 255;
  }
  EXPECT_NEAR(PsnrOf(rounded, truth), 20 * std::log10(255 * std::sqrt(12.0)), 0.02);
}

TEST(Psnr, OfIdenticalImagesIsInfinite)
{
  EXPECT_EQ(PsnrOf(Noise(9, 9), Noise(9, 9)), std::numeric_limits<double>::infinity());
}

TEST(Psnr, NeedsPixels)
{
  EXPECT_THROW(Psnr(nullptr, nullptr, 0), Error);
}

// Computed once with scikit-image 0.26.0 on the same patterns, rounded to float32 and then held in double:
//   structural_similarity(a, b, gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
//   data_range=1.0) peak_signal_noise_ratio(b, a, data_range=1.0)
// Its default truncation of 3.5 sigma makes the window 11 x 11, and its mean leaves out the 5 pixels at each
// edge.
TEST(Metrics, AgreeWithScikitImage)
{
  struct Golden
  {
    Image a, b;
    double ssim, psnr;
  };
  const Golden goldens[] = {
      {Mixed(64, 48), Noise(64, 48), 0.9073869491473716, 19.319474126311263},
      {Mixed(11, 11), Noise(11, 11), 0.9714978809745393, 19.952520605135227},
      {Mixed(12, 37), Noise(12, 37), 0.9076297541764865, 19.560056250010692},
      {Ramp(64, 48), Noise(64, 48), 0.01047750182281019, 8.887915417730882},
      {Ramp(11, 11), Noise(11, 11), 0.0006391855707512404, 5.475680278220722},
      {Ramp(12, 37), Noise(12, 37), 0.004184035350970914, 6.9318957825440775},
      {Ramp(64, 48), Mixed(64, 48), 0.01616786216563966, 10.108144398962553},
      {Ramp(12, 37), Mixed(12, 37), 0.007821202649190027, 7.663486563280165},
  };
  for (const Golden& g : goldens)
  {
    EXPECT_NEAR(SsimOf(g.a, g.b), g.ssim, 1e-10);
    EXPECT_NEAR(PsnrOf(g.a, g.b), g.psnr, 1e-10);
  }
}

TEST(Ssim, AgreesWithItsDefinition)
{
  for (const auto& [w, h] : {std::pair(11, 11), std::pair(11, 30), std::pair(33, 12), std::pair(29, 23)})
  {
    for (const auto& [a, b] : {std::pair(Noise(w, h), Mixed(w, h)), std::pair(Ramp(w, h), RandomImage(w, h, 5)),
                               std::pair(Constant(w, h, 0.3), ClampedSpeckle(w, h, 0.3, 2))})
    {
      EXPECT_NEAR(SsimOf(a, b), LiteralSsim(a, b), 1e-11);
    }
  }
}

TEST(Ssim, OfTinyImages)
{
  for (const auto& [w, h] : {std::pair(1, 1), std::pair(10, 11), std::pair(11, 10), std::pair(3, 200)})
  {
    EXPECT_THROW(SsimOf(Noise(w, h), Mixed(w, h)), Error);
  }
  EXPECT_THROW(Ssim(nullptr, nullptr, 0, 5), Error);
}

TEST(Ssim, OfIdenticalImagesIsOneAndTheOrderDoesNotMatter)
{
  EXPECT_NEAR(SsimOf(Noise(40, 30), Noise(40, 30)), 1, 1e-14);
  EXPECT_NEAR(SsimOf(Constant(40, 30, 0), Constant(40, 30, 0)), 1, 1e-14);
  EXPECT_EQ(SsimOf(Noise(40, 30), Ramp(40, 30)), SsimOf(Ramp(40, 30), Noise(40, 30)));
}

TEST(Ssim, OfTwoConstantsIsTheLuminanceTerm)
{
  const double a = 0.25, b = 0.75;
  EXPECT_NEAR(SsimOf(Constant(20, 20, a), Constant(20, 20, b)), (2 * a * b + 1e-4) / (a * a + b * b + 1e-4), 1e-12);
}

TEST(Bfs, AgreesWithItsDefinition)
{
  for (const auto& [w, h] : {std::pair(7, 7), std::pair(8, 40), std::pair(61, 47)})
  {
    const Image truths[] = {RandomImage(w, h, 1), ClampedSpeckle(w, h, 0.3, 2), Mixed(w, h)};
    const Image images[] = {RandomImage(w, h, 3), ClampedSpeckle(w, h, 0.2, 4), Ramp(w, h)};
    for (const Image& truth : truths)
    {
      for (const Image& image : images)
      {
        if (w > 7)
        {
          ExpectSame(BfsOf(image, truth), LiteralBfs(image, truth), 1e-9);
        }
        else  // a single patch has no spread: any difference is infinitely many deviations
        {
          EXPECT_EQ(BfsOf(image, truth).contrastDistribution, 0);
        }
      }
    }
  }
}

TEST(Bfs, OfIdenticalImagesIsOne)
{
  for (const Image& image : {ClampedSpeckle(50, 40, 0.3, 1), Noise(50, 40), Constant(50, 40, 0.4), Constant(50, 40, 0)})
  {
    ExpectSame(BfsOf(image, image), {1, 1, 1, 1}, 1e-14);
  }
}

TEST(Bfs, TermsLieBetweenZeroAndOne)
{
  const Image images[] = {ClampedSpeckle(50, 40, 0.3, 1), Noise(50, 40),       Ramp(50, 40),
                          Constant(50, 40, 0.4),          Constant(50, 40, 0), ClampedSpeckle(50, 40, 0.03, 1)};
  for (const Image& image : images)
  {
    for (const Image& truth : images)
    {
      const BackscatterFidelity bfs = BfsOf(image, truth);
      for (double term : {bfs.score, bfs.meanContrast, bfs.contrastDistribution, bfs.rayleigh})
      {
        EXPECT_GE(term, 0);
        EXPECT_LE(term, 1);
      }
    }
  }
}

TEST(Bfs, RewardsSpeckleOfTheSameStatisticsNotOfTheSamePixels)
{
  const Image truth = ClampedSpeckle(200, 150, 0.2, 1);
  const BackscatterFidelity other = BfsOf(ClampedSpeckle(200, 150, 0.2, 2), truth);
  const BackscatterFidelity smooth = BfsOf(Constant(200, 150, 0.2), truth);
  EXPECT_GT(other.score, 0.95);
  EXPECT_LT(smooth.score, 0.2);
  EXPECT_EQ(smooth.meanContrast, 0);
  EXPECT_NEAR(smooth.rayleigh, std::exp(-1), 0.05);
  // A blurred speckle pattern scores between the two.
  const Image blurred(200, 150,
                      [&](int x, int y)
                      {
                        double sum = 0;
                        int count = 0;
                        for (int k = 0; k < 9; ++k)
                        {
                          if (truth.Has(x + k % 3 - 1, y + k / 3 - 1))
                          {
                            sum += truth.At(x + k % 3 - 1, y + k / 3 - 1);
                            ++count;
                          }
                        }
                        return sum / count;
                      });
  EXPECT_GT(BfsOf(blurred, truth).score, smooth.score);
  EXPECT_LT(BfsOf(blurred, truth).score, other.score);
}

TEST(Bfs, DoesNotChangeWithBrightness)
{
  const Image truth = ClampedSpeckle(80, 60, 0.2, 1);
  Image brighter = truth;
  for (float& p : brighter.pixels)
  {
    p *= 0.5f;
  }
  ExpectSame(BfsOf(brighter, truth), {1, 1, 1, 1}, 1e-12);
}

TEST(Bfs, SkipsPatchesThatAreDarkInTheTruth)
{
  // Right half black in the truth: what the image holds beyond the reach of a lit patch must not matter.
  const Image truth(61, 40,
                    [speckle = ClampedSpeckle(61, 40, 0.3, 1)](int x, int y) { return x < 28 ? speckle.At(x, y) : 0; });
  Image image = truth;
  for (int y = 0; y < 40; ++y)
  {
    for (int x = 34; x < 61; ++x)
    {
      image.pixels[static_cast<std::size_t>(y) * 61 + x] = 0.9f * static_cast<float>((x * y) % 2);
    }
  }
  ExpectSame(BfsOf(image, truth), {1, 1, 1, 1}, 1e-14);
}

TEST(Bfs, WithNoLitPatchOrNoPatchIsOne)
{
  ExpectSame(BfsOf(Noise(40, 40), Constant(40, 40, 0.0199)), {1, 1, 1, 1}, 0);
  ExpectSame(BfsOf(Noise(6, 40), Ramp(6, 40)), {1, 1, 1, 1}, 0);
  EXPECT_THROW(Bfs(nullptr, nullptr, 0, 4), Error);
}

TEST(Bfs, OfAConstantTruthAsksForAConstantImage)
{
  const Image truth = Constant(40, 40, 0.5);
  ExpectSame(BfsOf(Constant(40, 40, 0.1), truth), {1, 1, 1, 1}, 0);
  const BackscatterFidelity bfs = BfsOf(Noise(40, 40), truth);
  EXPECT_EQ(bfs.meanContrast, 0);
  EXPECT_EQ(bfs.contrastDistribution, 0);
  EXPECT_EQ(bfs.rayleigh, 1);
}

TEST(Metrics, DoNotDependOnTheNumberOfThreads)
{
  const Image a = ClampedSpeckle(301, 203, 0.3, 1), b = ClampedSpeckle(301, 203, 0.3, 2);
  const auto measure = [&]
  {
    const BackscatterFidelity bfs = BfsOf(a, b);
    return std::vector<double>{PsnrOf(a, b), SsimOf(a, b), bfs.score, bfs.meanContrast, bfs.contrastDistribution,
                               bfs.rayleigh};
  };
  std::vector<double> one;
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    one = measure();
  }
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 5);
  for (int k = 0; k < 5; ++k)
  {
    EXPECT_EQ(measure(), one);
  }
}
