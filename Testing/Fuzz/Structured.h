// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What lies behind the parsers, from numbers in place of bytes: sweeps that are inspected, whose poses are corrected, that
// are trained on for two steps and seen at a plane; fields that are moved and rendered by every engine; and checkpoints of a
// training, forged in a few places, that go on. They may be refused by an Error; what is not has finite pixels.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Core/Deciding/PoseCorrection.h"
#include "Core/Engine/Engine.h"
#include "Core/Model/Error.h"
#include "Core/Model/FieldTransform.h"
#include "Core/Numerics/Checksum.h"
#include "Core/Trainer/Trainer.h"

namespace bigus::fuzz
{

/// Numbers made of bytes, zeros when they are used up.
class Numbers
{
public:
  explicit Numbers(std::string bytes)
      : bytes_(std::move(bytes)), draw_(Checksum().Add(bytes_.data(), bytes_.size()).Value())
  {
  }

  int Byte() { return at_ < bytes_.size() ? static_cast<unsigned char>(bytes_[at_++]) : 0; }

  /// From 0 to `count` - 1.
  int Below(int count) { return (Byte() + 256 * Byte()) % count; }

  /// True for one input of so many, by a checksum of all the bytes: what takes long. A byte of its own would be copied into
  /// nearly every input, because who comes there sees more.
  bool Rarely(int inputs)
  {
    draw_ = draw_ * 6364136223846793005u + 1442695040888963407u;
    return (draw_ >> 33) % static_cast<unsigned>(inputs) == 0;
  }

