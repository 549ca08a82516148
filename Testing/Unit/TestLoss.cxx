// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Losses as text, of a pixel, and of whole images: against their definitions written out.
#include <gtest/gtest.h>

#include <clocale>
#include <cmath>
#include <complex>
#include <limits>
#include <vector>

#include "Core/Engine/ImageLoss.h"
#include "Core/Engine/Loss.h"
#include "Core/Formula/PixelLoss.h"
#include "Core/Metrics/Metrics.h"
#include "Core/Model/Error.h"
#include "Core/Model/TransferFunction.h"
#include "Core/Numerics/Constants.h"
#include "Support/Errors.h"
#include "Support/Random.h"

namespace
{

using bigus::Error;
using bigus::ImageLoss;
using bigus::Loss;
using bigus::TransferFunction;
using bigus::test::Message;
using bigus::test::Random;

// ---- Text -----------------------------------------------------------------------------------------------------------

TEST(LossText, NamesTermsWithFactors)
{
  EXPECT_EQ(Loss::Parse("l1").ToString(), "l1");
  EXPECT_EQ(Loss().ToString(), "l1");
  const Loss loss = Loss::Parse(" 0.8 * L1 + .2*DSSIM+1e-3*ffl+2.5e+1*contrast + l2 ");
  EXPECT_EQ(loss.l1, 0.8);
  EXPECT_EQ(loss.l2, 1);
  EXPECT_EQ(loss.dssim, 0.2);
  EXPECT_EQ(loss.ffl, 1e-3);
  EXPECT_EQ(loss.contrast, 25);
  EXPECT_EQ(loss.ToString(), "0.8*l1+l2+0.2*dssim+0.001*ffl+25*contrast");
  EXPECT_EQ(Loss::Parse("l2+0.5*l2").l2, 1.5);
  EXPECT_EQ(Loss::Parse("0*dssim+l2").ToString(), "l2");
  EXPECT_TRUE(Loss::Parse("0.5*l1+l2").IsPixelwise());
  EXPECT_FALSE(Loss::Parse("l1+1e-9*contrast").IsPixelwise());
}

TEST(LossText, ReadsBackTheSameBits)
{
  Random random(5);
  for (int i = 0; i < 1000; ++i)
  {
    const auto weight = [&random] { return random.LogUniform(1e-18, 1); };
    const Loss loss{weight(), weight(), weight(), weight(), weight()};
    const Loss back = Loss::Parse(loss.ToString());
    EXPECT_EQ(back.l1, loss.l1);
    EXPECT_EQ(back.l2, loss.l2);
    EXPECT_EQ(back.dssim, loss.dssim);
    EXPECT_EQ(back.ffl, loss.ffl);
    EXPECT_EQ(back.contrast, loss.contrast);
  }
}

TEST(LossText, DoesNotFollowTheLocale)
{
  if (!std::setlocale(LC_ALL, "de_DE.UTF-8"))
  {
    GTEST_SKIP() << "the locale de_DE.UTF-8 is not installed";
  }
  EXPECT_EQ(Loss::Parse("0.25*l1").l1, 0.25);
  EXPECT_EQ(Loss::Parse("0.25*l1").ToString(), "0.25*l1");
  std::setlocale(LC_ALL, "C");
}

TEST(LossText, RefusesEverythingElse)
{
  for (const char* text :
       {"",        " ",          "+",        "l1+",    "+l1",       "l1++l2",  "l3",           "l1 l2",  "l1l2",
        "l1,l2",   "0.5",        "0.5*",     "*l1",    "0.5l1",     "0.5**l1", "l1*0.5",       "1*1*l1", "l1-l2",
        "-0.5*l1", "l1+-0.5*l1", "0*l1",     "nan*l1", "inf*l1",    "-inf*l1", "1e400*l1",     "1e7*l1", "0x1p3*l1",
        "1e*l1",   "l1;rm -rf",  "\xff\xfe", "l1\n",   "dssim(l1)", "0,5*l1",  "9e5*l1+9e5*l1"})
  {
    EXPECT_THROW(Loss::Parse(text), Error) << text;
  }
  EXPECT_THROW(Loss::Parse(std::string("l1\0", 3)), Error);
  const std::string bomb = "l1" + std::string(1000000, '\x1b');
  const std::string refusal = Message([&] { Loss::Parse(bomb); });
  EXPECT_FALSE(refusal.empty());
  EXPECT_LT(refusal.size(), 200u);
  EXPECT_EQ(refusal.find('\x1b'), std::string::npos);
  std::string many = "1e-6*l1";
  for (int i = 0; i < 100000; ++i)
  {
    many += "+1e-6*l1";
  }
  EXPECT_NEAR(Loss::Parse(many).l1, 0.100001, 1e-9);
}

TEST(LossText, AnErrorNamesWhatIsWrong)
{
  const auto message = [](const Loss& loss) { return Message([&] { loss.Validate(); }); };
  EXPECT_EQ(message({1, 0, 0, 0, 0}), "");
  EXPECT_NE(message({1, 0, -2, 0, 0}).find("dssim is -2"), std::string::npos);
  EXPECT_NE(message({1, 0, 0, std::nan(""), 0}).find("ffl"), std::string::npos);
  EXPECT_NE(message({1, 0, 0, 0, INFINITY}).find("contrast"), std::string::npos);
  EXPECT_NE(message({0, 0, 0, 0, 0}).find("all weights are 0"), std::string::npos);
}

// ---- A pixel --------------------------------------------------------------------------------------------------------

double PixelValue(double l1, double l2, double gamma, double s, double truth)
{
  return bigus::EvaluateLoss(l1, l2, gamma, s, truth, 1.0, 0.0).loss;
}

double PixelSlope(double l1, double l2, double gamma, double s, double truth, double others = 0)
{
  return bigus::EvaluateLoss(l1, l2, gamma, s, truth, 1.0, others).derivative;
}

TEST(PixelLoss, IsTheErrorsSizeAndSquare)
{
  const TransferFunction transfer{0.8};
  for (double s : {-1.0, 0.0, 0.4, 2.0})
  {
    for (double truth : {0.0, 0.3, 1.0})
    {
      const double error = transfer.Intensity(s) - truth;
      EXPECT_NEAR(PixelValue(1, 0, transfer.gamma, s, truth), std::abs(error), 1e-15);
      EXPECT_NEAR(PixelValue(0, 1, transfer.gamma, s, truth), error * error, 1e-15);
      EXPECT_NEAR(PixelValue(0.3, 2, transfer.gamma, s, truth), 0.3 * std::abs(error) + 2 * error * error, 1e-15);
    }
  }
}

TEST(PixelLoss, DerivativeIsExactWhereThePixelIsLit)
{
  const double gamma = 0.8, step = 1e-6;
  for (const auto& [l1, l2] : {std::pair(1.0, 0.0), std::pair(0.0, 1.0), std::pair(0.3, 2.0)})
  {
    for (double s : {0.01, 0.4, 2.0, 5.0})
    {
      for (double truth : {0.0, 0.25, 0.9, 1.0})
      {
        const double slope =
            (PixelValue(l1, l2, gamma, s + step, truth) - PixelValue(l1, l2, gamma, s - step, truth)) / (2 * step);
        EXPECT_NEAR(PixelSlope(l1, l2, gamma, s, truth), slope, 1e-8);
      }
      // What other terms add to dL/dI goes through dI/dS = gamma (1 - I).
      EXPECT_NEAR(PixelSlope(l1, l2, gamma, s, 0.5, 0.7) - PixelSlope(l1, l2, gamma, s, 0.5),
                  0.7 * gamma * std::exp(-gamma * s), 1e-14);
    }
  }
}

TEST(PixelLoss, ADarkPixelIsPulledUpWhenItShouldBeLitAndLeftAloneWhenItShouldNot)
{
  const double gamma = 0.8;
  for (const auto& [l1, l2] : {std::pair(1.0, 0.0), std::pair(0.0, 1.0), std::pair(0.3, 2.0)})
  {
    for (double s : {-3.0, -1e-6, 0.0})
    {
      EXPECT_LT(PixelSlope(l1, l2, gamma, s, 0.4), 0);
      // The one-sided derivative at S = 0+, however far below zero S is.
      EXPECT_NEAR(PixelSlope(l1, l2, gamma, s, 0.4), PixelSlope(l1, l2, gamma, 1e-12, 0.4), 1e-9);
      EXPECT_EQ(PixelSlope(l1, l2, gamma, s, 0.0), 0);
      EXPECT_EQ(PixelSlope(l1, l2, gamma, s, 0.0, 0.3), 0);
      EXPECT_NEAR(PixelSlope(l1, l2, gamma, s, 0.0, -0.3), -0.3 * gamma, 1e-15);
    }
  }
}

// ---- Whole images ---------------------------------------------------------------------------------------------------

struct Images
{
  int width, height;
  std::vector<double> image, truth;
  std::vector<std::uint8_t> counted;

