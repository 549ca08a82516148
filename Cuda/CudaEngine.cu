// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The CUDA engine: field, frames, optimizer state and scores stay on the device; a training step is a fixed row of
// kernels, and what comes back from it is one small structure.

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "Backward.h"
#include "Core/Engine/BlockField.h"
#include "Core/Engine/Checks.h"
#include "Core/Engine/ImageLoss.h"
#include "Core/Engine/MortonOrder.h"
#include "Core/Numerics/ConjugateGradients.h"
#include "CudaEngine.h"
#include "Spectrum.h"
#include "Vector.h"
#include "Windows.h"

namespace bigus
{
namespace cuda
{

constexpr char kFewerGaussians[] = "Use fewer Gaussians";
constexpr char kFewerPixels[] = "Render fewer pixels at a time";
constexpr char kFewerFrames[] = "Use fewer frames, or frames of fewer pixels";
constexpr char kSmallerBatch[] = "Use a smaller batch, or fewer Gaussians";

/// What kernels report.
struct Results
{
  unsigned long long used;     // splats of the last FindSplats
  unsigned long long guarded;  // updates, since the state was last reset
  double loss;
};

/// The optimizer's averages for a restructured field. Launched as (blocks, 1) of kBlock threads.
__global__ void __launch_bounds__(kBlock)
    Inherit(const std::int64_t* slots, std::size_t count, const AdamBlock<float>* from, AdamBlock<float>* to)
{
  const std::size_t slot = static_cast<std::size_t>(blockIdx.x) * kBlock + threadIdx.x;
  AdamBlock<float>& out = to[blockIdx.x];
  const std::int64_t parent = slot < count ? slots[slot] : -1;
  const AdamBlock<float>* in = parent >= 0 ? from + parent / kBlock : nullptr;
  const int i = threadIdx.x, k = static_cast<int>(parent % kBlock);
  for (int p = 0; p < kParametersPerGaussian; ++p)
  {
    out.first[p][i] = in ? in->first[p][k] : 0.0f;
    out.second[p][i] = in ? in->second[p][k] : 0.0f;
  }
  out.updates[i] = in ? in->updates[k] : 0.0f;
}

/// Reflectivities into a vector, or back. Launched as Inherit.
__global__ void __launch_bounds__(kBlock) CopyReflectivities(GaussianBlock<float>* gaussians, float* vector, bool back)
{
  float& inField = gaussians[blockIdx.x].reflectivity[threadIdx.x];
  float& inVector = vector[static_cast<std::size_t>(blockIdx.x) * kBlock + threadIdx.x];
  (back ? inField : inVector) = back ? inVector : inField;
}

/// Sums of |r|, a block each. Launched as Inherit.
__global__ void __launch_bounds__(kBlock) SumMagnitudes(const GaussianBlock<float>* gaussians, double* sums)
{
  const double sum = BlockSum<kBlock>(static_cast<double>(std::abs(gaussians[blockIdx.x].reflectivity[threadIdx.x])));
  if (threadIdx.x == 0)
  {
    sums[blockIdx.x] = sum;
  }
}

class Stream
{
public:
  Stream() { Check(cudaStreamCreate(&stream_), "creating a stream"); }
  ~Stream() { cudaStreamDestroy(stream_); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  operator cudaStream_t() const { return stream_; }

private:
  cudaStream_t stream_ = nullptr;
};

class CudaEngine final : public Engine
{
public:
  CudaEngine()
  {
    cudaDeviceProp properties;
    Check(cudaGetDeviceProperties(&properties, 0), "asking for the device");
    device_ = "CUDA (" + std::string(properties.name) + ", compute capability " + std::to_string(properties.major) +
              "." + std::to_string(properties.minor) + ")";
    Grow(results_, 1, "results", kFewerGaussians);
    results_.Clear(stream_);
    Grow(parameters_, 1, "parameters", kFewerGaussians);
  }

  std::string Device() const override { return device_; }

  void SetField(const GaussianField& field, const std::vector<int>* parents) override
  {
    field.Validate();
    if (field.Size() > std::numeric_limits<std::uint32_t>::max())
    {
      throw Error("CUDA engine: " + std::to_string(field.Size()) + " Gaussians are more than 2^32 - 1.");
    }
    std::vector<std::uint32_t> order = MortonOrder(field.means);
    const std::size_t blocks = NumberOfBlocks(field.Size());
    InheritAdam(order, blocks, parents);
    beam_ = field.beam;
    transfer_ = field.transfer;
    camerasAreStale_ = true;
    hasGradient_ = false;
    keepScores_ = false;
    step_.Forget();
    try
    {
      UploadField(field, order);
    }
    catch (...)
    {
      Grow(gaussians_, 0, "", "");  // rather no field than half of one
      order_.clear();
      throw;
    }
    order_ = std::move(order);
    Launch("measuring blocks", MeasureBlocks, blocks, 1, kBackwardThreads, stream_, DeviceField());
  }