  /// Most are `usual` and near it; some are what programs stumble over.
  double Near(double usual)
  {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    constexpr double kOdd[] = {
        0,    -1,    1,     1e-300, 1e-12,        1e-6,      1e6,        1e9,
        1e12, 1e300, -1e12, -1e300, 2147483648.0, kInfinity, -kInfinity, std::numeric_limits<double>::quiet_NaN()};
    const int kind = Byte();
    return kind < 6 ? kOdd[Byte() % 16] : kind < 64 ? usual + (Byte() - 128) / 64.0 : usual;
  }

private:
  std::string bytes_;
  std::uint64_t draw_;
  std::size_t at_ = 0;
};

/// Three rows of an affine matrix.
inline Eigen::Matrix4d MatrixOf(Numbers& numbers, const Eigen::Matrix4d& usual)
{
  Eigen::Matrix4d matrix = usual;
  for (int row = 0; row < 3; ++row)
  {
    for (int column = 0; column < 4; ++column)
    {
      matrix(row, column) = numbers.Near(usual(row, column));
    }
  }
  return matrix;
}

inline std::shared_ptr<Sweep> SweepOf(Numbers& numbers)
{
  auto sweep = std::make_shared<Sweep>();
  const bool isLarge = numbers.Rarely(32);
  const int side = isLarge ? 24 : 6;
  sweep->width = 1 + numbers.Below(side);
  sweep->height = 1 + numbers.Below(side);
  const int frames = 1 + numbers.Below(isLarge ? 10 : 5);
  const bool isTimed = numbers.Below(2) == 1, isFloat = numbers.Below(2) == 1;
  for (int frame = 0; frame < frames; ++frame)
  {
    Eigen::Matrix4d usual = Eigen::Vector4d(0.4, 0.4, 0.4, 1).asDiagonal();
    usual(2, 3) = 0.5 * frame;
    sweep->imageToReference.push_back(MatrixOf(numbers, usual));
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

/// Twelve Gaussians in one place, at which parsers' planes and transforms are tried.
inline const GaussianField& UsualField()
{
  static const GaussianField field = []
  {
    Numbers numbers(std::string("\x0c\0", 2) + std::string(3000, '\xff'));
    return FieldOf(numbers);
  }();
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

/// The same of the usual field at a few of the planes that a file gave, but for large ones.
inline std::string WrongSlices(const std::vector<SlicePlane>& planes)
{
  constexpr std::size_t kMostPlanes = 4, kMostPixels = 4096;
  std::string wrong;
  for (std::size_t k = 0; k < std::min(planes.size(), kMostPlanes); ++k)
  {
    planes[k].Validate("plane");
    wrong += planes[k].NumberOfPixels() <= kMostPixels ? WrongPictures(UsualField(), planes[k], "cpu") : "";
  }
  return wrong;
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

/// Inspects, corrects poses, trains for two steps and renders. What is wrong; nothing where the sweep is refused.
inline std::optional<std::string> TrySweep(const std::string& bytes)
{
  Numbers numbers(bytes);
  const std::shared_ptr<const Sweep> sweep = SweepOf(numbers);
  TrainerOptions options;
  options.engine = numbers.Below(2) == 1 ? "cpu" : "cpu-double";
  options.automatic = numbers.Rarely(32);
  options.poseSmoothing = numbers.Rarely(32);
  options.gaussians = numbers.Rarely(16) ? 40 : 6;
  if (!numbers.Rarely(4))
  {
    options.virtualPlanes = 0;
  }
  options.iterations = 2;
  options.holdOut = numbers.Below(2) == 1 ? 3 : 0;
  const SlicePlane plane = PlaneOf(numbers);
  const bool isCorrected = numbers.Rarely(64);
  std::string wrong;
  const bool isAccepted = IsAccepted(
      [&]
      {
        if (isCorrected)
        {
          sweep->Validate();
          AtCorrectedPoses(*sweep, CorrectPoses(*sweep, AllFrames(*sweep))).Validate();
        }
        const TrainingResult result = Train(sweep, options);
        result.field.Validate();
        wrong = WrongPictures(result.field, plane, options.engine);
      });
  return isAccepted ? std::optional<std::string>(wrong) : std::nullopt;
}

/// Moves, or not, and renders by every engine. What is wrong; nothing where the field, its transform or the plane is refused.
inline std::optional<std::string> TryField(const std::string& bytes)
{
  Numbers numbers(bytes);
  GaussianField field = FieldOf(numbers);
  const SlicePlane plane = PlaneOf(numbers);
  const bool isMoved = numbers.Below(2) == 1;
  std::string wrong;
  const bool isAccepted = IsAccepted(
      [&]
      {
        field.Validate();
        if (isMoved)
        {
          field = Transformed(std::move(field), MatrixOf(numbers, Eigen::Matrix4d::Identity()));
          field.Validate();
        }
        plane.Validate("plane");
        for (const char* const engine : {"cpu", "cpu-double", "reference"})
        {
          wrong += WrongPictures(field, plane, engine);
        }
      });
  return isAccepted ? std::optional<std::string>(wrong) : std::nullopt;
}

/// A small training and every state that it saved: in trials of what it decides, when all is decided, and in its own loop.
struct SmallTraining
{
  std::shared_ptr<const Sweep> sweep;
  TrainerOptions options;
  std::vector<std::string> states;

  static const SmallTraining& Get()
  {
    static const SmallTraining training = []
    {
      SmallTraining made;
      // 6 x 5 pixels, 5 frames with times, bytes; usual poses.
      std::string bytes("\x05\0\x04\0\x04\0\x01\0\0\0", 10);
      bytes += std::string(5 * 13, '\xff');
      for (int pixel = 0; pixel < 6 * 5 * 5; ++pixel)
      {
        bytes += static_cast<char>(40 + 37 * pixel % 200);
      }
      Numbers numbers(bytes);
      made.sweep = SweepOf(numbers);
      made.options.engine = "cpu";
      made.options.iterations = 6;
      made.options.maximumGaussians = 16;
      Checkpoints checkpoints;
      checkpoints.interval = 0;
      checkpoints.save = [&made](const std::string& state) { made.states.push_back(state); };
      Train(made.sweep, made.options, nullptr, {}, checkpoints);
      return made;
    }();
    return training;
  }
};

/// A checkpoint with one to four places changed. Mostly its size and checksum are right, as who means harm would make them.
inline std::string Forged(std::string state, Numbers& numbers)
{
  constexpr std::size_t kSizeAt = 16, kChecksumAt = 24, kBodyAt = 32;
  constexpr std::uint64_t kCounts[] = {0, 1, 255, std::uint64_t(1) << 31, std::uint64_t(1) << 61, UINT64_MAX};
  const bool isRight = numbers.Below(16) != 1;
  for (int left = 1 + numbers.Below(4); left > 0; --left)
  {
    const int span = static_cast<int>(state.size() - kBodyAt - sizeof(double));
    const std::size_t at = kBodyAt + static_cast<std::size_t>(numbers.Below(span));
    const int kind = numbers.Below(5), length = 1 + numbers.Below(16);
    const double number = numbers.Near(1);
    const std::uint64_t count = kCounts[numbers.Below(6)];
    if (kind == 0)
    {
      std::memcpy(&state[at], &number, sizeof(number));
    }
    else if (kind == 1)
    {
      std::memcpy(&state[at], &count, sizeof(count));
    }
    else if (kind == 2)
    {
      state.erase(at, static_cast<std::size_t>(length));
    }
    else if (kind == 3)
    {
      state.insert(at, state.substr(at, static_cast<std::size_t>(length)));
    }
    else
    {
      state[at] = static_cast<char>(numbers.Byte());
    }
  }
  if (isRight)
  {
    const std::uint64_t size = state.size() - kBodyAt, sum = Checksum().Add(&state[kBodyAt], size).Value();
    std::memcpy(&state[kSizeAt], &size, sizeof(size));
    std::memcpy(&state[kChecksumAt], &sum, sizeof(sum));
  }
  return state;
}

/// Goes on from a forged checkpoint for a few steps. What is wrong; nothing where it is refused.
inline std::optional<std::string> TryCheckpoint(const std::string& bytes)
{
  Numbers numbers(bytes);
  const SmallTraining& training = SmallTraining::Get();
  Checkpoints checkpoints;
  checkpoints.resume = Forged(training.states[numbers.Below(static_cast<int>(training.states.size()))], numbers);
  const SlicePlane plane = PlaneOf(numbers);
  const bool isStopped = numbers.Rarely(8);  // which takes more steps than going on
  std::string wrong;
  const bool isAccepted = IsAccepted(
      [&]
      {
        int calls = 4;
        const GaussianField field = Train(
                                        training.sweep, training.options, nullptr,
                                        [&](const TrainingProgress&) { return !isStopped || --calls > 0; }, checkpoints)
                                        .field;
        field.Validate();
        plane.Validate("plane");
        wrong = WrongPictures(field, plane, training.options.engine);
      });
  return isAccepted ? std::optional<std::string>(wrong) : std::nullopt;
}

}  // namespace bigus::fuzz
