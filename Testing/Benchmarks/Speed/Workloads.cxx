// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Workloads.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <thread>
#include <unordered_set>

#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/MortonOrder.h"
#include "Core/Engine/Packing.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Random.h"

namespace bigus::bench
{
namespace
{

constexpr int kMargin = 24;  // pixels by which a field reaches beyond its planes
constexpr int kDepth = 160;  // pixels: as many frames as a training pass has

/// A turn, all turns alike likely (Shoemake).
Eigen::Vector4d RandomTurn(RandomNumbers& random)
{
  const double u = random.Uniform(0, 1), a = random.Uniform(0, 2 * kPi), b = random.Uniform(0, 2 * kPi);
  const double p = std::sqrt(1 - u), q = std::sqrt(u);
  return {q * std::cos(b), p * std::sin(a), p * std::cos(a), q * std::sin(b)};
}

/// body(0) ... body(threads - 1), each by its own thread.
template <class Body>
void OnThreads(int threads, Body&& body)
{
  std::vector<std::thread> others;
  for (int t = 1; t < threads; ++t)
  {
    others.emplace_back([&body, t] { body(t); });
  }
  body(0);
  for (std::thread& other : others)
  {
    other.join();
  }
}

}  // namespace

MadeUpField FieldAround(int width, std::size_t gaussians, const FootprintSize& size)
{
  const double side = width + 2 * kMargin;
  return {gaussians, size, {side, side, kDepth}, 1};
}

MadeUpField Grown(const MadeUpField& field, std::size_t gaussians)
{
  MadeUpField grown = field;
  grown.gaussians = gaussians;
  grown.box *= std::cbrt(static_cast<double>(gaussians) / static_cast<double>(field.gaussians));
  return grown;
}

GaussianField MakeField(const MadeUpField& description)
{
  RandomNumbers random(description.seed);
  const double low = description.size.smallest, high = description.size.largest;
  // The mean over the box of sum r (2 pi)^(3/2) s_1 s_2 s_3, with four fifths of all r positive.
  const double meanSize = 0.5 * (low + high);
  const double cover = static_cast<double>(description.gaussians) / description.box.prod() * std::pow(2 * kPi, 1.5) *
                       std::pow(meanSize, 3);
  const double meanMagnitude = std::min(1.0, 1.0 / (0.6 * cover));

  GaussianField field;
  field.Resize(description.gaussians);
  field.beam.elevationSigma = 0.3;
  field.transfer.gamma = 0.35;  // I = 0.3 where S = 1
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    for (int axis = 0; axis < 3; ++axis)
    {
      field.means[i][axis] = kWorkloadPixel * description.box[axis] * random.Uniform(-0.5, 0.5);
      field.scales[i][axis] = kWorkloadPixel * random.Uniform(low, high);
    }
    field.rotations[i] = RandomTurn(random);
    const double sign = random.Uniform(0, 1) < 0.2 ? -1 : 1;
    field.reflectivities[i] = sign * meanMagnitude * random.Uniform(0.5, 1.5);
  }
  return field;
}

SlicePlane MakePlane(int width, bool oblique)
{
  const double u = oblique ? 8 * kPi / 180 : 0, v = oblique ? 5 * kPi / 180 : 0;
  SlicePlane plane;
  plane.width = plane.height = width;
  plane.columnStep = kWorkloadPixel * Eigen::Vector3d(std::cos(u), 0, std::sin(u));
  plane.rowStep = kWorkloadPixel * Eigen::Vector3d(-std::sin(u) * std::sin(v), std::cos(v), std::cos(u) * std::sin(v));
  plane.origin = -0.5 * (width - 1) * (plane.columnStep + plane.rowStep);
  return plane;
}