  Images(int w, int h, std::uint64_t seed, bool masked = false)
      : width(w), height(h), image(w * h), truth(w * h), counted(masked ? w * h : 0, 1)
  {
    Random random(seed);
    for (int p = 0; p < w * h; ++p)
    {
      image[p] = random.Uniform(0.1, 0.9);
      truth[p] = 0.5 * image[p] + 0.5 * random.Uniform();
    }
    for (int y = 0; masked && y < h; ++y)  // a corner cut off, and a hole
    {
      for (int x = 0; x < w; ++x)
      {
        counted[y * w + x] = 2 * x + 3 * y > w / 2 && !(x == w - 2 && y == h - 3);
      }
    }
  }
};

double Value(const Images& images, const Loss& loss, double weight = 1)
{
  std::vector<double> slope(images.image.size());
  return ImageLoss(images.width, images.height, images.counted)
      .Evaluate(loss, weight, images.image.data(), images.truth.data(), images.width, slope.data());
}

std::vector<double> Slope(const Images& images, const Loss& loss, double weight = 1)
{
  std::vector<double> slope(images.image.size());
  ImageLoss(images.width, images.height, images.counted)
      .Evaluate(loss, weight, images.image.data(), images.truth.data(), images.width, slope.data());
  return slope;
}

/// Means over every window that wholly counts, straight from the definitions.
struct Windows
{
  double dssim = 0, contrast = 0;
  int count = 0;

