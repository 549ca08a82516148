// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Texture statistics against numpy and scipy, closed forms of Rayleigh speckle, white noise and waves.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "Core/Metrics/Texture.h"
#include "Core/Model/Error.h"
#include "Support/Images.h"

using bigus::CompareTexture;
using bigus::Error;
using bigus::ForEachNumber;
using bigus::kPi;
using bigus::kSpectrumBins;
using bigus::MeanTexture;
using bigus::SpectrumFrequency;
using bigus::TextureComparison;
using bigus::TextureStatistics;
using bigus::test::Constant;
using bigus::test::Image;
using bigus::test::Mixed;
using bigus::test::Noise;
using bigus::test::Ramp;
using bigus::test::Random;
using bigus::test::Speckle;

namespace
{

TextureComparison Compare(const Image& image, const Image& truth)
{
  return CompareTexture(image.pixels.data(), truth.pixels.data(), truth.width, truth.height);
}
TextureStatistics Of(const Image& image)
{
  return Compare(image, image).truth;
}

std::vector<double> AllNumbers(const TextureComparison& t)
{
  std::vector<double> numbers;
  ForEachNumber(t, [&](const std::string&, double v) { numbers.push_back(v); });
  numbers.insert(numbers.end(), t.image.power.begin(), t.image.power.end());
  numbers.insert(numbers.end(), t.truth.power.begin(), t.truth.power.end());
  return numbers;
}

}  // namespace

