// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The terms of the loss that look at whole images, over the intensities of a batch. Private to Cuda.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "CudaFrames.h"
#include "SpectrumKernels.h"
#include "Windows.h"
#include "Workspace.h"

namespace bigus::cuda
{

class CudaImageLosses
{
public:
  CudaImageLosses(Workspace& work, const CudaFrames& frames) : work_(work), frames_(frames) {}

  /// Room for a batch of so many pixels.
  void MakeRoom(std::size_t pixels)
  {
    work_.Grow(intensities_, pixels, "images", kSmallerBatch);
    work_.Grow(others_, pixels, "images", kSmallerBatch);
  }
  float* Intensities() { return intensities_.data(); }  ///< [views][height][width]
  float* Others() { return others_.data(); }            ///< the same: what these terms add to dL/dI

  /// The loss of all these terms; sets Others(). `batch` are the frames on the device.
  double Evaluate(const int* batch, const std::vector<int>& frames, const Loss& loss)
  {
    const double windows = Windows(batch, static_cast<int>(frames.size()), loss);
    return windows + Spectrum(batch, frames, loss);
  }

  std::size_t Bytes() const
  {
    return intensities_.Bytes() + others_.Bytes() + slopes_.Bytes() + differences_.Bytes() + spectrum_.Bytes();
  }

private:
  /// dL/dI of the terms that look at windows into others_; returns their loss.
  double Windows(const int* batch, int views, const Loss& loss)
  {
    const Sweep& sweep = *frames_.GetSweep();
    if (loss.dssim == 0 && loss.contrast == 0)
    {
      others_.Clear(work_.stream);
      return 0;
    }
    WindowTask task{};
    task.frames = batch;
    task.sweep = frames_.View();
    const std::array<double, kSsimTaps> kernel = SsimKernel();
    std::copy(kernel.begin(), kernel.end(), task.kernel);
    task.dssim = static_cast<float>(loss.dssim);
    task.contrast = static_cast<float>(loss.contrast);
    task.share = static_cast<float>(1.0 / (static_cast<double>(frames_.LossOfImages().CountedWindows()) * views));
    task.windows = frames_.Windows();
    task.across = sweep.width - kSsimTaps + 1;
    task.down = sweep.height - kSsimTaps + 1;
    work_.Grow(slopes_, static_cast<std::size_t>(views) * 3 * task.across * task.down, "slopes", kSmallerBatch);
    const auto blocks = [](int width, int height)
    {
      const auto up = [](int n) { return static_cast<std::size_t>((n + kWindowSide - 1) / kWindowSide); };
      return up(width) * up(height);
    };
    const std::size_t windows = blocks(task.across, task.down);
    work_.Grow(work_.losses, windows * views, "losses", kSmallerBatch);
    task.intensities = intensities_.data();
    task.slopes = slopes_.data();
    task.others = others_.data();
    task.losses = work_.losses.data();
    Launch("a loss of windows", FindSlopes, windows, views, kWindowThreads, work_.stream, task);
    Launch("a loss of windows", SpreadSlopes, blocks(sweep.width, sweep.height), views, kWindowThreads, work_.stream,
           task);
    return work_.Sum(work_.losses.data(), windows * views);
  }

  /// Adds dL/dI of the focal frequency loss to others_; returns the loss.
  double Spectrum(const int* batch, const std::vector<int>& frames, const Loss& loss)
  {
    const Sweep& sweep = *frames_.GetSweep();
    if (loss.ffl == 0)
    {
      return 0;
    }
    const FourierLibrary* library = FourierLibrary::Find();
    if (!library)
    {
      return SpectrumOnHost(frames, loss);
    }
    const int width = sweep.width, height = sweep.height, views = static_cast<int>(frames.size());
    const std::size_t pixels = sweep.PixelsPerFrame();
    if (!fourier_ || !fourier_->IsFor(width, height, views))
    {
      fourier_.reset();
      fourier_ = std::make_unique<Fourier>(*library, width, height, views, work_.stream);
    }
    work_.Grow(differences_, pixels * views, "images", kSmallerBatch);
    work_.Grow(spectrum_, static_cast<std::size_t>(views) * height * (width / 2 + 1), "spectra", kSmallerBatch);
    work_.Grow(work_.losses, views, "losses", kSmallerBatch);
    const double counted = static_cast<double>(std::max<std::size_t>(frames_.CountedPixels(), 1));
    const SpectrumTask task{batch,
                            frames_.View(),
                            static_cast<float>(loss.ffl / (counted * views)),
                            intensities_.data(),
                            differences_.data(),
                            spectrum_.data(),
                            others_.data(),
                            work_.losses.data()};
    const std::size_t blocks = (pixels + kPixelThreads - 1) / kPixelThreads;
    Launch("a loss of the spectrum", FindDifferences, blocks, views, kPixelThreads, work_.stream, task);
    fourier_->Forward(differences_.data(), reinterpret_cast<float*>(spectrum_.data()));
    Launch("a loss of the spectrum", WeighSpectrum, 1, views, kSumThreads, work_.stream, task);
    fourier_->Backward(reinterpret_cast<float*>(spectrum_.data()), differences_.data());
    Launch("a loss of the spectrum", AddSpectrum, blocks, views, kPixelThreads, work_.stream, task);
    return work_.Sum(work_.losses.data(), views);
  }

  /// The same where cuFFT is not installed: images go to the host and back.
  double SpectrumOnHost(const std::vector<int>& frames, const Loss& loss)
  {
    const Sweep& sweep = *frames_.GetSweep();
    Loss spectrum;
    spectrum.l1 = 0;
    spectrum.ffl = loss.ffl;
    const std::size_t pixels = sweep.PixelsPerFrame();
    std::vector<float> images(intensities_.size()), truth(pixels), others(intensities_.size());
    intensities_.Download(images.data(), 0, images.size(), work_.stream);
    others_.Download(others.data(), 0, others.size(), work_.stream);
    double sum = 0;
    for (std::size_t f = 0; f < frames.size(); ++f)
    {
      sweep.CopyFrame(frames[f], truth.data());
      sum += frames_.LossOfImages().Evaluate(spectrum, 1.0 / static_cast<double>(frames.size()),
                                             images.data() + f * pixels, truth.data(), sweep.width,
                                             others.data() + f * pixels);
    }
    others_.Upload(others.data(), others.size(), work_.stream);
    return sum;
  }

  Workspace& work_;
  const CudaFrames& frames_;
  DeviceArray<float> intensities_, others_, slopes_, differences_;
  DeviceArray<float2> spectrum_;
  std::unique_ptr<Fourier> fourier_;  // of the last batch's size
};

}  // namespace bigus::cuda