  explicit Windows(const Images& images)
  {
    double kernel[11], sum = 0;
    for (int t = 0; t < 11; ++t)
    {
      sum += kernel[t] = std::exp(-(t - 5) * (t - 5) / 4.5);
    }
    for (int y = 0; y + 11 <= images.height; ++y)
    {
      for (int x = 0; x + 11 <= images.width; ++x)
      {
        const auto mean = [&](auto&& value)
        {
          double total = 0;
          for (int t = 0; t < 121; ++t)
          {
            const int p = (y + t / 11) * images.width + x + t % 11;
            total += kernel[t / 11] * kernel[t % 11] / (sum * sum) * value(p);
          }
          return total;
        };
        if (!images.counted.empty() && mean([&](int p) { return images.counted[p]; }) < 1 - 1e-9)
        {
          continue;
        }
        const auto &a = images.image, &b = images.truth;
        const double ma = mean([&](int p) { return a[p]; }), mb = mean([&](int p) { return b[p]; });
        const double va = mean([&](int p) { return (a[p] - ma) * (a[p] - ma); });
        const double vb = mean([&](int p) { return (b[p] - mb) * (b[p] - mb); });
        const double cov = mean([&](int p) { return (a[p] - ma) * (b[p] - mb); });
        dssim += 1 - (2 * ma * mb + 1e-4) * (2 * cov + 9e-4) / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4));
        const double c = 1 / (255.0 * 255 * 12);
        contrast += std::pow(std::sqrt(va + c) - std::sqrt(vb + c), 2);
        ++count;
      }
    }
    dssim /= count;
    contrast /= count;
  }
};

