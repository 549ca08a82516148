// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The frames to train on, on the device: pixels in their own type, which of them count, and the cameras. Private to Cuda.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "Core/Engine/BlockField.h"
#include "Core/Engine/Checks.h"
#include "Core/Engine/ImageLoss.h"
#include "Workspace.h"

namespace bigus::cuda
{

class CudaFrames
{
public:
  explicit CudaFrames(Workspace& work) : work_(work) {}

  /// See Engine::SetFrames.
  void Set(std::shared_ptr<const Sweep> sweep)
  {
    sweep->ValidateLayout();
    const std::size_t pixels = sweep->PixelsPerFrame(), all = pixels * sweep->NumberOfFrames();
    const bool bytes = sweep->pixelType == Sweep::PixelType::UInt8;
    work_.Grow(bytes_, bytes ? all : 0, "frames", kFewerFrames);
    work_.Grow(floats_, bytes ? 0 : all, "frames", kFewerFrames);
    if (bytes)
    {
      bytes_.Upload(static_cast<const std::uint8_t*>(sweep->pixels.get()), all, work_.stream);
    }
    else
    {
      floats_.Upload(static_cast<const float*>(sweep->pixels.get()), all, work_.stream);
    }
    const std::vector<std::uint8_t> counted = bigus::CountedPixels(*sweep);
    work_.Grow(counted_, counted.size(), "frames", kFewerFrames);
    counted_.Upload(counted.data(), counted.size(), work_.stream);
    countedPixels_ = counted.empty() ? pixels : static_cast<std::size_t>(std::count(counted.begin(), counted.end(), 1));
    imageLoss_.emplace(sweep->width, sweep->height, counted);
    const std::vector<std::uint8_t>& windows = imageLoss_->Windows();
    work_.Grow(windows_, windows.size(), "frames", kFewerFrames);
    windows_.Upload(windows.data(), windows.size(), work_.stream);
    sweep_ = std::move(sweep);
    ForgetCameras();
    work_.step.Forget();
  }

  /// As kernels see them.
  Frames View() const
  {
    return {sweep_->width, sweep_->height, bytes_.size() > 0 ? bytes_.data() : nullptr, floats_.data(),
            counted_.size() > 0 ? counted_.data() : nullptr};
  }

  /// One a frame; uploaded where the sweep or the beam is another than the last time.
  const Camera* Cameras(const Beam& beam)
  {
    if (!std::exchange(camerasAreStale_, false))
    {
      return cameras_.data();
    }
    std::vector<Camera> cameras;
    for (int frame = 0; frame < sweep_->NumberOfFrames(); ++frame)
    {
      cameras.push_back(CameraOf(sweep_->Plane(frame), beam));
    }
    work_.Grow(cameras_, cameras.size(), "poses", kFewerFrames);
    cameras_.Upload(cameras.data(), cameras.size(), work_.stream);
    return cameras_.data();
  }

  void ForgetCameras() { camerasAreStale_ = true; }

  const std::shared_ptr<const Sweep>& GetSweep() const { return sweep_; }
  std::size_t CountedPixels() const { return countedPixels_; }
  const ImageLoss& LossOfImages() const { return *imageLoss_; }
  const std::uint8_t* Windows() const { return windows_.size() > 0 ? windows_.data() : nullptr; }
  std::size_t Bytes() const { return cameras_.Bytes(); }

private:
  Workspace& work_;
  std::shared_ptr<const Sweep> sweep_;
  std::size_t countedPixels_ = 0;
  bool camerasAreStale_ = true;
  std::optional<ImageLoss> imageLoss_;  // of the frames' size and mask
  DeviceArray<std::uint8_t> bytes_, counted_, windows_;
  DeviceArray<float> floats_;
  DeviceArray<Camera> cameras_;
};

}  // namespace bigus::cuda