// Computed once with numpy 2.4.6 and scipy 1.17.1 on the same patterns rounded to float32, from the
// definitions: sliding_window_view(image, (7, 7))[::3, ::3] for patches, scipy.stats.wasserstein_distance,
// numpy.quantile, skew, kurtosis; for spectra numpy.fft.fft2(norm="ortho") of Hann-tapered 32 x 32 windows,
// stride 16, whose pixels are all lit, divided by the mean square of the taper, averaged over rings
// rint(hypot(kx, ky)).
TEST(Texture, AgreesWithNumpyAndScipy)
{
  const auto dark = [](const Image& of)  // the left third is black
  { return Image(of.width, of.height, [&](int x, int y) { return x < of.width / 3 ? 0 : of.At(x, y); }); };
  const struct
  {
    Image image, truth;
    std::vector<double> numbers;          // in the order of ForEachNumber
    double imagePower[4], truthPower[4];  // bins 0, 3, 7, 15
  } goldens[] = {
      {Mixed(97, 75),
       Noise(97, 75),
       {0.8041230160566605,  0.11223972845623957,   0.0547767259548682,  2.2943962541709064,  0.6269515607225151,
        0.4607715881194056,  0.04383488244363983,   0.3936834488868895,  0.4373382903492536,  0.46050903793971887,
        0.48400708471199017, 0.5263007002041781,    0.4966925576758263,  0.23040522024644755, 2.155734827294932,
        2.171510041309767,   -0.010722049180335095, -0.9406228024295924, 0.5730113165756451,  0.059796462870444114,
        0.47259632975776034, 0.5452869922705016,    0.5733242211742456,  0.6022182172181084,  0.6540994847764443,
        0.5022341478578515,  0.28903292701248195,   1.7376364452627309,  1.744213767825585,   -0.02044826029396399,
        -1.2033685683411466},
       {0.04234646142412246, 0.05559093473051792, 0.04812334926748463, 0.06672966798514803},
       {0.07527081932244115, 0.09882806848853865, 0.08554415936595039, 0.0885892728652562}},
      {Ramp(97, 75),
       Mixed(97, 75),
       {0.10134257531015972,  0.4140758087496328,    0.023572868906884023, 48.2303099008048,     4.830158711265543e-07,
        0.04669577936977276,  0.04103412077418739,   0.021461616253978584, 0.027628747306854516, 0.03534853961003316,
        0.049055117153023756, 0.10450873363294262,   0.509862426077303,    0.2116674186439262,   2.4087903057721425,
        28.289711853220798,   -0.017463516459306272, -0.6085190068246611,  0.4607715881194056,   0.04383488244363983,
        0.3936834488868895,   0.4373382903492536,    0.46050903793971887,  0.48400708471199017,  0.5263007002041781,
        0.4966925576758263,   0.23040522024644755,   2.155734827294932,    2.171510041309767,    -0.010722049180335095,
        -0.9406228024295924},
       {0.20333058312401892, 2.5172031420076185e-05, 2.5032760576533735e-07, 3.470949669045424e-09},
       {0.04234646142412246, 0.05559093473051792, 0.04812334926748463, 0.06672966798514803}},
      {Noise(120, 61),
       dark(Ramp(120, 61)),
       {6.161269537135456,   0.5118534913941918,    0.10667882533883621,  50.11093298411569,    3358972.739491267,
        0.5730192952447102,  0.06252462797370267,   0.46059794984855695,  0.54581790547241,     0.573247631277268,
        0.6040773326995585,  0.6518782769960526,    0.49972730930025105,  0.2877970965935485,   1.7363875981209371,
        1.7444468069966097,  -0.015125158189389983, -1.1910045303522012,  0.093003445441071,    0.22978661175856174,
        0.02054445181858532, 0.02503855123491048,   0.030046259390258862, 0.038769372399617565, 0.4124740955573113,
        0.5840400681074639,  0.2174008521854028,    2.686466323551416,    33.28201314551004,    -0.772218562005419,
        0.7206148020504366},
       {0.11598513769904412, 0.09907041288658236, 0.09463060077911938, 0.09386278685146872},
       {0.20333058286748834, 2.5172031587135894e-05, 2.5032762647585714e-07, 3.470963029682717e-09}},
  };
  for (const auto& golden : goldens)
  {
    const TextureComparison found = Compare(golden.image, golden.truth);
    std::size_t k = 0;
    ForEachNumber(found,
                  [&](const std::string& name, double value)
                  {
                    ASSERT_LT(k, golden.numbers.size());
                    const double expected = golden.numbers[k++];
                    // The histogram is as wide as 1/65536; a spectrum near the floor holds the rounding of
                    // pixels.
                    const double tolerance = name == "IntensityDistance"    ? 1.0 / 65536
                                             : name == "HighFrequencyPower" ? 1e-6 * std::abs(expected)
                                                                            : 1e-9 * (1 + std::abs(expected));
                    EXPECT_NEAR(value, expected, tolerance) << name;
                  });
    EXPECT_EQ(k, golden.numbers.size());
    const int bins[] = {0, 3, 7, 15};
    for (int b = 0; b < 4; ++b)
    {
      EXPECT_NEAR(found.image.power[bins[b]], golden.imagePower[b], 1e-9 * golden.imagePower[b]);
      EXPECT_NEAR(found.truth.power[bins[b]], golden.truthPower[b], 1e-9 * golden.truthPower[b]);
    }
  }
}

TEST(Texture, OfRayleighSpeckleHasItsConstants)
{
  const TextureStatistics found = Of(Speckle(700, 500, 0.1, 1));
  const double snr = std::sqrt(kPi / (4 - kPi));  // 1.913
  EXPECT_NEAR(found.intensity.mean, 0.1, 5e-4);
  EXPECT_NEAR(found.intensity.snr, snr, 0.01);
  EXPECT_NEAR(found.intensity.skewness, 2 * std::sqrt(kPi) * (kPi - 3) / std::pow(4 - kPi, 1.5), 0.02);  // 0.631
  EXPECT_NEAR(found.intensity.kurtosis, -(6 * kPi * kPi - 24 * kPi + 16) / std::pow(4 - kPi, 2), 0.06);  // 0.245
  EXPECT_NEAR(found.contrast.mean, 1 / snr, 0.01);  // 0.5227, and a little less for patches of 49 pixels
  EXPECT_NEAR(found.intensity.localSnr, snr, 0.05);
  EXPECT_NEAR(found.contrast.q50, found.contrast.mean, 0.01);
  // Independent pixels: their variance is the power at every frequency; the lowest loses some with the
  // window's mean.
  const double variance = std::pow(found.intensity.std, 2);
  EXPECT_NEAR(found.power[0], variance, 0.15 * variance);
  for (int b = 1; b < kSpectrumBins; ++b)
  {
    EXPECT_NEAR(found.power[b], variance, 0.03 * variance) << b;
  }
}

