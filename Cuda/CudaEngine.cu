// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The CUDA engine: field, frames, optimizer state and scores stay on the device; a training step is a fixed row of
// kernels, and what comes back from it is one small structure.

#include <algorithm>
#include <cstdint>
#include <utility>

#include "Backward.h"
#include "Core/Engine/BlockField.h"
#include "Core/Engine/Checks.h"
#include "CudaEngine.h"
#include "CudaField.h"
#include "CudaFrames.h"
#include "CudaImageLosses.h"
#include "Workspace.h"

namespace bigus
{
namespace cuda
{

class CudaEngine final : public Engine
{
public:
  CudaEngine()
  {
    cudaDeviceProp properties;
    Check(cudaGetDeviceProperties(&properties, 0), "asking for the device");
    device_ = "CUDA (" + std::string(properties.name) + ", compute capability " + std::to_string(properties.major) +
              "." + std::to_string(properties.minor) + ")";
    work_.Grow(parameters_, 1, "parameters", kFewerGaussians);
  }

  std::string Device() const override { return device_; }

  void SetField(const GaussianField& field, const std::vector<int>* parents) override
  {
    hasGradient_ = false;
    keepScores_ = false;
    frames_.ForgetCameras();
    field_.Set(field, parents);
  }

  GaussianField GetField() const override { return field_.Get(); }

  std::size_t FieldSize() const override { return field_.Size(); }