  GaussianField GetField() const override
  {
    std::vector<GaussianBlock<float>> gaussians(gaussians_.size());
    std::vector<BlockPlace> places(places_.size());
    gaussians_.Download(gaussians.data(), 0, gaussians.size(), stream_);
    places_.Download(places.data(), 0, places.size(), stream_);
    GaussianField field;
    field.beam = beam_;
    field.transfer = transfer_;
    field.Resize(order_.size());
    tbb::parallel_for(
        std::size_t(0), order_.size(),
        [&](std::size_t slot)
        { UnpackGaussian(gaussians[slot / kBlock], slot % kBlock, places[slot / kBlock], order_[slot], field); });
    return field;
  }

  std::size_t FieldSize() const override { return order_.size(); }

  void SetAccuracy(const Accuracy& accuracy) override
  {
    accuracy_ = accuracy;
    step_.Forget();
  }

  void Render(const SlicePlane& plane, const Window& window, ViewOutput output, float* image, float* coverage) override
  {
    RenderPlanes(&plane, 1, window, output, image, coverage);
  }

  void RenderStack(const std::vector<SlicePlane>& planes, ViewOutput output, float* images, float* coverage) override
  {
    CheckStack(planes);
    for (std::size_t first = 0; first < planes.size();)
    {
      const Window window{0, 0, planes[first].width, planes[first].height};
      const std::size_t pixels = planes[first].NumberOfPixels();
      const std::size_t room = std::max<std::size_t>(kStackPixels / pixels, 1);
      const std::size_t count = std::min({planes.size() - first, room, kStackPlanes});
      RenderPlanes(planes.data() + first, static_cast<int>(count), window, output, images + first * pixels,
                   coverage ? coverage + first * pixels : nullptr);
      first += count;
    }
  }

  void SetFrames(std::shared_ptr<const Sweep> sweep) override
  {
    sweep->ValidateLayout();
    const std::size_t pixels = sweep->PixelsPerFrame(), all = pixels * sweep->NumberOfFrames();
    const bool bytes = sweep->pixelType == Sweep::PixelType::UInt8;
    Grow(bytes_, bytes ? all : 0, "frames", kFewerFrames);
    Grow(floats_, bytes ? 0 : all, "frames", kFewerFrames);
    if (bytes)
    {
      bytes_.Upload(static_cast<const std::uint8_t*>(sweep->pixels.get()), all, stream_);
    }
    else
    {
      floats_.Upload(static_cast<const float*>(sweep->pixels.get()), all, stream_);
    }
    const std::vector<std::uint8_t> counted = CountedPixels(*sweep);
    Grow(counted_, counted.size(), "frames", kFewerFrames);
    counted_.Upload(counted.data(), counted.size(), stream_);
    countedPixels_ = counted.empty() ? pixels : static_cast<std::size_t>(std::count(counted.begin(), counted.end(), 1));
    imageLoss_.emplace(sweep->width, sweep->height, counted);
    const std::vector<std::uint8_t>& windows = imageLoss_->Windows();
    Grow(windows_, windows.size(), "frames", kFewerFrames);
    windows_.Upload(windows.data(), windows.size(), stream_);
    sweep_ = std::move(sweep);
    camerasAreStale_ = true;
    step_.Forget();
  }

  double Backpropagate(const std::vector<int>& frames, const Loss& loss) override
  {
    Grow(gradient_, gaussians_.size(), "gradients", kFewerGaussians);
    const double value = Propagate(frames, loss, StepParameters(), false);
    hasGradient_ = true;
    return value;
  }

  void Step(const LearningRates& rates, const ParameterLimits& limits) override
  {
    if (!hasGradient_)
    {
      throw Error("CUDA engine: Step needs the gradient of a Backpropagate with the present field.");
    }
    PrepareAdam();
    StepParameters parameters;
    parameters.adam = AdamStep(rates, limits);
    parameters_.Upload(&parameters, 1, stream_);
    BackwardTask task{};
    task.field = DeviceField();
    task.gradient = gradient_.data();
    task.adam = adam_.data();
    task.parameters = parameters_.data();
    task.guarded = &results_.data()->guarded;
    Launch("a step", TakeStep, gaussians_.size(), 1, kBackwardThreads, stream_, task);
  }

