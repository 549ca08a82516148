// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What lies behind the parsers, from numbers in place of bytes: sweeps that are inspected, trained on for two steps and
// seen at a plane, and fields that are rendered by every engine. They may be refused by an Error; what is not has finite
// pixels.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/Error.h"
#include "Core/Trainer/Trainer.h"

namespace bigus::fuzz
{

/// Numbers made of bytes, zeros when they are used up.
class Numbers
{
public:
  explicit Numbers(std::string bytes) : bytes_(std::move(bytes)) {}

  int Byte() { return at_ < bytes_.size() ? static_cast<unsigned char>(bytes_[at_++]) : 0; }

  /// From 0 to `count` - 1.
  int Below(int count) { return (Byte() + 256 * Byte()) % count; }

  /// Most are `usual` and near it; some are what programs stumble over.
  double Near(double usual)
  {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    constexpr double kOdd[] = {0,    -1,    1,     1e-300, 1e-12,        1e-6,      1e6,        1e9,
                               1e12, 1e300, -1e12, -1e300, 2147483648.0, kInfinity, -kInfinity, std::nan("")};
    const int kind = Byte();
    return kind < 6 ? kOdd[Byte() % 16] : kind < 64 ? usual + (Byte() - 128) / 64.0 : usual;
  }

private:
  std::string bytes_;
  std::size_t at_ = 0;
};

inline std::shared_ptr<Sweep> SweepOf(Numbers& numbers)
{
  auto sweep = std::make_shared<Sweep>();
  sweep->width = 1 + numbers.Below(24);
  sweep->height = 1 + numbers.Below(24);
  const int frames = 1 + numbers.Below(10);
  const bool isTimed = numbers.Below(2) == 1, isFloat = numbers.Below(2) == 1;
  for (int frame = 0; frame < frames; ++frame)
  {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    for (int row = 0; row < 3; ++row)
    {
      for (int column = 0; column < 4; ++column)
      {
        pose(row, column) = numbers.Near(row == column ? 0.4 : column == 3 && row == 2 ? 0.5 * frame : 0);
      }
    }
    sweep->imageToReference.push_back(pose);
    if (isTimed)
    {
      sweep->timestamps.push_back(numbers.Near(0.05 * frame));
    }
  }
  const std::size_t count = sweep->PixelsPerFrame() * frames;
  if (isFloat)
  {
    const auto pixels = std::make_shared<std::vector<float>>(count);
    for (float& pixel : *pixels)
    {
      pixel = static_cast<float>(numbers.Byte()) / 255;
    }
    (*pixels)[numbers.Below(static_cast<int>(count))] = static_cast<float>(numbers.Near(0.5) / 8);
    sweep->pixelType = Sweep::PixelType::Float32;
    sweep->pixels = std::shared_ptr<const void>(pixels, pixels->data());
    return sweep;
  }
  const auto pixels = std::make_shared<std::vector<std::uint8_t>>(count);
  for (std::uint8_t& pixel : *pixels)
  {
    pixel = static_cast<std::uint8_t>(numbers.Byte());
  }
  sweep->pixels = std::shared_ptr<const void>(pixels, pixels->data());
  return sweep;
}

inline SlicePlane PlaneOf(Numbers& numbers)
{
  SlicePlane plane;
  plane.width = 1 + numbers.Below(20);
  plane.height = 1 + numbers.Below(20);
  for (int k = 0; k < 3; ++k)
  {
    plane.columnStep[k] = numbers.Near(k == 0 ? 0.4 : 0);
    plane.rowStep[k] = numbers.Near(k == 1 ? 0.4 : 0);
    plane.origin[k] = numbers.Near(0);
  }
  return plane;
}

inline GaussianField FieldOf(Numbers& numbers)
{
  GaussianField field;
  field.Resize(static_cast<std::size_t>(numbers.Below(24)));
  field.transfer.gamma = numbers.Near(0.5);
  field.beam.elevationSigma = std::abs(numbers.Near(0));
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    for (int k = 0; k < 3; ++k)
    {
      field.means[i][k] = numbers.Near(2);
      field.scales[i][k] = numbers.Near(1.5);
      field.rotations[i][k + 1] = numbers.Near(0);
    }
    field.rotations[i][0] = numbers.Near(1);
    field.reflectivities[i] = numbers.Near(0.5);
  }
  return field;
}

/// What is wrong with the pictures of a field by an engine; empty: nothing.
inline std::string WrongPictures(const GaussianField& field, const SlicePlane& plane, const std::string& name)
{
  const auto engine = Engine::Create(name);
  engine->SetField(field);
  std::vector<float> image(plane.NumberOfPixels()), coverage(image.size());
  engine->Render(plane, ViewOutput::Intensity, image.data(), coverage.data());
  for (std::size_t pixel = 0; pixel < image.size(); ++pixel)
  {
    if (!(image[pixel] >= 0 && image[pixel] <= 1) || !std::isfinite(coverage[pixel]))
    {
      return name + ": pixel " + std::to_string(pixel) + " is " + std::to_string(image[pixel]) + ", its coverage " +
             std::to_string(coverage[pixel]);
    }
  }
  return {};
}

/// Calls `work`; false where it is refused.
inline bool IsAccepted(const std::function<void()>& work)
{
  try
  {
    work();
    return true;
  }
  catch (const Error&)
  {
    return false;
  }
}

/// Inspects, trains for two steps and renders. What is wrong; nothing where the sweep is refused.
inline std::optional<std::string> TrySweep(const std::string& bytes)
{
  Numbers numbers(bytes);
  const std::shared_ptr<const Sweep> sweep = SweepOf(numbers);
  TrainerOptions options;
  options.engine = numbers.Below(2) == 1 ? "cpu" : "cpu-double";
  options.automatic = numbers.Below(4) == 1;
  options.poseSmoothing = numbers.Below(2);
  options.gaussians = 40;
  options.iterations = 2;
  options.secondOrder = numbers.Below(2) == 1;
  options.holdOut = numbers.Below(2) == 1 ? 3 : 0;
  const SlicePlane plane = PlaneOf(numbers);
  std::string wrong;
  const bool isAccepted = IsAccepted(
      [&]
      {
        const TrainingResult result = Train(sweep, options);
        result.field.Validate();
        wrong = WrongPictures(result.field, plane, options.engine);
      });
  return isAccepted ? std::optional<std::string>(wrong) : std::nullopt;
}

/// Renders by every engine. What is wrong; nothing where the field or the plane is refused.
inline std::optional<std::string> TryField(const std::string& bytes)
{
  Numbers numbers(bytes);
  const GaussianField field = FieldOf(numbers);
  const SlicePlane plane = PlaneOf(numbers);
  std::string wrong;
  const bool isAccepted = IsAccepted(
      [&]
      {
        field.Validate();
        plane.Validate("plane");
        for (const char* const engine : {"cpu", "cpu-double", "reference"})
        {
          wrong += WrongPictures(field, plane, engine);
        }
      });
  return isAccepted ? std::optional<std::string>(wrong) : std::nullopt;
}

}  // namespace bigus::fuzz