  void SetAccuracy(const Accuracy& accuracy) override
  {
    accuracy_ = accuracy;
    work_.step.Forget();
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

  void SetFrames(std::shared_ptr<const Sweep> sweep) override { frames_.Set(std::move(sweep)); }

  double Backpropagate(const std::vector<int>& frames, const Loss& loss) override
  {
    work_.Grow(gradient_, field_.Blocks(), "gradients", kFewerGaussians);
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
    field_.PrepareAdam();
    StepParameters parameters;
    parameters.adam = AdamStep(rates, limits);
    parameters_.Upload(&parameters, 1, work_.stream);
    BackwardTask task{};
    task.field = field_.View();
    task.gradient = gradient_.data();
    task.adam = field_.Adam();
    task.parameters = parameters_.data();
    task.guarded = &work_.Reported()->guarded;
    Launch("a step", TakeStep, field_.Blocks(), 1, kBlock, work_.stream, task);
  }

  double TrainStep(const std::vector<int>& frames, const Loss& loss, const LearningRates& rates,
                   const ParameterLimits& limits) override
  {
    hasGradient_ = false;
    field_.PrepareAdam();
    StepParameters parameters;
    parameters.adam = AdamStep(rates, limits);
    return Propagate(frames, loss, parameters, true);
  }

  std::uint64_t GuardedUpdates() const override { return work_.ReadResults().guarded; }

  std::size_t MemoryUse() const override
  {
    return work_.Bytes() + field_.Bytes() + frames_.Bytes() + imageLosses_.Bytes() + gradient_.Bytes() +
           scores_.Bytes() + planes_.Bytes() + batch_.Bytes() + seen_.Bytes() + boxes_.Bytes() + groupBoxes_.Bytes() +
           splats_.Bytes() + moments_.Bytes() + overlaps_.Bytes() + images_.Bytes() + rendered_.Bytes() +
           parameters_.Bytes();
  }

  void SaveState(StateWriter& to) const override
  {
    BlockState<float> state = field_.State();
    state.scores.resize(keepScores_ ? scores_.size() : 0);
    scores_.Download(state.scores.data(), 0, state.scores.size(), work_.stream);
    state.keepsScores = keepScores_;
    state.Save(to);
  }

  void LoadState(StateReader& from) override
  {
    const BlockState<float> state = BlockState<float>::Load(from);
    hasGradient_ = false;
    frames_.ForgetCameras();
    field_.SetState(state);
    keepScores_ = state.keepsScores;
    if (keepScores_)
    {
      ResetScores();
      scores_.Upload(state.scores.data(), state.scores.size(), work_.stream);
    }
  }

  FieldGradient GetGradient() const override
  {
    std::vector<GradientBlock<float>> gradient(hasGradient_ ? gradient_.size() : 0);
    gradient_.Download(gradient.data(), 0, gradient.size(), work_.stream);
    return GradientOf(gradient, field_.Order());
  }

  Scores GetScores() const override
  {
    std::vector<ScoreBlock<float>> scores(keepScores_ ? scores_.size() : 0);
    scores_.Download(scores.data(), 0, scores.size(), work_.stream);
    return ScoresOf(scores, field_.Order());
  }

  void ResetScores() override
  {
    work_.Grow(scores_, field_.Blocks(), "scores", kFewerGaussians);
    scores_.Clear(work_.stream);
    work_.step.Forget();
    keepScores_ = true;
  }

private:
  static constexpr std::size_t kStackPixels = std::size_t(1) << 25;  // of a stack, rendered at once
  static constexpr std::size_t kStackPlanes = 64;                    // the same; their lists are held too
  static constexpr std::size_t kWarpsOfDevice = 6000;                // that a large one runs at once, about

  /// One window of several planes of one size.
  void RenderPlanes(const SlicePlane* planes, int views, const Window& window, ViewOutput output, float* images,
                    float* coverage)
  {
    std::vector<Camera> cameras;
    std::vector<int> frames;
    for (int view = 0; view < views; ++view)
    {
      planes[view].Validate("slice plane");
      cameras.push_back(CameraOf(planes[view], field_.GetBeam()));
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
    work_.Grow(planes_, cameras.size(), "planes", kFewerPixels);
    planes_.Upload(cameras.data(), cameras.size(), work_.stream);
    UploadBatch(frames);
    work_.Grow(rendered_, coverage ? 2 * pixels : pixels, "slices", kFewerPixels);

    RenderTask task{};
    task.window = {window.firstColumn, window.firstColumn + window.columns, window.firstRow,
                   window.firstRow + window.rows};
    task.tiles = TilesOfWindow(task.window);
    task.intensity = output == ViewOutput::Intensity;
    task.gamma = static_cast<float>(field_.Transfer().gamma);
    task.image = rendered_.data();
    task.coverage = coverage ? rendered_.data() + pixels : nullptr;
    Repeat(
        [&]
        {
          task.lists = FindVisible(planes_.data(), views, width, height, task.tiles, FootprintsFor::Rendering);
          Launch("rendering", RenderTiles, task.tiles.Count(), views, kForwardWarps * kWarp, work_.stream, task);
        });
    rendered_.Download(images, 0, pixels, work_.stream);
    if (coverage)
    {
      rendered_.Download(coverage, pixels, pixels, work_.stream);
    }
  }

  void UploadBatch(const std::vector<int>& frames)
  {
    work_.Grow(batch_, frames.size(), "batches", kSmallerBatch);
    batch_.Upload(frames.data(), frames.size(), work_.stream);
  }

  static Tiles TilesOfWindow(const Box& window)
  {
    const auto up = [](int pixel) { return (pixel + kTileSide - 1) / kTileSide; };
    const int column = window.columnBegin / kTileSide, row = window.rowBegin / kTileSide;
    return {column, row, up(window.columnEnd) - column, up(window.rowEnd) - row};
  }

  /// Queues work that begins with FindVisible, as often as it takes until there is room for all splats: kernels do
  /// nothing when there is not. Returns what they report.
  template <class Enqueue>
  Results Repeat(Enqueue&& enqueue)
  {
    while (true)
    {
      enqueue();
      const Results results = work_.ReadResults();
      if (results.used <= splats_.size())
      {
        return results;
      }
      work_.Grow(splats_, results.used + results.used / 32, "footprints", kSmallerBatch);
    }
  }

  /// Room for what FindVisible and TrainTiles leave.
  void MakeRoom(int views, const OverlapGrid& overlaps, const Tiles& tiles)
  {
    const std::size_t blocks = field_.Blocks(), groups = (blocks + kGroup - 1) / kGroup;
    work_.Grow(seen_, blocks * views, "lists", kSmallerBatch);
    work_.Grow(boxes_, groups * kGroup * views, "lists", kSmallerBatch);
    work_.Grow(groupBoxes_, groups * views, "lists", kSmallerBatch);
    work_.Grow(overlaps_, static_cast<std::size_t>(views) * overlaps.columns * overlaps.rows, "counts", kSmallerBatch);
    if (work_.Grow(work_.losses, std::max(tiles.Count() * views, blocks), "losses", kSmallerBatch))
    {
      work_.losses.Clear(work_.stream);  // summed even where there was no room for splats and nothing was rendered
    }
  }

  /// Queues the search for what the cameras of frames_ see in some tiles of their width x height images.
  Lists FindVisible(const Camera* cameras, int views, int width, int height, const Tiles& tiles, FootprintsFor purpose)
  {
    const std::size_t blocks = field_.Blocks(), groups = (blocks + kGroup - 1) / kGroup;
    const OverlapGrid grid = OverlapGrid::For(width, height);
    MakeRoom(views, grid, tiles);
    FindTask task{};
    task.truncation =
        Truncation::For(purpose, accuracy_.tolerance / field_.Transfer().gamma, accuracy_.perSplat, field_.Size());
    task.overlaps = {overlaps_.data(), grid};
    task.field = field_.View();
    task.cameras = cameras;
    task.frames = batch_.data();
    task.views = views;
    task.window = {tiles.columnBegin * kTileSide, (tiles.columnBegin + tiles.columns) * kTileSide,
                   tiles.rowBegin * kTileSide, (tiles.rowBegin + tiles.rows) * kTileSide};
    task.plane = {0, width, 0, height};
    task.direct = accuracy_.direct;
    if (task.truncation.isShared)
    {
      overlaps_.Clear(work_.stream);
      Launch("counting footprints", CountOverlaps, (blocks + kBlock - 1) / kBlock, views, kBlock, work_.stream, task);
    }
    task.seen = seen_.data();
    task.boxes = boxes_.data();
    task.groupBoxes = groupBoxes_.data();
    task.groups = static_cast<int>(groups);
    task.splats = splats_.data();
    task.capacity = splats_.size();
    task.used = &work_.Reported()->used;
    Check(cudaMemsetAsync(task.used, 0, sizeof(*task.used), work_.stream), "clearing");
    // As few pairs a warp as still give each some, so that what is seen is spread over the device.
    const std::size_t all = blocks * views;
    task.pairs = static_cast<int>(std::clamp<std::size_t>(all / kWarpsOfDevice, 1, 8));
    const std::size_t ofThreadBlock = static_cast<std::size_t>(task.pairs) * kFindWarps;
    Launch("finding footprints", FindSplats, (all + ofThreadBlock - 1) / ofThreadBlock, 1, kFindWarps * kWarp,
           work_.stream, task);
    Launch("finding footprints", FindGroups, groups, views, kGroup, work_.stream, task);
    return {views,          task.groups, seen_.data(),  boxes_.data(), groupBoxes_.data(),
            splats_.data(), task.used,   splats_.size()};
  }

  /// Forward and backward over a batch; with `step` the field moves, else the gradient is stored.
  double Propagate(const std::vector<int>& frames, const Loss& loss, StepParameters parameters, bool step)
  {
    CheckFrames(frames_.GetSweep(), frames);
    loss.Validate();
    frames_.LossOfImages().Check(loss);
    const Sweep& sweep = *frames_.GetSweep();
    const Camera* const cameras = frames_.Cameras(field_.GetBeam());
    const int views = static_cast<int>(frames.size());
    const std::size_t pixels = sweep.PixelsPerFrame(), all = pixels * views;
    parameters.l1 = static_cast<float>(loss.l1);
    parameters.l2 = static_cast<float>(loss.l2);
    parameters.gamma = static_cast<float>(field_.Transfer().gamma);
    parameters.share =
        static_cast<float>(1.0 / (static_cast<double>(std::max<std::size_t>(frames_.CountedPixels(), 1)) * views));
    parameters_.Upload(&parameters, 1, work_.stream);
    UploadBatch(frames);
    const bool atOnce = loss.IsPixelwise();
    const Tiles tiles = TilesOfWindow({0, sweep.width, 0, sweep.height});
    work_.Grow(images_, all, "images", kSmallerBatch);

    TrainTask forward{};
    forward.tiles = tiles;
    forward.frames = batch_.data();
    forward.sweep = frames_.View();
    forward.parameters = parameters_.data();
    forward.derivative = atOnce;
    forward.images = images_.data();
    const auto render = [&]
    {
      forward.lists = FindVisible(cameras, views, sweep.width, sweep.height, tiles, FootprintsFor::Training);
      forward.losses = work_.losses.data();
      Launch("rendering", TrainTiles, tiles.Count(), views, kForwardWarps * kWarp, work_.stream, forward);
    };
    BackwardTask backward{};
    backward.field = field_.View();
    backward.cameras = cameras;
    backward.frames = batch_.data();
    backward.parameters = parameters_.data();
    backward.adam = step ? field_.Adam() : nullptr;
    backward.gradient = step ? nullptr : gradient_.data();
    backward.scores = keepScores_ ? scores_.data() : nullptr;
    backward.guarded = &work_.Reported()->guarded;
    const auto makeRoom = [&] { work_.Grow(moments_, splats_.size(), "footprints", kSmallerBatch); };
    const auto gather = [&](std::size_t losses)
    {
      backward.lists = forward.lists;
      backward.moments = moments_.data();
      const GatherTask gathering{forward.lists, images_.data(), sweep.width, sweep.height, moments_.data()};
      constexpr std::size_t kTeams = kGatherThreads / kGatherLanes, kMostGathering = kWarpsOfDevice;
      Launch("propagating back", keepScores_ ? GatherMoments<kMoments> : GatherMoments<kMoments - 1>,
             std::min((splats_.size() + kTeams - 1) / kTeams, kMostGathering), 1, kGatherThreads, work_.stream,
             gathering);
      Launch("propagating back", Backward, field_.Blocks(), 1, kBlock, work_.stream, backward);
      Launch("adding up the loss", SumInOrder, 1, 1, kSumThreads, work_.stream, work_.losses.data(), losses,
             &work_.Reported()->loss);
    };
    if (atOnce)
    {
      const auto all = [&]
      {
        render();
        gather(tiles.Count() * views);
      };
      const auto once = [&]
      {
        makeRoom();
        all();
      };
      const auto again = [&]
      {
        makeRoom();
        if (work_.step.Empty() || recordedViews_ != views)
        {
          MakeRoom(views, OverlapGrid::For(sweep.width, sweep.height), tiles);
          work_.step.Record(work_.stream, all);
          recordedViews_ = views;
        }
        work_.step.Launch(work_.stream);
      };
      return (step ? Repeat(again) : Repeat(once)).loss;
    }

    Repeat(render);
    makeRoom();
    const std::size_t pixelBlocks = (pixels + kPixelThreads - 1) / kPixelThreads;
    imageLosses_.MakeRoom(all);
    PixelTask task{batch_.data(),         forward.sweep, parameters_.data(), images_.data(), imageLosses_.Intensities(),
                   imageLosses_.Others(), nullptr};
    Launch("a loss", ToIntensities, pixelBlocks, views, kPixelThreads, work_.stream, task);
    const double others = imageLosses_.Evaluate(batch_.data(), frames, loss);
    work_.Grow(work_.losses, pixelBlocks * views, "losses", kSmallerBatch);
    task.losses = work_.losses.data();
    Launch("a loss", ToDerivatives, pixelBlocks, views, kPixelThreads, work_.stream, task);
    gather(pixelBlocks * views);
    return others + work_.ReadResults().loss;
  }

  Workspace work_;
  CudaField field_{work_};
  CudaFrames frames_{work_};
  CudaImageLosses imageLosses_{work_, frames_};
  int recordedViews_ = 0;  // of the recorded step's batches
  std::string device_;
  Accuracy accuracy_;
  bool keepScores_ = false, hasGradient_ = false;

  DeviceArray<GradientBlock<float>> gradient_;
  DeviceArray<ScoreBlock<float>> scores_;
  DeviceArray<Camera> planes_;  // of the slices asked for
  DeviceArray<int> batch_;      // frames of the batch
  DeviceArray<Seen> seen_;
  DeviceArray<Box> boxes_, groupBoxes_;
  DeviceArray<DeviceSplat> splats_;
  DeviceArray<SplatMoments> moments_;
  DeviceArray<unsigned int> overlaps_;
  DeviceArray<float> images_, rendered_;
  DeviceArray<StepParameters> parameters_;
};

}  // namespace cuda

std::unique_ptr<Engine> CreateCudaEngine()
{
  return std::make_unique<cuda::CudaEngine>();
}

}  // namespace bigus