TrainingPass MakeTrainingPass(std::size_t gaussians, int frames, int width, int batch)
{
  TrainingPass pass;
  MadeUpField start = FieldAround(width, gaussians, kPixelSized);
  start.seed = 2;
  pass.field = MakeField(start);
  MadeUpField other = start;
  other.seed = 3;
  const GaussianField truth = MakeField(other);

  const auto engine = Engine::Create("cpu");
  engine->SetField(truth);
  auto sweep = std::make_shared<Sweep>();
  sweep->width = sweep->height = width;
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(sweep->PixelsPerFrame() * frames);
  sweep->pixels = std::shared_ptr<const void>(pixels, pixels->data());
  std::vector<float> image(sweep->PixelsPerFrame());
  double sum = 0;
  for (int frame = 0; frame < frames; ++frame)
  {
    SlicePlane plane = MakePlane(width, false);
    plane.origin += kWorkloadPixel * (frame - 0.5 * (frames - 1)) * plane.Normal();
    sweep->imageToReference.push_back(plane.ImageToReference());
    engine->Render(plane, ViewOutput::Intensity, image.data());
    for (std::size_t i = 0; i < image.size(); ++i)
    {
      (*pixels)[frame * image.size() + i] = static_cast<std::uint8_t>(std::lround(255.0f * image[i]));
      sum += image[i];
    }
  }
  pass.sweep = sweep;
  pass.field.transfer =
      TransferFunction::FromMeanIntensity(sum / static_cast<double>(std::max<std::size_t>(pixels->size(), 1)));

  std::vector<int> order(frames);
  std::iota(order.begin(), order.end(), 0);
  RandomNumbers random(4);
  for (std::size_t i = order.size(); i > 1; --i)
  {
    std::swap(order[i - 1], order[random.Below(i)]);
  }
  for (int first = 0; first < frames; first += batch)
  {
    pass.batches.emplace_back(order.begin() + first, order.begin() + std::min(first + batch, frames));
  }

  double magnitude = 0;
  for (double r : pass.field.reflectivities)
  {
    magnitude += std::abs(r) / static_cast<double>(gaussians);
  }
  pass.rates = {0.6 * kWorkloadPixel, 0.08, 0.08, 0.15 * magnitude};
  pass.limits.minimumScale = 0.25 * kWorkloadPixel;
  pass.limits.maximumScale = 48 * kWorkloadPixel;
  pass.accuracy.perSplat = true;
  return pass;
}

PlainRenderer::PlainRenderer(const GaussianField& field)
    : origin_(MiddleOf(field)), beam_(field.beam), transfer_(field.transfer)
{
  gaussians_ = PackField<float>(field, origin_);
  for (const Gaussian<float>& gaussian : gaussians_)
  {
    const Vector3<float>& s = gaussian.logScale;
    logMagnitude_.push_back(std::log(std::abs(gaussian.reflectivity)));
    largestVariance_.push_back(std::exp(2 * std::max({s.x, s.y, s.z})));
  }
}

/// mu_z^2 <= k^2 t, with t at its largest and k^2 = 2 ln(|r| / bound).
bool PlainRenderer::InSlab(std::size_t i, const View<float>& view, float logBound) const
{
  const float z = Dot(view.n, MultiplyAdd(-1.0f, view.origin, gaussians_[i].mean));
  return z * z <= 2 * (logMagnitude_[i] - logBound) * (largestVariance_[i] + view.elevationVariance);
}

/// The box of |U (p - m)|^2 <= k^2 with k^2 = 2 ln(peak / bound); false when nothing of it lies in the plane.
bool PlainRenderer::Clip(Box& box, const SlicePlane& plane, float logBound)
{
  const Splat<float>& s = box.splat;
  const float k = std::sqrt(std::max(2 * (box.logPeak - logBound), 0.0f));
  const float skew = s.u12 / s.u22;
  const float halfV = k / s.u22, halfU = k * std::sqrt(1 + skew * skew) / s.u11;
  const auto clamp = [](float value, int count)
  { return static_cast<int>(std::min(std::max(value, 0.0f), static_cast<float>(count))); };
  box.columnBegin = clamp(std::ceil(s.mu - halfU), plane.width);
  box.columnEnd = clamp(std::floor(s.mu + halfU) + 1, plane.width);
  box.rowBegin = clamp(std::ceil(s.mv - halfV), plane.height);
  box.rowEnd = clamp(std::floor(s.mv + halfV) + 1, plane.height);
  return k > 0 && box.columnBegin < box.columnEnd && box.rowBegin < box.rowEnd;
}