TEST(Texture, OfAWaveHasItsPowerAtItsFrequency)
{
  for (int frequency : {2, 5, 8, 13})
  {
    // Amplitude a on a circle of directions' worth: the wave runs along x, the ring of 2 pi f pixels shares
    // its power.
    const Image wave(200, 150, [&](int x, int) { return 0.5 + 0.2 * std::cos(2 * kPi * frequency * x / 32.0); });
    const auto power = Of(wave).power;
    const auto peak = std::max_element(power.begin(), power.end()) - power.begin();
    EXPECT_EQ(peak, frequency - 1);
    EXPECT_DOUBLE_EQ(SpectrumFrequency(static_cast<int>(peak)), frequency / 32.0);
    for (int b = 0; b < kSpectrumBins; ++b)
    {
      if (std::abs(b - peak) > 2)  // beyond the taper's width
      {
        EXPECT_LT(power[b], 1e-6 * power[peak]);
      }
    }
  }
}

TEST(Texture, OfBlurredSpeckleLosesContrastAndHighFrequencies)
{
  const Image truth = Speckle(300, 200, 0.2, 1);
  const auto blur = [&](double share)
  {
    return Image(300, 200,
                 [&](int x, int y)
                 {
                   double sum = 0;
                   for (int k = 0; k < 9; ++k)
                   {
                     sum += truth.At(std::clamp(x + k % 3 - 1, 0, 299), std::clamp(y + k / 3 - 1, 0, 199)) / 9;
                   }
                   return (1 - share) * truth.At(x, y) + share * sum;
                 });
  };
  TextureComparison before = Compare(truth, truth);
  for (double share : {0.3, 0.6, 1.0})
  {
    const TextureComparison found = Compare(blur(share), truth);
    EXPECT_LT(found.contrastRatio, before.contrastRatio);
    EXPECT_LT(found.highFrequencyPower, before.highFrequencyPower);
    EXPECT_GT(found.spectrumDifference, before.spectrumDifference);
    EXPECT_GT(found.contrastDistance, before.contrastDistance);
    EXPECT_GT(found.intensityDistance, before.intensityDistance);
    EXPECT_GT(found.image.intensity.snr, before.image.intensity.snr);
    before = found;
  }
  // A box of n pixels passes 1 / n of the variance.
  EXPECT_NEAR(before.image.intensity.std, before.truth.intensity.std / 3, 0.01);
}

TEST(Texture, ComparesStatisticsNotPixels)
{
  const TextureComparison found = Compare(Speckle(400, 300, 0.2, 2), Speckle(400, 300, 0.2, 1));
  EXPECT_NEAR(found.contrastRatio, 1, 0.01);
  EXPECT_LT(found.contrastDistance, 0.005);
  EXPECT_LT(found.intensityDistance, 0.002);
  EXPECT_LT(found.spectrumDifference, 0.3);
  EXPECT_NEAR(found.highFrequencyPower, 1, 0.02);
}

TEST(Texture, OfAShiftedHistogramIsTheShift)
{
  const Image truth = Noise(80, 60);
  const Image image(80, 60, [&](int x, int y) { return 0.5 * truth.At(x, y) + 0.25; });
  // Values v become v / 2 + 1/4: sorted, they differ by |v - 1/2| / 2. The last patches start at (72, 51).
  double expected = 0;
  for (int y = 0; y < 58; ++y)
  {
    for (int x = 0; x < 79; ++x)
    {
      expected += std::abs(truth.At(x, y) - 0.5) / 2 / (79 * 58);
    }
  }
  EXPECT_NEAR(Compare(image, truth).intensityDistance, expected, 1.0 / 65536);
}