  double TrainStep(const std::vector<int>& frames, const Loss& loss, const LearningRates& rates,
                   const ParameterLimits& limits) override
  {
    hasGradient_ = false;
    PrepareAdam();
    StepParameters parameters;
    parameters.adam = AdamStep(rates, limits);
    return Propagate(frames, loss, parameters, true);
  }

  std::uint64_t GuardedUpdates() const override { return ReadResults().guarded; }

  std::size_t MemoryUse() const override
  {
    return gaussians_.Bytes() + places_.Bytes() + sharpSlots_.Bytes() + sharp_.Bytes() + adam_.Bytes() +
           gradient_.Bytes() + scores_.Bytes() + cameras_.Bytes() + planes_.Bytes() + frames_.Bytes() + seen_.Bytes() +
           boxes_.Bytes() + groupBoxes_.Bytes() + splats_.Bytes() + overlaps_.Bytes() + images_.Bytes() +
           intensities_.Bytes() + others_.Bytes() + slopes_.Bytes() + differences_.Bytes() + spectrum_.Bytes() +
           losses_.Bytes() + rendered_.Bytes() + results_.Bytes() + parameters_.Bytes();
  }

  double SolveReflectivities(const std::vector<int>& frames, int iterations,
                             const std::function<bool(double)>& progress) override
  {
    CheckFrames(sweep_, frames);
    PrepareCameras();
    // One pass over the frames for the right-hand side and one for each iteration.
    const double steps = (iterations + 1.0) * static_cast<double>(frames.size());
    double done = 0;
    const std::size_t blocks = gaussians_.size(), slots = blocks * kBlock;
    DeviceVector r(slots, stream_);
    Launch("copying reflectivities", CopyReflectivities, blocks, 1, kBlock, stream_, gaussians_.data(), r.data(),
           false);
    SolveTask task{};
    task.tiles = TilesOfWindow({0, sweep_->width, 0, sweep_->height});
    task.sweep = DeviceFrames();
    task.gamma = static_cast<float>(transfer_.gamma);
    const double residual = ConjugateGradients(
        r, iterations,
        [&](const DeviceVector& x, bool withTarget)
        {
          std::optional<DeviceVector> out(std::in_place, slots, stream_);
          for (std::size_t first = 0; first < frames.size(); first += kSolveBatch)
          {
            const std::vector<int> batch(frames.begin() + first,
                                         frames.begin() + std::min(first + kSolveBatch, frames.size()));
            UploadBatch(batch);
            Grow(images_, batch.size() * sweep_->PixelsPerFrame(), "images", kSmallerBatch);
            task.vector = x.data();
            task.frames = frames_.data();
            task.withTarget = withTarget;
            task.images = images_.data();
            Repeat(
                [&]
                {
                  task.lists = FindVisible(cameras_.data(), static_cast<int>(batch.size()), sweep_->width,
                                           sweep_->height, task.tiles, FootprintsFor::Solving);
                  Launch("solving", SolveTiles, Warps(task.tiles), batch.size(), kForwardWarps * kWarp, stream_, task);
                  Launch("solving", GatherZeroth, blocks, 1, kBackwardThreads, stream_, task.lists, images_.data(),
                         sweep_->width, sweep_->height, out->data());
                });
            done += static_cast<double>(batch.size());
            if (progress && !progress(done / steps))
            {
              out.reset();
              return out;
            }
          }
          return out;
        });
    Launch("copying reflectivities", CopyReflectivities, blocks, 1, kBlock, stream_, gaussians_.data(), r.data(), true);
    Launch("measuring blocks", MeasureBlocks, blocks, 1, kBackwardThreads, stream_, DeviceField());
    // The needles' exact copies have the old reflectivities; shapes did not change, but float's are near enough.
    ForgetSharp();
    return residual;
  }

  FieldGradient GetGradient() const override
  {
    std::vector<GradientBlock<float>> gradient(hasGradient_ ? gradient_.size() : 0);
    gradient_.Download(gradient.data(), 0, gradient.size(), stream_);
    return GradientOf(gradient, order_);
  }

  Scores GetScores() const override
  {
    std::vector<ScoreBlock<float>> scores(keepScores_ ? scores_.size() : 0);
    scores_.Download(scores.data(), 0, scores.size(), stream_);
    return ScoresOf(scores, order_);
  }