void PlainRenderer::Render(const SlicePlane& plane, double tolerance, int threads, std::vector<float>& image)
{
  const View<float> view = MakeView<float>(plane, beam_, origin_);
  image.resize(plane.NumberOfPixels());
  boxes_.resize(threads);
  const auto share = [threads](std::size_t count, int t) { return count * t / threads; };

  // Project, and count on tiles how many footprints overlap. Half of the tolerance on S goes to those that
  // stay below `floor` everywhere.
  const float whole = static_cast<float>(tolerance / transfer_.gamma);
  const float logFloor = std::log(whole / (2 * static_cast<float>(std::max<std::size_t>(gaussians_.size(), 1))));
  constexpr int kTile = 32;
  const int columns = (plane.width + kTile - 1) / kTile, rows = (plane.height + kTile - 1) / kTile;
  const auto forTiles = [columns](const Box& box, auto&& body)
  {
    for (int y = box.rowBegin / kTile; y <= (box.rowEnd - 1) / kTile; ++y)
    {
      for (int x = box.columnBegin / kTile; x <= (box.columnEnd - 1) / kTile; ++x)
      {
        body(y * columns + x);
      }
    }
  };
  std::vector<std::vector<int>> counts(threads, std::vector<int>(std::size_t(columns) * rows, 0));
  OnThreads(threads,
            [&](int t)
            {
              std::vector<Box> boxes;  // its own: neighbours in boxes_ share a cache line
              boxes.swap(boxes_[t]);
              boxes.clear();
              for (std::size_t i = share(gaussians_.size(), t); i < share(gaussians_.size(), t + 1); ++i)
              {
                if (!InSlab(i, view, logFloor))
                {
                  continue;
                }
                Box box;
                box.splat = Project(gaussians_[i], view).splat;
                box.value = gaussians_[i].reflectivity * box.splat.amplitude;
                box.logPeak = std::log(std::abs(box.value));
                if (Clip(box, plane, logFloor))
                {
                  boxes.push_back(box);
                  forTiles(box, [&counts, t](int tile) { ++counts[t][tile]; });
                }
              }
              boxes.swap(boxes_[t]);
            });

  // The other half is shared out among those that overlap.
  for (int t = 1; t < threads; ++t)
  {
    std::transform(counts[0].begin(), counts[0].end(), counts[t].begin(), counts[0].begin(), std::plus<int>());
  }
  OnThreads(threads,
            [&](int t)
            {
              std::vector<Box>& boxes = boxes_[t];
              std::size_t kept = 0;
              for (Box box : boxes)
              {
                int most = 1;
                forTiles(box, [&counts, &most](int tile) { most = std::max(most, counts[0][tile]); });
                if (Clip(box, plane, std::log(whole / (2 * static_cast<float>(most)))))
                {
                  boxes[kept++] = box;
                }
              }
              boxes.resize(kept);
            });

  OnThreads(threads,
            [&](int t)
            {
              const int firstRow = static_cast<int>(share(plane.height, t));
              const int lastRow = static_cast<int>(share(plane.height, t + 1));
              const auto begin = image.begin() + std::ptrdiff_t(firstRow) * plane.width;
              const auto end = image.begin() + std::ptrdiff_t(lastRow) * plane.width;
              std::fill(begin, end, 0.0f);
              for (const std::vector<Box>& boxes : boxes_)
              {
                for (const Box& box : boxes)
                {
                  const Splat<float>& s = box.splat;
                  for (int row = std::max(box.rowBegin, firstRow); row < std::min(box.rowEnd, lastRow); ++row)
                  {
                    float* out = image.data() + std::size_t(row) * plane.width;
                    const float dv = static_cast<float>(row) - s.mv;
                    const float shift = s.u12 * dv;
                    const float eta2 = s.u22 * dv;
                    for (int column = box.columnBegin; column < box.columnEnd; ++column)
                    {
                      const float eta1 = s.u11 * (static_cast<float>(column) - s.mu) + shift;
                      out[column] += box.value * std::exp(-0.5f * (eta1 * eta1 + eta2 * eta2));
                    }
                  }
                }
              }
              std::transform(begin, end, begin, [this](float s) { return transfer_.Intensity(s); });
            });
}

