// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Made-up fields, planes and passes of known size, and what engines are measured against on them. Needs Core
// alone: `bigus-bench` and the benchmarks of Testing share it. See Workloads.md.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Formula/Splat.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"

namespace bigus::bench
{

/// Side of a pixel of every made-up plane, mm.
constexpr double kWorkloadPixel = 0.25;

/// How large footprints are: the three standard deviations of a Gaussian lie evenly between these, in pixels.
struct FootprintSize
{
  const char* name;
  double smallest, largest;
};
constexpr FootprintSize kPixelSized{"pixel-sized", 1.0, 1.5};
constexpr FootprintSize kFourPixels{"4-pixel", 3.2, 4.8};

/// Gaussians of random turns, spread evenly over a box around the origin. A fifth of them is negative. The
/// mean of S is 1, or lower where Gaussians are so sparse that their mean |r| would exceed 1.
struct MadeUpField
{
  std::size_t gaussians = 140000;
  FootprintSize size = kPixelSized;
  Eigen::Vector3d box{560, 560, 160};  ///< pixels
  std::uint64_t seed = 1;
};

/// The field whose box holds planes of `width` x `width` pixels with 24 pixels to spare, 160 pixels deep.
MadeUpField FieldAround(int width, std::size_t gaussians, const FootprintSize& size);

/// As many Gaussians at the density of `field`, in a box larger in all three directions: a plane that lies
/// inside sees as many of them.
MadeUpField Grown(const MadeUpField& field, std::size_t gaussians);

/// Throws nothing but std::bad_alloc. The same seed gives the same bits everywhere.
GaussianField MakeField(const MadeUpField& description);

/// Through the middle of the field; axial, or oblique: 8 and 5 degrees about its two sides, so that every
/// pixel stays inside a box of FieldAround(512, ...).
SlicePlane MakePlane(int width, bool oblique);

/// A pass over a made-up sweep: parallel frames one pixel apart that show another field than the one trained.
struct TrainingPass
{
  GaussianField field;
  std::shared_ptr<const Sweep> sweep;
  std::vector<std::vector<int>> batches;  ///< every frame once, in a random order
  LearningRates rates;                    ///< the Trainer's
  ParameterLimits limits;                 ///< the Trainer's
  Accuracy accuracy;                      ///< the Trainer's
};
TrainingPass MakeTrainingPass(std::size_t gaussians, int frames, int width, int batch);

/// What anyone would write first: project in float, test the slab, then one std::exp for each pixel of a box.
/// A footprint ends by the rule of the CPU engine (ShareTolerance in CpuEngine.cxx). Compiled as everything
/// else (-O3), no SIMD by hand.
class PlainRenderer
{
public:
  explicit PlainRenderer(const GaussianField& field);

  /// Intensities. With more than one thread, each projects its share of the Gaussians, then draws its share
  /// of the rows.
  void Render(const SlicePlane& plane, double tolerance, int threads, std::vector<float>& image);

  /// Of the last picture: footprints that lie in the plane, and the pixels of their boxes.
  std::size_t Splats() const;
  std::size_t Pairs() const;

private:
  struct Box
  {
    Splat<float> splat;
    float value, logPeak;
    int columnBegin, columnEnd, rowBegin, rowEnd;
  };

  bool InSlab(std::size_t i, const View<float>& view, float logBound) const;
  static bool Clip(Box& box, const SlicePlane& plane, float logBound);

  std::vector<Gaussian<float>> gaussians_;
  std::vector<float> logMagnitude_;     ///< ln |r|
  std::vector<float> largestVariance_;  ///< mm^2
  Eigen::Vector3d origin_;
  Beam beam_;
  TransferFunction transfer_;
  std::vector<std::vector<Box>> boxes_;  ///< one list a thread
};

/// Different pixels of a plane, by seed: `row * width + column`.
std::vector<std::size_t> SamplePixels(const SlicePlane& plane, std::size_t count, std::uint64_t seed);

/// Intensities at these pixels in double, every Gaussian at every pixel: what the reference engine computes.
std::vector<double> ReferenceIntensities(const GaussianField& field, const SlicePlane& plane,
                                         const std::vector<std::size_t>& pixels);

/// |I - I_reference| over the sampled pixels.
struct ErrorStatistics
{
  double max = 0, rms = 0, p999 = 0;  ///< p999: 99.9th percentile
};
ErrorStatistics CompareWith(const std::vector<double>& reference, const std::vector<std::size_t>& pixels,
                            const std::vector<float>& image);

/// The CPU engine's footprint kernel alone: 40000 random splats of standard deviation `sigma` pixels (times
/// and over 1.15 along two axes of random direction), boxes of three standard deviations, on 640 x 480
/// pixels.
class KernelRun
{
public:
  explicit KernelRun(double sigma, std::size_t splats = 40000);
  ~KernelRun();
  void Run();
  std::size_t Splats() const;
  std::size_t Pairs() const;  ///< pixels of all boxes

private:
  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace bigus::bench