/// sum w |dF|^2 / counted, by the definition of the transform; w from `images`, or held at `weights`.
double FocalFrequency(const Images& images, std::vector<double>& weights)
{
  const int w = images.width, h = images.height;
  std::vector<double> magnitudes;
  double most = 0;
  int counted = 0;
  for (int v = 0; v < h; ++v)
  {
    for (int u = 0; u < w; ++u)
    {
      std::complex<double> sum = 0;
      for (int p = 0; p < w * h; ++p)
      {
        const bool counts = images.counted.empty() || images.counted[p];
        counted += counts && u == 0 && v == 0;
        const double turn = static_cast<double>(u * (p % w)) / w + static_cast<double>(v * (p / w)) / h;
        sum += counts ? (images.image[p] - images.truth[p]) * std::polar(1.0, -2 * bigus::kPi * turn) : 0.0;
      }
      magnitudes.push_back(std::abs(sum) / std::sqrt(1.0 * w * h));
      most = std::max(most, magnitudes.back());
    }
  }
  if (weights.empty())
  {
    for (double magnitude : magnitudes)
    {
      weights.push_back(std::min(1.0, magnitude / most));
    }
  }
  double loss = 0;
  for (std::size_t k = 0; k < magnitudes.size(); ++k)
  {
    loss += weights[k] * magnitudes[k] * magnitudes[k] / counted;
  }
  return loss;
}

struct Size
{
  int width, height;
  bool masked;
};
const Size sizes[] = {{11, 11, false}, {12, 29, false}, {31, 17, false}, {31, 17, true}, {24, 26, true}};

TEST(ImageLossTest, WindowedTermsAreTheirDefinitions)
{
  for (const auto& [width, height, masked] : sizes)
  {
    const Images images(width, height, width, masked);
    const Windows windows(images);
    ASSERT_GT(windows.count, 0);
    EXPECT_NEAR(Value(images, Loss::Parse("dssim")), windows.dssim, 1e-12) << width << " x " << height;
    EXPECT_NEAR(Value(images, Loss::Parse("contrast")), windows.contrast, 1e-14);
    EXPECT_NEAR(Value(images, Loss::Parse("2*dssim+3*contrast+l1"), 0.5), windows.dssim + 1.5 * windows.contrast,
                1e-12);
  }
}

TEST(ImageLossTest, DssimIsOneMinusTheScore)
{
  const Images images(47, 33, 3);
  const std::vector<float> a(images.image.begin(), images.image.end()), b(images.truth.begin(), images.truth.end());
  EXPECT_NEAR(Value(images, Loss::Parse("dssim")), 1 - bigus::Ssim(a.data(), b.data(), 47, 33), 1e-7);
}

TEST(ImageLossTest, FocalFrequencyIsItsDefinition)
{
  // Even, odd and large prime lengths (the last take Bluestein's way), and less than a window.
  for (const auto& [width, height, masked] :
       {Size{8, 6, false}, Size{9, 5, false}, Size{1, 7, false}, Size{31, 17, true}, Size{43, 4, false},
        Size{6, 67, false}, Size{71, 3, false}, Size{1, 1, false}})
  {
    const Images images(width, height, width + 100, masked);
    std::vector<double> weights;
    const double expected = FocalFrequency(images, weights);
    EXPECT_NEAR(Value(images, Loss::Parse("ffl")), expected, 1e-12 * expected) << width << " x " << height;
  }
}

/// The derivative by every pixel against central differences of `value`.
template <class Function>
void CompareSlopes(const Images& images, const Loss& loss, Function&& value)
{
  const std::vector<double> slope = Slope(images, loss);
  double largest = 0;
  for (double s : slope)
  {
    largest = std::max(largest, std::abs(s));
  }
  for (std::size_t p = 0; p < slope.size(); p += 1 + slope.size() / 97)
  {
    const double h = 1e-5;
    Images moved = images;
    moved.image[p] += h;
    const double up = value(moved);
    moved.image[p] -= 2 * h;
    EXPECT_NEAR(slope[p], (up - value(moved)) / (2 * h), 1e-6 * largest) << loss.ToString() << ", pixel " << p;
    if (!images.counted.empty() && !images.counted[p])
    {
      EXPECT_EQ(slope[p], 0);
    }
  }
}