  void ResetScores() override
  {
    Grow(scores_, gaussians_.size(), "scores", kFewerGaussians);
    scores_.Clear(stream_);
    step_.Forget();
    keepScores_ = true;
  }

private:
  static constexpr std::size_t kSolveBatch = 64;                     // frames held at once while solving
  static constexpr std::size_t kStackPixels = std::size_t(1) << 25;  // of a stack, rendered at once
  static constexpr std::size_t kStackPlanes = 64;                    // the same; their lists are held too

  /// One window of several planes of one size.
  void RenderPlanes(const SlicePlane* planes, int views, const Window& window, ViewOutput output, float* images,
                    float* coverage)
  {
    std::vector<Camera> cameras;
    std::vector<int> frames;
    for (int view = 0; view < views; ++view)
    {
      planes[view].Validate("slice plane");
      cameras.push_back(CameraOf(planes[view], beam_));
      frames.push_back(view);
    }
    const int width = planes[0].width, height = planes[0].height;
    CheckWindow(planes[0], window.firstColumn, window.firstRow, window.columns, window.rows);
    if (std::max(width, height) > kLargestImage)
    {
      throw Error("CUDA engine: a plane of " + std::to_string(width) + " x " + std::to_string(height) +
                  " pixels is larger than 16777216 along a side.");
    }
    const std::size_t pixels = static_cast<std::size_t>(window.columns) * window.rows * views;
    if (pixels == 0)
    {
      return;
    }
    Grow(planes_, cameras.size(), "planes", kFewerPixels);
    planes_.Upload(cameras.data(), cameras.size(), stream_);
    UploadBatch(frames);
    Grow(rendered_, coverage ? 2 * pixels : pixels, "slices", kFewerPixels);

    RenderTask task{};
    task.window = {window.firstColumn, window.firstColumn + window.columns, window.firstRow,
                   window.firstRow + window.rows};
    task.tiles = TilesOfWindow(task.window);
    task.intensity = output == ViewOutput::Intensity;
    task.gamma = static_cast<float>(transfer_.gamma);
    task.image = rendered_.data();
    task.coverage = coverage ? rendered_.data() + pixels : nullptr;
    Repeat(
        [&]
        {
          task.lists = FindVisible(planes_.data(), views, width, height, task.tiles, FootprintsFor::Rendering);
          Launch("rendering", RenderTiles, Warps(task.tiles), views, kForwardWarps * kWarp, stream_, task);
        });
    rendered_.Download(images, 0, pixels, stream_);
    if (coverage)
    {
      rendered_.Download(coverage, pixels, pixels, stream_);
    }
  }

  void UploadField(const GaussianField& field, const std::vector<std::uint32_t>& order)
  {
    const std::size_t blocks = NumberOfBlocks(order.size());
    std::vector<GaussianBlock<float>> gaussians(blocks);
    std::vector<BlockPlace> places(blocks);
    tbb::parallel_for(std::size_t(0), blocks,
                      [&](std::size_t b)
                      {
                        places[b] = PlaceOf(field, order, b);
                        PackBlock(field, order, b, places[b], gaussians[b]);
                      });
    std::vector<int> sharpSlots(blocks, -1);
    std::vector<GaussianBlock<double>> sharp;
    for (std::size_t b = 0; b < blocks; ++b)
    {
      if (HasNeedle(field, order, b, places[b].count))
      {
        sharpSlots[b] = static_cast<int>(sharp.size());
        sharp.emplace_back();
        PackBlock(field, order, b, places[b], sharp.back());
      }
    }
    const auto fill = [this](auto& array, const auto& from)
    {
      Grow(array, from.size(), "Gaussians", kFewerGaussians);
      array.Upload(from.data(), from.size(), stream_);
    };
    fill(gaussians_, gaussians);
    fill(places_, places);
    fill(sharpSlots_, sharpSlots);
    fill(sharp_, sharp);
  }

  Field DeviceField() const
  {
    return {static_cast<int>(gaussians_.size()), gaussians_.data(), places_.data(), sharpSlots_.data(), sharp_.data()};
  }

  Frames DeviceFrames() const
  {
    return {sweep_->width, sweep_->height, bytes_.size() > 0 ? bytes_.data() : nullptr, floats_.data(),
            counted_.size() > 0 ? counted_.data() : nullptr};
  }

  static bool HasNeedle(const GaussianField& field, const std::vector<std::uint32_t>& order, std::size_t b, int count)
  {
    for (int k = 0; k < count; ++k)
    {
      const Eigen::Vector3d& s = field.scales[order[b * kBlock + k]];
      if (s.maxCoeff() > 0.99 * kSharp * s.minCoeff())
      {
        return true;
      }
    }
    return false;
  }