std::size_t PlainRenderer::Splats() const
{
  std::size_t count = 0;
  for (const std::vector<Box>& boxes : boxes_)
  {
    count += boxes.size();
  }
  return count;
}

std::size_t PlainRenderer::Pairs() const
{
  std::size_t count = 0;
  for (const std::vector<Box>& boxes : boxes_)
  {
    for (const Box& box : boxes)
    {
      count += std::size_t(box.columnEnd - box.columnBegin) * (box.rowEnd - box.rowBegin);
    }
  }
  return count;
}

std::vector<std::size_t> SamplePixels(const SlicePlane& plane, std::size_t count, std::uint64_t seed)
{
  RandomNumbers random(seed);
  count = std::min(count, plane.NumberOfPixels());
  std::unordered_set<std::size_t> taken;
  std::vector<std::size_t> pixels;
  while (pixels.size() < count)
  {
    const std::size_t pixel = random.Below(plane.NumberOfPixels());
    if (taken.insert(pixel).second)
    {
      pixels.push_back(pixel);
    }
  }
  return pixels;
}

std::vector<double> ReferenceIntensities(const GaussianField& field, const SlicePlane& plane,
                                         const std::vector<std::size_t>& pixels)
{
  const Eigen::Vector3d origin = MiddleOf(field);
  const View<double> view = MakeView<double>(plane, field.beam, origin);
  const std::vector<Gaussian<double>> gaussians = PackField<double>(field, origin);
  std::vector<Splat<double>> splats(gaussians.size());
  tbb::parallel_for(std::size_t(0), splats.size(),
                    [&](std::size_t i) { splats[i] = Project(gaussians[i], view).splat; });

  // Pixels are taken in groups, so that the splats are not read from memory once for every pixel.
  constexpr std::size_t kGroup = 64;
  constexpr double kZero = -746.0;  // below, std::exp in double is exactly 0: leaving it out changes no bit
  std::vector<double> intensities(pixels.size(), 0.0);
  tbb::parallel_for(std::size_t(0), (pixels.size() + kGroup - 1) / kGroup,
                    [&](std::size_t group)
                    {
                      const std::size_t first = group * kGroup;
                      const std::size_t last = std::min(first + kGroup, pixels.size());
                      for (std::size_t i = 0; i < splats.size(); ++i)
                      {
                        const Splat<double>& s = splats[i];
                        const double value = gaussians[i].reflectivity * s.amplitude;
                        if (value == 0)
                        {
                          continue;
                        }
                        for (std::size_t p = first; p < last; ++p)
                        {
                          const double du = static_cast<double>(pixels[p] % plane.width) - s.mu;
                          const double dv = static_cast<double>(pixels[p] / plane.width) - s.mv;
                          const double eta1 = s.u11 * du + s.u12 * dv, eta2 = s.u22 * dv;
                          const double exponent = -0.5 * (eta1 * eta1 + eta2 * eta2);
                          if (exponent > kZero)
                          {
                            intensities[p] += value * std::exp(exponent);
                          }
                        }
                      }
                      for (std::size_t p = first; p < last; ++p)
                      {
                        intensities[p] = field.transfer.Intensity(intensities[p]);
                      }
                    });
  return intensities;
}

ErrorStatistics CompareWith(const std::vector<double>& reference, const std::vector<std::size_t>& pixels,
                            const std::vector<float>& image)
{
  std::vector<double> errors(pixels.size());
  double squares = 0;
  for (std::size_t p = 0; p < pixels.size(); ++p)
  {
    const double error = std::abs(static_cast<double>(image[pixels[p]]) - reference[p]);
    // A pixel that is no number must not hide in a maximum.
    errors[p] = std::isnan(error) ? std::numeric_limits<double>::infinity() : error;
    squares += errors[p] * errors[p];
  }
  std::sort(errors.begin(), errors.end());
  ErrorStatistics out;
  if (!errors.empty())
  {
    out.max = errors.back();
    out.rms = std::sqrt(squares / static_cast<double>(errors.size()));
    out.p999 = errors[static_cast<std::size_t>(0.999 * static_cast<double>(errors.size() - 1))];
  }
  return out;
}

