// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/TrainerOptions.h"

#include <sstream>

#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

void Require(bool condition, const char* option, double value, const char* range)
{
  if (!condition)
  {
    std::ostringstream text;
    text << "Trainer: " << option << " is " << value << "; it must be " << range << ".";
    throw Error(text.str());
  }
}

/// False for NaN.
bool Between(double value, double low, double high)
{
  return value >= low && value <= high;
}

}  // namespace

void TrainerOptions::Validate() const
{
  const auto count = [](const char* option, std::size_t value)
  { Require(value >= 1 && value <= (std::size_t(1) << 26), option, static_cast<double>(value), "1 to 67108864"); };
  count("gaussians", gaussians.value_or(1));
  count("maximum of gaussians", maximumGaussians);
  Require(Between(price, 0, 100), "price", price, "0 to 100 dB");
  Require(trackerTranslation > 0 && trackerTranslation <= 1000, "tracker translation", trackerTranslation,
          "above 0, at most 1000 mm");
  Require(trackerRotation > 0 && trackerRotation <= 45, "tracker rotation", trackerRotation,
          "above 0, at most 45 degrees");
  loss.Validate();
  if (finalLoss)
  {
    finalLoss->Validate();
  }
  Require(!elevationSigma || Between(*elevationSigma, 0, 1e3), "elevation sigma", elevationSigma.value_or(0),
          "0 to 1000 mm");
  Require(holdOut == 0 || holdOut >= 2, "hold-out", holdOut, "0 (none), or at least 2");
  Require(validation == 0 || validation >= 2, "validation", validation, "0 (none), or at least 2");
  Require(patience >= 1, "patience", patience, "at least 1");
  Require(!iterations || (*iterations >= 0 && *iterations <= 10000000), "iterations", iterations.value_or(0),
          "0 to 10000000");
  Require(Between(timeLimit, 0, 1e9), "time limit", timeLimit, "0 (none) to 1e9 seconds");
  Require(batch >= 1 && batch <= 4096, "batch", batch, "1 to 4096 frames");
  Require(Between(tolerance, 0, 1), "tolerance", tolerance, "0 to 1");
  Require(Between(meanRate, 0, 100), "mean rate", meanRate, "0 to 100 pixels");
  Require(Between(shapeRate, 0, 1), "shape rate", shapeRate, "0 to 1");
  Require(Between(reflectivityRate, 0, 10), "reflectivity rate", reflectivityRate, "0 to 10");
  Require(Between(finalRate, 1e-6, 1), "final rate", finalRate, "1e-6 to 1");
  Require(!solveIterations || (*solveIterations >= 0 && *solveIterations <= 1000), "solve iterations",
          solveIterations.value_or(0), "0 to 1000");
  Require(!virtualPlanes || (*virtualPlanes >= 0 && *virtualPlanes <= 8), "virtual planes", virtualPlanes.value_or(0),
          "0 to 8");
  Require(!minimumScale || Between(*minimumScale, 1e-6, 1e6), "minimum scale", minimumScale.value_or(0),
          "1e-6 to 1e6 mm");
  Require(!maximumScale || Between(*maximumScale, minimumScale.value_or(1e-6), 1e6), "maximum scale",
          maximumScale.value_or(0), "at least the minimum scale, at most 1e6 mm");
  Require(densification.interval >= 0, "densification interval", densification.interval, "0 (never) or more");
  Require(Between(densification.percentile, 0, 100), "densification percentile", densification.percentile, "0 to 100");
}

void ApplyPreset(const std::string& name, TrainerOptions& options)
{
  if (name != "fidelity" && name != "texture")
  {
    throw Error("Trainer: there is no preset \"" + name.substr(0, 60) + "\"; it is fidelity or texture.");
  }
  // Where the place of speckle cannot be known, the least error is a smooth picture. The contrast loss asks for grains
  // of the right strength wherever they lie.
  options.keepContrast = name == "texture";
  options.loss = options.keepContrast ? Loss::Parse("l1+30*contrast") : Loss{};
  options.finalLoss.reset();
}

}  // namespace bigus