  void ForgetSharp()
  {
    Check(cudaMemsetAsync(sharpSlots_.data(), 0xff, sharpSlots_.size() * sizeof(int), stream_), "clearing");
  }

  void InheritAdam(const std::vector<std::uint32_t>& order, std::size_t blocks, const std::vector<int>* parents)
  {
    if (!parents)
    {
      hasAdam_ = false;
      results_.Clear(stream_);
      return;
    }
    const std::vector<std::int64_t> slots = InheritedSlots(order_, order, *parents);
    if (!hasAdam_)
    {
      return;
    }
    DeviceArray<std::int64_t> inherited;
    inherited.Resize(slots.size(), "optimizer state", kFewerGaussians);
    inherited.Upload(slots.data(), slots.size(), stream_);
    DeviceArray<AdamBlock<float>> adam;
    adam.Resize(blocks, "optimizer state", kFewerGaussians);
    Launch("inheriting the optimizer's state", Inherit, blocks, 1, kBlock, stream_, inherited.data(), slots.size(),
           adam_.data(), adam.data());
    Check(cudaStreamSynchronize(stream_), "inheriting the optimizer's state");
    adam_ = std::move(adam);
    step_.Forget();
  }

  void PrepareAdam()
  {
    if (!hasAdam_)
    {
      Grow(adam_, gaussians_.size(), "optimizer state", kFewerGaussians);
      adam_.Clear(stream_);
      hasAdam_ = true;
    }
  }

  void PrepareCameras()
  {
    if (!std::exchange(camerasAreStale_, false))
    {
      return;
    }
    std::vector<Camera> cameras;
    for (int frame = 0; frame < sweep_->NumberOfFrames(); ++frame)
    {
      cameras.push_back(CameraOf(sweep_->Plane(frame), beam_));
    }
    Grow(cameras_, cameras.size(), "poses", kFewerFrames);
    cameras_.Upload(cameras.data(), cameras.size(), stream_);
  }

  void UploadBatch(const std::vector<int>& frames)
  {
    Grow(frames_, frames.size(), "batches", kSmallerBatch);
    frames_.Upload(frames.data(), frames.size(), stream_);
  }

  static Tiles TilesOfWindow(const Box& window)
  {
    const auto up = [](int pixel) { return (pixel + kTileSide - 1) / kTileSide; };
    const int column = window.columnBegin / kTileSide, row = window.rowBegin / kTileSide;
    return {column, row, up(window.columnEnd) - column, up(window.rowEnd) - row};
  }

  /// Thread blocks that render tiles.
  static std::size_t Warps(const Tiles& tiles) { return (tiles.Count() + kForwardWarps - 1) / kForwardWarps; }

  /// Room in an array; returns whether it has moved. A recorded step holds addresses, so it is worth nothing then.
  template <class T>
  bool Grow(DeviceArray<T>& array, std::size_t size, const char* what, const char* advice)
  {
    const bool moved = array.Resize(size, what, advice);
    if (moved)
    {
      step_.Forget();
    }
    return moved;
  }

  Results ReadResults() const
  {
    Results results;
    results_.Download(&results, 0, 1, stream_);
    return results;
  }

  /// Queues work that begins with FindVisible, as often as it takes until there is room for all splats: kernels do
  /// nothing when there is not. Returns what they report.
  template <class Enqueue>
  Results Repeat(Enqueue&& enqueue)
  {
    while (true)
    {
      enqueue();
      const Results results = ReadResults();
      if (results.used <= splats_.size())
      {
        return results;
      }
      Grow(splats_, results.used + results.used / 32, "footprints", kSmallerBatch);
    }
  }

  /// Room for what FindVisible and TrainTiles leave.
  void MakeRoom(int views, const OverlapGrid& overlaps, const Tiles& tiles)
  {
    const std::size_t blocks = gaussians_.size(), groups = (blocks + kGroup - 1) / kGroup;
    Grow(seen_, blocks * views, "lists", kSmallerBatch);
    Grow(boxes_, groups * kGroup * views, "lists", kSmallerBatch);
    Grow(groupBoxes_, groups * views, "lists", kSmallerBatch);
    Grow(overlaps_, static_cast<std::size_t>(views) * overlaps.columns * overlaps.rows, "counts", kSmallerBatch);
    if (Grow(losses_, std::max(tiles.Count() * views, blocks), "losses", kSmallerBatch))
    {
      losses_.Clear(stream_);  // summed even where there was no room for splats and nothing was rendered
    }
  }

