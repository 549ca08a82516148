// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Scores.h"

#include <cctype>
#include <nlohmann/json.hpp>

namespace bigus::command
{

namespace
{

std::string SnakeCase(const std::string& name)
{
  std::string out;
  for (char c : name)
  {
    if (std::isupper(static_cast<unsigned char>(c)) && !out.empty())
    {
      out += '_';
    }
    out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return out;
}

void PrintContrast(const char* name, const TextureStatistics::Contrast& contrast, Console& console)
{
  std::string quantiles;
  for (double q : {contrast.q05, contrast.q25, contrast.q50, contrast.q75, contrast.q95})
  {
    quantiles += " " + FormatNumber(q, 3);
  }
  console.Print(std::string("    ") + name + " " + FormatNumber(contrast.mean, 4) + " +- " +
                FormatNumber(contrast.std, 4) + ", 5 25 50 75 95 % below" + quantiles);
}

void PrintIntensity(const char* name, const TextureStatistics::Intensity& intensity, Console& console)
{
  console.Print(std::string("    ") + name + " " + FormatNumber(intensity.mean, 4) + " +- " +
                FormatNumber(intensity.std, 4) + ", SNR " + FormatNumber(intensity.snr, 3) + ", local SNR " +
                FormatNumber(intensity.localSnr, 3) + ", skewness " + FormatNumber(intensity.skewness, 3) +
                ", excess kurtosis " + FormatNumber(intensity.kurtosis, 3));
}

}  // namespace

Json TextureJson(const TextureComparison& texture)
{
  Json json = Json::object();
  ForEachNumber(texture, [&json](const std::string& name, double value) { json[SnakeCase(name)] = value; });
  json["spectrum_frequency"] = Json::array();
  for (int bin = 0; bin < kSpectrumBins; ++bin)
  {
    json["spectrum_frequency"].push_back(SpectrumFrequency(bin));
  }
  json["image_spectrum"] = texture.image.power;
  json["truth_spectrum"] = texture.truth.power;
  return json;
}

void PrintTexture(const TextureComparison& texture, Console& console)
{
  console.Print("  Speckle contrast: ratio to the truth's " + FormatNumber(texture.contrastRatio, 3) +
                ", distance of distributions " + FormatNumber(texture.contrastDistance, 4));
  PrintContrast("image", texture.image.contrast, console);
  PrintContrast("truth", texture.truth.contrast, console);
  console.Print("  Intensity where lit: distance of histograms " + FormatNumber(texture.intensityDistance, 4));
  PrintIntensity("image", texture.image.intensity, console);
  PrintIntensity("truth", texture.truth.intensity, console);
  console.Print("  Power spectrum: " + FormatNumber(texture.spectrumDifference, 2) + " dB from the truth's, " +
                FormatNumber(texture.highFrequencyPower, 3) + " of its power above half of Nyquist's frequency");
}

std::string TextureLine(const TextureComparison& texture)
{
  return "    texture beside the truth's: speckle contrast x " + FormatNumber(texture.contrastRatio, 3) +
         ", power above half Nyquist x " + FormatNumber(texture.highFrequencyPower, 3) + ", spectrum off by " +
         FormatNumber(texture.spectrumDifference, 2) + " dB";
}

}  // namespace bigus::command