struct KernelRun::Data
{
  static constexpr int kWidth = 640, kHeight = 480;
  Kernels<float> kernels = KernelsOfThisMachine<float>();
  struct Block
  {
    SplatBuffer<float> splats;
    int count;
    float reflectivity[kBlock];
  };
  std::vector<std::unique_ptr<Block>> blocks;
  std::size_t splats = 0;
  std::size_t pairs = 0;
  std::vector<float> image = std::vector<float>(std::size_t(kWidth + kRowPadding) * kHeight, 0.0f);
};

KernelRun::KernelRun(double sigma, std::size_t splats) : data_(new Data)
{
  // Gaussians in the very plane, pixels of 1 mm, no beam: the engine's own projection makes the splats.
  SlicePlane plane;
  plane.width = Data::kWidth;
  plane.height = Data::kHeight;
  ProjectionTask<float> task{};
  task.view = MakeView<float>(plane, {0}, Eigen::Vector3d::Zero());
  task.columnEnd = plane.width;
  task.rowEnd = plane.height;
  task.leastMagnitude = 1;  // of every Gaussian
  task.slab = 1;
  task.tolerance = std::exp(-4.5f);  // where w falls below this: three standard deviations
  RandomNumbers random(5);
  const auto block = std::make_unique<GaussianBlock<float>>();
  // Neighbours follow each other, as in the engine.
  std::vector<Eigen::Vector3d> points(splats);
  for (Eigen::Vector3d& point : points)
  {
    const double u = random.Uniform(0, plane.width), v = random.Uniform(0, plane.height);
    point = {u, v, 0};
  }
  const std::vector<std::uint32_t> order = MortonOrder(points);
  for (std::size_t first = 0; first < splats; first += kBlock)
  {
    const int count = static_cast<int>(std::min<std::size_t>(kBlock, splats - first));
    for (int i = 0; i < count; ++i)
    {
      const double u = points[order[first + i]].x(), v = points[order[first + i]].y();
      const double angle = random.Uniform(0, kPi), c = std::cos(angle), d = std::sin(angle);
      const double scale[3] = {1.15 * sigma, sigma / 1.15, sigma};
      const double turn[4] = {std::cos(angle / 2), 0, 0, std::sin(angle / 2)};
      const double mean[3] = {u, v, 0};
      for (int k = 0; k < 3; ++k)
      {
        block->mean[k][i] = static_cast<float>(mean[k]);
        block->logScale[k][i] = static_cast<float>(std::log(scale[k]));
      }
      for (int k = 0; k < 4; ++k)
      {
        block->rotation[k][i] = static_cast<float>(turn[k]);
      }
      block->reflectivity[i] = static_cast<float>(random.Uniform(-1, 1));

      const double halfU = 3 * std::hypot(c * scale[0], d * scale[1]);
      const double halfV = 3 * std::hypot(d * scale[0], c * scale[1]);
      const auto pixels = [](double middle, double half, int size)
      {
        return std::max(std::min(std::floor(middle + half), size - 1.0) - std::max(std::ceil(middle - half), 0.0) + 1,
                        0.0);
      };
      data_->pairs += static_cast<std::size_t>(pixels(u, halfU, plane.width) * pixels(v, halfV, plane.height));
    }
    auto out = std::make_unique<Data::Block>();
    out->count = data_->kernels.projectBlock(*block, count, task, out->splats);
    std::copy_n(block->reflectivity, kBlock, out->reflectivity);
    data_->splats += static_cast<std::size_t>(out->count);
    data_->blocks.push_back(std::move(out));
  }
}

KernelRun::~KernelRun() = default;

void KernelRun::Run()
{
  const PixelRows<float> rows{data_->image.data(), 0, 0, std::size_t(Data::kWidth + kRowPadding)};
  for (const auto& block : data_->blocks)
  {
    data_->kernels.addFootprints(block->splats.Rows(block->count), block->reflectivity, 0, Data::kHeight, rows);
  }
}

std::size_t KernelRun::Splats() const
{
  return data_->splats;
}

std::size_t KernelRun::Pairs() const
{
  return data_->pairs;
}

}  // namespace bigus::bench