  /// Queues the search for what the cameras of frames_ see in some tiles of their width x height images.
  Lists FindVisible(const Camera* cameras, int views, int width, int height, const Tiles& tiles, FootprintsFor purpose)
  {
    const std::size_t blocks = gaussians_.size(), groups = (blocks + kGroup - 1) / kGroup;
    const OverlapGrid grid = OverlapGrid::For(width, height);
    MakeRoom(views, grid, tiles);
    FindTask task{};
    task.truncation = Truncation::For(purpose, accuracy_.tolerance / transfer_.gamma, accuracy_.perSplat, order_.size(),
                                      purpose == FootprintsFor::Solving ? MeanMagnitude() : 0.0);
    task.overlaps = {overlaps_.data(), grid};
    task.field = DeviceField();
    task.cameras = cameras;
    task.frames = frames_.data();
    task.views = views;
    task.window = {tiles.columnBegin * kTileSide, (tiles.columnBegin + tiles.columns) * kTileSide,
                   tiles.rowBegin * kTileSide, (tiles.rowBegin + tiles.rows) * kTileSide};
    task.plane = {0, width, 0, height};
    task.direct = accuracy_.direct;
    if (task.truncation.isShared)
    {
      overlaps_.Clear(stream_);
      Launch("counting footprints", CountOverlaps, blocks, views, kBlock, stream_, task);
    }
    task.seen = seen_.data();
    task.boxes = boxes_.data();
    task.groupBoxes = groupBoxes_.data();
    task.groups = static_cast<int>(groups);
    task.splats = splats_.data();
    task.capacity = splats_.size();
    task.used = &results_.data()->used;
    Check(cudaMemsetAsync(task.used, 0, sizeof(*task.used), stream_), "clearing");
    Launch("finding footprints", FindSplats, blocks, 1, kBlock, stream_, task);
    Launch("finding footprints", FindGroups, groups, views, kGroup, stream_, task);
    return {views,          task.groups, seen_.data(),  boxes_.data(), groupBoxes_.data(),
            splats_.data(), task.used,   splats_.size()};
  }

  double Sum(const double* values, std::size_t count)
  {
    Launch("a sum", SumInOrder, 1, 1, kSumThreads, stream_, values, count, &results_.data()->loss);
    return ReadResults().loss;
  }

  /// Of the field's |r|; 1 where all are 0.
  double MeanMagnitude()
  {
    const std::size_t blocks = gaussians_.size();
    Launch("adding up reflectivities", SumMagnitudes, blocks, 1, kBlock, stream_, gaussians_.data(), losses_.data());
    const double sum = Sum(losses_.data(), blocks);
    return sum > 0 ? sum / static_cast<double>(order_.size()) : 1.0;
  }