TEST(ImageLossTest, DerivativesEqualCentralDifferences)
{
  for (const auto& [width, height, masked] : sizes)
  {
    const Images images(width, height, width + 7, masked);
    for (const char* text : {"dssim", "contrast", "0.7*dssim+20*contrast"})
    {
      const Loss loss = Loss::Parse(text);
      CompareSlopes(images, loss, [&loss](const Images& moved) { return Value(moved, loss); });
    }
  }
  for (const auto& [width, height, masked] : {Size{8, 6, false}, Size{13, 9, true}, Size{71, 4, false}})
  {
    // The weights are not differentiated.
    const Images images(width, height, width + 9, masked);
    std::vector<double> weights;
    FocalFrequency(images, weights);
    CompareSlopes(images, Loss::Parse("ffl"),
                  [&weights](const Images& moved) { return FocalFrequency(moved, weights); });
  }
}

TEST(ImageLossTest, IsZeroForEqualImagesAndFiniteForConstantOnes)
{
  const Loss loss = Loss::Parse("dssim+ffl+contrast");
  Images images(23, 19, 1);
  images.image = images.truth;
  EXPECT_NEAR(Value(images, loss), 0, 1e-12);
  for (double s : Slope(images, loss))
  {
    EXPECT_NEAR(s, 0, 1e-12);
  }
  for (const double grey : {0.0, 1.0, 0.37})
  {
    for (const double other : {0.0, 0.5})
    {
      images.image.assign(images.image.size(), grey);
      images.truth.assign(images.truth.size(), other);
      EXPECT_TRUE(std::isfinite(Value(images, loss)));
      EXPECT_GE(Value(images, loss), -1e-12);
      for (double s : Slope(images, loss))
      {
        EXPECT_LT(std::abs(s), 10);
      }
    }
  }
  EXPECT_NEAR(Value(images, Loss::Parse("contrast")), 0, 1e-20);
}

TEST(ImageLossTest, PixelsThatDoNotCountChangeNothing)
{
  Images images(29, 24, 2, true);
  const Loss loss = Loss::Parse("dssim+ffl+contrast");
  const double before = Value(images, loss);
  const std::vector<double> slope = Slope(images, loss);
  for (std::size_t p = 0; p < images.image.size(); ++p)
  {
    if (!images.counted[p])
    {
      images.image[p] = 1 - images.image[p];
      images.truth[p] = 0;
      EXPECT_EQ(slope[p], 0);
    }
  }
  EXPECT_EQ(Value(images, loss), before);
  EXPECT_EQ(Slope(images, loss), slope);
}

TEST(ImageLossTest, FloatIsCloseToDouble)
{
  const Images images(75, 43, 8, true);
  const std::vector<float> a(images.image.begin(), images.image.end()), b(images.truth.begin(), images.truth.end());
  for (const char* text : {"dssim", "ffl", "contrast"})
  {
    const Loss loss = Loss::Parse(text);
    std::vector<float> slope(a.size());
    const double value = ImageLoss(75, 43, images.counted).Evaluate(loss, 1.0, a.data(), b.data(), 75, slope.data());
    EXPECT_NEAR(value, Value(images, loss), 1e-5 * Value(images, loss)) << text;
    const std::vector<double> expected = Slope(images, loss);
    double error = 0, size = 0;
    for (std::size_t p = 0; p < slope.size(); ++p)
    {
      error += std::pow(slope[p] - expected[p], 2);
      size += std::pow(expected[p], 2);
    }
    EXPECT_LT(std::sqrt(error / size), 1e-5) << text;
  }
}

TEST(ImageLossTest, ATermWithoutAWindowIsAnErrorThatNamesTheSize)
{
  const auto message = [](const ImageLoss& images, const char* text)
  { return Message([&] { images.Check(Loss::Parse(text)); }); };
  const ImageLoss small(40, 10, {});
  EXPECT_NE(message(small, "dssim").find("40 x 10"), std::string::npos);
  EXPECT_NE(message(small, "l1+contrast").find("40 x 10"), std::string::npos);
  EXPECT_EQ(message(small, "l1+l2+ffl"), "");
  EXPECT_EQ(message(ImageLoss(11, 11, {}), "dssim"), "");
  std::vector<std::uint8_t> oneUnlit(121, 1);
  oneUnlit[60] = 0;
  EXPECT_NE(message(ImageLoss(11, 11, oneUnlit), "dssim").find("lit"), std::string::npos);
}

}  // namespace