TEST(Texture, OfIdenticalImagesAgrees)
{
  for (const Image& image : {Speckle(70, 50, 0.3, 1), Noise(70, 50), Constant(70, 50, 0.4), Constant(70, 50, 0)})
  {
    const TextureComparison found = Compare(image, image);
    EXPECT_EQ(found.contrastRatio, 1);
    EXPECT_EQ(found.contrastDistance, 0);
    EXPECT_EQ(found.intensityDistance, 0);
    EXPECT_NEAR(found.spectrumDifference, 0, 1e-9);
    EXPECT_NEAR(found.highFrequencyPower, 1, 1e-12);
  }
}

TEST(Texture, LooksOnlyWhereTheTruthIsLit)
{
  // Right half black in the truth: what the image holds beyond the reach of a lit patch must not matter.
  const Image speckle = Speckle(121, 80, 0.3, 1);
  const Image truth(121, 80, [&](int x, int y) { return x < 61 ? speckle.At(x, y) : 0; });
  const Image image(121, 80, [&](int x, int y) { return x < 67 ? truth.At(x, y) : 0.9 * ((x * y) % 2); });
  EXPECT_EQ(AllNumbers(Compare(image, truth)), AllNumbers(Compare(truth, truth)));
}

TEST(Texture, OfNothing)
{
  const std::vector<double> nothing = AllNumbers(TextureComparison{});
  EXPECT_EQ(AllNumbers(Compare(Noise(60, 40), Constant(60, 40, 0.0199))), nothing) << "dark truth";
  EXPECT_EQ(AllNumbers(Compare(Noise(6, 40), Ramp(6, 40))), nothing) << "no room for a patch";
  EXPECT_THROW(CompareTexture(nullptr, nullptr, 0, 4), Error);

  // No room for a spectrum.
  const TextureComparison small = Compare(Ramp(30, 60), Noise(30, 60));
  EXPECT_EQ(small.truth.power, TextureStatistics{}.power);
  EXPECT_EQ(small.spectrumDifference, 0);
  EXPECT_EQ(small.highFrequencyPower, 1);
  EXPECT_GT(small.contrastDistance, 0);

  const TextureStatistics flat = Compare(Constant(60, 40, 0.5), Noise(60, 40)).image;
  EXPECT_EQ(flat.contrast.mean, 0);
  EXPECT_EQ(flat.intensity.snr, std::numeric_limits<double>::infinity());
  EXPECT_EQ(flat.intensity.localSnr, std::numeric_limits<double>::infinity());
  EXPECT_EQ(flat.intensity.skewness, 0);
  // A black image beside speckle is off by the whole range down to the floor, not by infinity.
  EXPECT_LT(Compare(Constant(60, 40, 0), Noise(60, 40)).spectrumDifference, 100);
}

TEST(MeanTexture, AveragesEveryNumber)
{
  const TextureComparison a = Compare(Speckle(70, 50, 0.3, 1), Noise(70, 50));
  const TextureComparison b = Compare(Ramp(70, 50), Mixed(70, 50));
  const std::vector<double> first = AllNumbers(a), second = AllNumbers(b), mean = AllNumbers(MeanTexture({a, b}));
  ASSERT_EQ(mean.size(), first.size());
  for (std::size_t k = 0; k < mean.size(); ++k)
  {
    EXPECT_DOUBLE_EQ(mean[k], 0.5 * first[k] + 0.5 * second[k]);
  }
  EXPECT_EQ(AllNumbers(MeanTexture({})), AllNumbers(TextureComparison{}));
}

TEST(Texture, DoesNotDependOnTheNumberOfThreads)
{
  const Image image = Speckle(301, 203, 0.3, 1), truth = Speckle(301, 203, 0.3, 2);
  std::vector<double> one;
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    one = AllNumbers(Compare(image, truth));
  }
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 5);
  for (int k = 0; k < 3; ++k)
  {
    EXPECT_EQ(AllNumbers(Compare(image, truth)), one);
  }
}