  /// Forward and backward over a batch; with `step` the field moves, else the gradient is stored.
  double Propagate(const std::vector<int>& frames, const Loss& loss, StepParameters parameters, bool step)
  {
    CheckFrames(sweep_, frames);
    loss.Validate();
    imageLoss_->Check(loss);
    PrepareCameras();
    const int views = static_cast<int>(frames.size());
    const std::size_t pixels = sweep_->PixelsPerFrame(), all = pixels * views;
    parameters.l1 = static_cast<float>(loss.l1);
    parameters.l2 = static_cast<float>(loss.l2);
    parameters.gamma = static_cast<float>(transfer_.gamma);
    parameters.share =
        static_cast<float>(1.0 / (static_cast<double>(std::max<std::size_t>(countedPixels_, 1)) * views));
    parameters_.Upload(&parameters, 1, stream_);
    UploadBatch(frames);
    const bool atOnce = loss.IsPixelwise();
    const Tiles tiles = TilesOfWindow({0, sweep_->width, 0, sweep_->height});
    Grow(images_, all, "images", kSmallerBatch);

    TrainTask forward{};
    forward.tiles = tiles;
    forward.frames = frames_.data();
    forward.sweep = DeviceFrames();
    forward.parameters = parameters_.data();
    forward.derivative = atOnce;
    forward.images = images_.data();
    const auto render = [&]
    {
      forward.lists =
          FindVisible(cameras_.data(), views, sweep_->width, sweep_->height, tiles, FootprintsFor::Training);
      forward.losses = losses_.data();
      Launch("rendering", TrainTiles, Warps(tiles), views, kForwardWarps * kWarp, stream_, forward);
    };
    BackwardTask backward{};
    backward.field = DeviceField();
    backward.cameras = cameras_.data();
    backward.frames = frames_.data();
    backward.images = images_.data();
    backward.width = sweep_->width;
    backward.height = sweep_->height;
    backward.parameters = parameters_.data();
    backward.adam = step ? adam_.data() : nullptr;
    backward.gradient = step ? nullptr : gradient_.data();
    backward.scores = keepScores_ ? scores_.data() : nullptr;
    backward.guarded = &results_.data()->guarded;
    const auto gather = [&](std::size_t losses)
    {
      backward.lists = forward.lists;
      Launch("propagating back", Backward, gaussians_.size(), 1, kBackwardThreads, stream_, backward);
      Launch("adding up the loss", SumInOrder, 1, 1, kSumThreads, stream_, losses_.data(), losses,
             &results_.data()->loss);
    };
    if (atOnce)
    {
      const auto all = [&]
      {
        render();
        gather(tiles.Count() * views);
      };
      const auto again = [&]
      {
        if (step_.Empty() || recordedViews_ != views)
        {
          MakeRoom(views, OverlapGrid::For(sweep_->width, sweep_->height), tiles);
          step_.Record(stream_, all);
          recordedViews_ = views;
        }
        step_.Launch(stream_);
      };
      return (step ? Repeat(again) : Repeat(all)).loss;
    }

    Repeat(render);
    const std::size_t pixelBlocks = (pixels + kPixelThreads - 1) / kPixelThreads;
    Grow(intensities_, all, "images", kSmallerBatch);
    Grow(others_, all, "images", kSmallerBatch);
    PixelTask task{frames_.data(), forward.sweep, parameters_.data(), images_.data(), intensities_.data(),
                   others_.data(), nullptr};
    Launch("a loss", ToIntensities, pixelBlocks, views, kPixelThreads, stream_, task);
    const double others = WindowLosses(views, loss) + SpectrumLosses(frames, loss);
    Grow(losses_, pixelBlocks * views, "losses", kSmallerBatch);
    task.losses = losses_.data();
    Launch("a loss", ToDerivatives, pixelBlocks, views, kPixelThreads, stream_, task);
    gather(pixelBlocks * views);
    return others + ReadResults().loss;
  }

  /// dL/dI of the terms that look at windows into others_; returns their loss.
  double WindowLosses(int views, const Loss& loss)
  {
    if (loss.dssim == 0 && loss.contrast == 0)
    {
      others_.Clear(stream_);
      return 0;
    }
    WindowTask task{};
    task.frames = frames_.data();
    task.sweep = DeviceFrames();
    const std::array<double, ssimTaps> kernel = SsimKernel();
    std::copy(kernel.begin(), kernel.end(), task.kernel);
    task.dssim = static_cast<float>(loss.dssim);
    task.contrast = static_cast<float>(loss.contrast);
    task.share = static_cast<float>(1.0 / (static_cast<double>(imageLoss_->CountedWindows()) * views));
    task.windows = windows_.size() > 0 ? windows_.data() : nullptr;
    task.across = sweep_->width - ssimTaps + 1;
    task.down = sweep_->height - ssimTaps + 1;
    Grow(slopes_, static_cast<std::size_t>(views) * 3 * task.across * task.down, "slopes", kSmallerBatch);
    const auto blocks = [](int width, int height)
    {
      const auto up = [](int n) { return static_cast<std::size_t>((n + kWindowSide - 1) / kWindowSide); };
      return up(width) * up(height);
    };
    const std::size_t windows = blocks(task.across, task.down);
    Grow(losses_, windows * views, "losses", kSmallerBatch);
    task.intensities = intensities_.data();
    task.slopes = slopes_.data();
    task.others = others_.data();
    task.losses = losses_.data();
    Launch("a loss of windows", FindSlopes, windows, views, kWindowThreads, stream_, task);
    Launch("a loss of windows", SpreadSlopes, blocks(sweep_->width, sweep_->height), views, kWindowThreads, stream_,
           task);
    return Sum(losses_.data(), windows * views);
  }

  /// Adds dL/dI of the focal frequency loss to others_; returns the loss.
  double SpectrumLosses(const std::vector<int>& frames, const Loss& loss)
  {
    if (loss.ffl == 0)
    {
      return 0;
    }
    const FourierLibrary* library = FourierLibrary::Find();
    if (!library)
    {
      return SpectrumLossesOnHost(frames, loss);
    }
    const int width = sweep_->width, height = sweep_->height, views = static_cast<int>(frames.size());
    const std::size_t pixels = sweep_->PixelsPerFrame();
    if (!fourier_ || !fourier_->IsFor(width, height, views))
    {
      fourier_.reset();
      fourier_ = std::make_unique<Fourier>(*library, width, height, views, stream_);
    }
    Grow(differences_, pixels * views, "images", kSmallerBatch);
    Grow(spectrum_, static_cast<std::size_t>(views) * height * (width / 2 + 1), "spectra", kSmallerBatch);
    Grow(losses_, views, "losses", kSmallerBatch);
    const double counted = static_cast<double>(std::max<std::size_t>(countedPixels_, 1));
    const SpectrumTask task{frames_.data(),      DeviceFrames(),      static_cast<float>(loss.ffl / (counted * views)),
                            intensities_.data(), differences_.data(), spectrum_.data(),
                            others_.data(),      losses_.data()};
    const std::size_t blocks = (pixels + kPixelThreads - 1) / kPixelThreads;
    Launch("a loss of the spectrum", FindDifferences, blocks, views, kPixelThreads, stream_, task);
    fourier_->Forward(differences_.data(), reinterpret_cast<float*>(spectrum_.data()));
    Launch("a loss of the spectrum", WeighSpectrum, 1, views, kSumThreads, stream_, task);
    fourier_->Backward(reinterpret_cast<float*>(spectrum_.data()), differences_.data());
    Launch("a loss of the spectrum", AddSpectrum, blocks, views, kPixelThreads, stream_, task);
    return Sum(losses_.data(), views);
  }

  /// The same where cuFFT is not installed: images go to the host and back.
  double SpectrumLossesOnHost(const std::vector<int>& frames, const Loss& loss)
  {
    Loss spectrum;
    spectrum.l1 = 0;
    spectrum.ffl = loss.ffl;
    const std::size_t pixels = sweep_->PixelsPerFrame();
    std::vector<float> images(intensities_.size()), truth(pixels), others(intensities_.size());
    intensities_.Download(images.data(), 0, images.size(), stream_);
    others_.Download(others.data(), 0, others.size(), stream_);
    double sum = 0;
    for (std::size_t f = 0; f < frames.size(); ++f)
    {
      sweep_->CopyFrame(frames[f], truth.data());
      sum += imageLoss_->Evaluate(spectrum, 1.0 / static_cast<double>(frames.size()), images.data() + f * pixels,
                                  truth.data(), sweep_->width, others.data() + f * pixels);
    }
    others_.Upload(others.data(), others.size(), stream_);
    return sum;
  }

  Stream stream_;
  Recording step_;  // of TrainStep, with batches of recordedViews_ frames
  int recordedViews_ = 0;
  std::string device_;
  std::vector<std::uint32_t> order_;  // slot -> index in the field
  Beam beam_;
  TransferFunction transfer_;
  Accuracy accuracy_;
  bool keepScores_ = false, hasGradient_ = false, hasAdam_ = false, camerasAreStale_ = true;
  std::shared_ptr<const Sweep> sweep_;
  std::size_t countedPixels_ = 0;
  std::optional<ImageLoss> imageLoss_;  // of the frames' size and mask

  DeviceArray<GaussianBlock<float>> gaussians_;
  DeviceArray<BlockPlace> places_;
  DeviceArray<int> sharpSlots_;
  DeviceArray<GaussianBlock<double>> sharp_;
  DeviceArray<AdamBlock<float>> adam_;
  DeviceArray<GradientBlock<float>> gradient_;
  DeviceArray<ScoreBlock<float>> scores_;
  DeviceArray<std::uint8_t> bytes_, counted_, windows_;
  DeviceArray<float> floats_;
  DeviceArray<Camera> cameras_, planes_;  // of the sweep's frames; of the slices asked for
  DeviceArray<int> frames_;               // of the batch
  DeviceArray<Seen> seen_;
  DeviceArray<Box> boxes_, groupBoxes_;
  DeviceArray<VisibleSplat> splats_;
  DeviceArray<unsigned int> overlaps_;
  DeviceArray<float> images_, intensities_, others_, slopes_, rendered_;
  std::unique_ptr<Fourier> fourier_;  // of the last batch's size
  DeviceArray<float> differences_;
  DeviceArray<float2> spectrum_;
  DeviceArray<double> losses_;
  DeviceArray<StepParameters> parameters_;
  DeviceArray<Results> results_;
};

}  // namespace cuda

std::unique_ptr<Engine> CreateCudaEngine()
{
  return std::make_unique<cuda::CudaEngine>();
}

}  // namespace bigus
