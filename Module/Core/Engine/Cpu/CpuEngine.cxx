// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The CPU engine, in float and in double: blocks of neighbouring Gaussians, projected only where a plane crosses them,
// footprints cut by an error bound and evaluated by recurrence, and a backward pass that gathers.
//
// Work is cut into blocks of Gaussians and bands of rows. A band adds its splats in the order of the blocks, a block
// adds its gradients in the order of the frames, and what a pixel gets does not depend on its band. So the bits do not
// depend on the number of threads, and only counts are atomic. A training step passes over memory three times: blocks
// to splats, splats to images and their derivatives, and images back to gradients that are spent at once.

#include <tbb/enumerable_thread_specific.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>
#include <utility>

#include "Core/Engine/BlockField.h"
#include "Core/Engine/Checks.h"
#include "Core/Engine/Cpu/CpuField.h"
#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/Cpu/FlushDenormals.h"
#include "Core/Engine/Cpu/VisibleSplats.h"
#include "Core/Engine/Engine.h"
#include "Core/Engine/Exchange.h"
#include "Core/Engine/ImageLoss.h"
#include "Core/Engine/InstructionSets.h"
#include "Core/Engine/ViewEngine.h"
#include "Core/Formula/Adam.h"
#include "Core/Formula/Truncation.h"
#include "Core/Numerics/Statistics.h"

namespace bigus
{
namespace
{

constexpr int kSmallestBand = 32,
              kLargestBand = 128;  // rows rendered together: few footprints should lie in two bands

template <class T>
class CpuEngine final : public Engine, public ViewEngine
{
public:
  std::string Device() const override
  {
    return std::string("CPU (") + (sizeof(T) == 8 ? "double, " : "") + InstructionSets().front() + ", " +
           std::to_string(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism)) +
           " threads)";
  }

  void SetField(const GaussianField& field, const std::vector<int>* parents) override
  {
    field_.Set(field, parents);
    gradient_ = {};
    scores_ = {};
    keepScores_ = false;
  }

  GaussianField GetField() const override { return field_.Get(); }
  std::size_t FieldSize() const override { return field_.Size(); }
  void SetExchange(Exchange* exchange) override { exchange_ = exchange; }
  void SetAccuracy(const Accuracy& accuracy) override { accuracy_ = accuracy; }

  void Render(const SlicePlane& plane, const Window& window, ViewOutput output, float* image, float* coverage) override
  {
    plane.Validate("slice plane");
    CheckWindow(plane, window.firstColumn, window.firstRow, window.columns, window.rows);
    Require(std::max(plane.width, plane.height) <= kLargestImage, "CPU engine: a plane of ", plane.width, " x ",
            plane.height, " pixels is larger than 16777216 along a side.");
    const std::vector<Camera> cameras{CameraOf(plane, field_.GetBeam())};
    visible_.Find(field_, cameras, plane.width, plane.height, window, accuracy_, FootprintsFor::Rendering);
    const std::size_t stride = static_cast<std::size_t>(window.columns) + kRowPadding;
    ForBands(1, window.rows,
             [&](int, int begin, int end)
             {
               const int firstRow = window.firstRow + begin, lastRow = window.firstRow + end;
               std::vector<T>& buffer = bandBuffers_.local();  // kept: fresh memory would cost as much as its pixels
               buffer.assign(stride * (end - begin), T(0));
               const PixelRows<T> rows{buffer.data(), window.firstColumn, firstRow, stride};
               visible_.AddTo(0, firstRow, lastRow, rows,
                              [this](std::size_t b) { return field_.Block(b).reflectivity; });
               for (int row = begin; row < end; ++row)
               {
                 T* line = buffer.data() + (row - begin) * stride;
                 float* pixels = image + static_cast<std::size_t>(row) * window.columns;
                 std::size_t done = 0;
                 if (output == ViewOutput::Intensity)
                 {
                   const T gamma = static_cast<T>(field_.Transfer().gamma);
                   if constexpr (std::is_same_v<T, float>)
                   {
                     done = static_cast<std::size_t>(window.columns) / kRowPadding * kRowPadding;  // whole vectors
                     kernels_.toIntensity(line, done, gamma, pixels);
                   }
                   kernels_.toIntensity(line + done, window.columns - done, gamma, line + done);
                 }
                 std::copy(line + done, line + window.columns, pixels + done);
               }
               if (coverage)
               {
                 std::fill(buffer.begin(), buffer.end(), T(0));
                 visible_.AddTo(0, firstRow, lastRow, rows, [](std::size_t) -> const T* { return nullptr; });
                 for (int row = begin; row < end; ++row)
                 {
                   const T* line = buffer.data() + (row - begin) * stride;
                   std::copy_n(line, window.columns, coverage + static_cast<std::size_t>(row) * window.columns);
                 }
               }
             });
  }

  void SetFrames(std::shared_ptr<const Sweep> sweep) override
  {
    sweep->ValidateLayout();
    sweep_ = std::move(sweep);
    countedPixels_ = 0;
    for (std::size_t pixel = 0; pixel < sweep_->PixelsPerFrame(); ++pixel)
    {
      countedPixels_ += sweep_->IsLit(pixel);
    }
    imageLoss_.emplace(sweep_->width, sweep_->height, CountedPixels(*sweep_));
  }

  double Backpropagate(const std::vector<int>& frames, const Loss& loss) override
  {
    const double value = Forward(frames, loss);
    gradient_.assign(field_.NumberOfBlocks(), {});
    Backward([&](std::size_t b, const GradientBlock<T>& gradient) { gradient_[b] = gradient; });
    return value;
  }

  std::vector<double> Reflectivities() const override
  {
    std::vector<double> reflectivities(field_.Size());
    for (std::size_t slot = 0; slot < field_.Size(); ++slot)
    {
      reflectivities[field_.Order()[slot]] = field_.Block(slot / kBlock).reflectivity[slot % kBlock];
    }
    return reflectivities;
  }

  void SetReflectivities(const std::vector<double>& reflectivities) override
  {
    std::vector<T> bySlot(field_.NumberOfBlocks() * kBlock);
    for (std::size_t slot = 0; slot < field_.Size(); ++slot)
    {
      bySlot[slot] = static_cast<T>(reflectivities[field_.Order()[slot]]);
    }
    field_.SetReflectivities(bySlot);
  }

  double Backpropagate(const std::vector<int>& frames, const Loss& loss, const std::vector<float>& reflectivities,
                       std::vector<float>& derivatives) override
  {
    const Views views(*this, reflectivities);
    const double value = Forward(frames, loss);
    views.Restore();
    gradient_.assign(field_.NumberOfBlocks(), {});
    derivatives.assign(reflectivities.size(), 0.0f);
    Backward<true>([&](std::size_t b, const GradientBlock<T>& gradient) { gradient_[b] = gradient; }, &derivatives);
    return value;
  }

  void Walk(const std::vector<int>& frames, const std::vector<float>& reflectivities, const ChangeRow& change,
            std::vector<float>* sums) override
  {
    const Views views(*this, reflectivities);
    ForwardFrames(frames,
                  [&](std::size_t f, int row, const T*, T*, T* line)
                  {
                    std::vector<float> values(line, line + sweep_->width);
                    change(f, row, values.data());
                    std::copy(values.begin(), values.end(), line);
                    return 0.0;
                  });
    if (sums)
    {
      sums->assign(reflectivities.size(), 0.0f);
      Backward<true>([](std::size_t, const GradientBlock<T>&) {}, &*sums);
    }
  }

  void Step(const LearningRates& rates, const ParameterLimits& limits) override
  {
    Require(gradient_.size() == field_.NumberOfBlocks(),
            "CPU engine: Step needs the gradient of a Backpropagate with the present field.");
    field_.PrepareStep();
    const AdamStep step(rates, limits);
    tbb::parallel_for(std::size_t(0), field_.NumberOfBlocks(),
                      [&](std::size_t b)
                      {
                        const FlushDenormals flush;  // as in TrainStep
                        field_.Update(b, gradient_[b], step);
                      });
  }

  double TrainStep(const std::vector<int>& frames, const Loss& loss, const LearningRates& rates,
                   const ParameterLimits& limits) override
  {
    const double value = Forward(frames, loss);
    gradient_ = {};
    field_.PrepareStep();
    const AdamStep step(rates, limits);
    Backward([&](std::size_t b, const GradientBlock<T>& gradient) { field_.Update(b, gradient, step); });
    return value;
  }

  std::uint64_t GuardedUpdates() const override { return field_.GuardedUpdates(); }

  std::size_t MemoryUse() const override
  {
    const auto bytes = [](const auto& v) { return v.capacity() * sizeof(v[0]); };
    std::size_t buffers = 0;
    for (const std::vector<T>& buffer : bandBuffers_)
    {
      buffers += bytes(buffer);
    }
    return field_.Bytes() + visible_.Bytes() + bytes(gradient_) + bytes(scores_) + bytes(images_) + bytes(sum_) +
           buffers;
  }

  void SaveState(StateWriter& to) const override
  {
    BlockState<T> state = field_.State();
    state.scores = scores_;
    state.keepsScores = keepScores_;
    state.Save(to);
  }

  void LoadState(StateReader& from) override
  {
    BlockState<T> state = BlockState<T>::Load(from);
    gradient_ = {};
    scores_ = std::move(state.scores);
    keepScores_ = state.keepsScores;
    field_.SetState(std::move(state));
  }

  FieldGradient GetGradient() const override { return GradientOf(gradient_, field_.Order()); }
  Scores GetScores() const override { return ScoresOf(scores_, field_.Order()); }

  void ResetScores() override
  {
    keepScores_ = true;
    scores_.assign(field_.NumberOfBlocks(), {});
  }

private:
  /// High enough to leave each thread a few bands. What a pixel gets does not depend on it.
  static int BandRows(int images, int rows)
  {
    const std::int64_t tasks = 2 * static_cast<std::int64_t>(tbb::this_task_arena::max_concurrency());
    const std::int64_t share = (static_cast<std::int64_t>(images) * rows + tasks - 1) / tasks;
    return static_cast<int>(std::clamp<std::int64_t>(share, kSmallestBand, kLargestBand));
  }

  /// body(image, first row, last row) for every band of every image.
  template <class Body>
  static void ForBands(int images, int rows, Body&& body)
  {
    const int band = BandRows(images, rows);
    const int bands = (rows + band - 1) / band;
    tbb::parallel_for(std::size_t(0), static_cast<std::size_t>(images) * bands,
                      [&](std::size_t task)
                      {
                        const FlushDenormals flush;
                        const int begin = static_cast<int>(task % bands) * band;
                        body(static_cast<int>(task / bands), begin, std::min(begin + band, rows));
                      });
  }

  PixelRows<T> FrameRows(std::size_t f)
  {
    const std::size_t stride = static_cast<std::size_t>(sweep_->width) + kRowPadding;
    return {images_.data() + f * stride * sweep_->height, 0, 0, stride};
  }

  /// Each frame's own reflectivities while this lives. Footprints then end where the largest of them allow.
  class Views
  {
  public:
    Views(CpuEngine& engine, const std::vector<float>& reflectivities)
        : engine_(engine), own_(engine.field_.Reflectivities())
    {
      const std::vector<std::uint32_t>& order = engine.field_.Order();
      const std::size_t n = order.size(), frames = n > 0 ? reflectivities.size() / n : 0;
      engine.viewed_.assign(frames * own_.size(), T(0));
      std::vector<T> largest = own_;
      tbb::parallel_for(std::size_t(0), engine.field_.NumberOfBlocks(),
                        [&](std::size_t b)
                        {
                          for (std::size_t slot = b * kBlock; slot < std::min((b + 1) * kBlock, n); ++slot)
                          {
                            for (std::size_t f = 0; f < frames; ++f)
                            {
                              const T value = static_cast<T>(reflectivities[f * n + order[slot]]);
                              engine.viewed_[f * own_.size() + slot] = value;
                              largest[slot] = std::max(std::abs(largest[slot]), std::abs(value));
                            }
                          }
                        });
      engine.field_.SetReflectivities(largest);
    }
    ~Views()
    {
      Restore();
      engine_.viewed_.clear();
    }
    Views(const Views&) = delete;
    Views& operator=(const Views&) = delete;

    /// Footprints are found: the field is as it was.
    void Restore() const { engine_.field_.SetReflectivities(own_); }

  private:
    CpuEngine& engine_;
    const std::vector<T> own_;
  };

  /// What Gaussians of a block reflect in frame f of those that are rendered.
  const T* ReflectivitiesOf(std::size_t b, std::size_t f) const
  {
    return viewed_.empty() ? field_.Block(b).reflectivity : viewed_.data() + (f * field_.NumberOfBlocks() + b) * kBlock;
  }

  /// Renders the frames into images_ and calls line(f, row, truth, counts, S) for every row, which replaces S by what is to be
  /// propagated back. counts is 1 where a pixel counts and 0 elsewhere. Returns
  /// the sum of the results.
  template <class Line>
  double ForwardFrames(const std::vector<int>& frames, Line&& line)
  {
    cameras_.clear();
    for (int frame : frames)
    {
      cameras_.push_back(CameraOf(sweep_->Plane(frame), field_.GetBeam()));
    }
    const int width = sweep_->width, height = sweep_->height;
    visible_.Find(field_, cameras_, width, height, {0, 0, width, height}, accuracy_, FootprintsFor::Training);
    const std::size_t stride = static_cast<std::size_t>(width) + kRowPadding;
    images_.resize(frames.size() * stride * height);
    std::vector<double> sums(frames.size() * height);  // of rows: no order to depend on
    const auto finish = [&](int f, int begin, int end)
    {
      const PixelRows<T> rows = FrameRows(f);
      std::vector<T> truth(stride, T(0)), counts(stride, T(0));
      for (int row = begin; row < end; ++row)
      {
        const std::size_t pixel = static_cast<std::size_t>(row) * width;
        ReadTruth(frames[f] * sweep_->PixelsPerFrame() + pixel, truth.data());
        ReadCounts(row, counts.data());
        sums[static_cast<std::size_t>(f) * height + row] =
            line(static_cast<std::size_t>(f), row, truth.data(), counts.data(), rows.Row(row));
      }
    };
    ForBands(static_cast<int>(frames.size()), height,
             [&](int f, int begin, int end)
             {
               const PixelRows<T> rows = FrameRows(f);
               std::fill(rows.Row(begin), rows.Row(end), T(0));
               visible_.AddTo(f, begin, end, rows, [this, f](std::size_t b) { return ReflectivitiesOf(b, f); });
               if (exchange_->IsAlone())
               {
                 finish(f, begin, end);  // while they are in the cache
               }
             });
    if (!exchange_->IsAlone())
    {
      AddPartsOfOthers(frames.size());
      ForBands(static_cast<int>(frames.size()), height, finish);
    }
    return SumInOrder(sums);
  }

  /// images_ of S of the whole field.
  void AddPartsOfOthers(std::size_t frames)
  {
    const std::size_t width = sweep_->width, height = sweep_->height;
    sum_.resize(frames * height * width);  // without what lies between rows, which need not travel
    const auto forRows = [&](auto&& copy)
    {
      for (std::size_t f = 0; f < frames; ++f)
      {
        const PixelRows<T> rows = FrameRows(f);
        for (std::size_t row = 0; row < height; ++row)
        {
          copy(rows.Row(static_cast<int>(row)), sum_.data() + (f * height + row) * width);
        }
      }
    };
    forRows([width](const T* row, T* sum) { std::copy_n(row, width, sum); });
    exchange_->Sum(sum_.data(), sum_.size());
    forRows([width](T* row, const T* sum) { std::copy_n(sum, width, row); });
  }

  /// images_ of dL/dS, and the loss.
  double Forward(const std::vector<int>& frames, const Loss& loss)
  {
    CheckFrames(sweep_, frames);
    loss.Validate();
    imageLoss_->Check(loss);
    const double share =
        1.0 / (static_cast<double>(std::max<std::size_t>(countedPixels_, 1)) * static_cast<double>(frames.size()));
    const auto toDerivative = [&](const T* truth, T* weights, const T* others, T* line)
    {
      const T weight = static_cast<T>(share);
      for (int column = 0; column < sweep_->width; ++column)
      {
        weights[column] *= weight;
      }
      return kernels_.toDerivative(static_cast<T>(loss.l1), static_cast<T>(loss.l2),
                                   static_cast<T>(field_.Transfer().gamma), truth, weights, others, sweep_->width,
                                   line);
    };
    if (loss.IsPixelwise())
    {
      return ForwardFrames(frames, [&](std::size_t, int, const T* truth, T* weights, T* line)
                           { return toDerivative(truth, weights, nullptr, line); });
    }

    return ForwardImages(frames, loss, toDerivative);
  }

  /// The same where terms look at whole images, which need all their rows: I of each frame, then dL/dI, then dL/dS.
  template <class ToDerivative>
  double ForwardImages(const std::vector<int>& frames, const Loss& loss, ToDerivative&& toDerivative)
  {
    ForwardFrames(frames, [](std::size_t, int, const T*, T*, T*) { return 0.0; });
    const int width = sweep_->width, height = sweep_->height;
    const std::size_t stride = static_cast<std::size_t>(width) + kRowPadding;
    std::vector<T> image(stride * height), truth(stride * height), others(stride * height);
    std::vector<double> sums(height);
    double total = 0;
    for (std::size_t f = 0; f < frames.size(); ++f)
    {
      const PixelRows<T> rows = FrameRows(f);
      std::fill(others.begin(), others.end(), T(0));
      ForBands(1, height,
               [&](int, int begin, int end)
               {
                 for (int row = begin; row < end; ++row)
                 {
                   kernels_.toIntensity(rows.Row(row), width, static_cast<T>(field_.Transfer().gamma),
                                        image.data() + row * stride);
                   ReadTruth(frames[f] * sweep_->PixelsPerFrame() + static_cast<std::size_t>(row) * width,
                             truth.data() + row * stride);
                 }
               });
      total += imageLoss_->Evaluate(loss, 1.0 / static_cast<double>(frames.size()), image.data(), truth.data(), stride,
                                    others.data());
      ForBands(1, height,
               [&](int, int begin, int end)
               {
                 std::vector<T> counts(stride, T(0));
                 for (int row = begin; row < end; ++row)
                 {
                   ReadCounts(row, counts.data());
                   sums[row] = toDerivative(truth.data() + row * stride, counts.data(), others.data() + row * stride,
                                            rows.Row(row));
                 }
               });
      for (double sum : sums)
      {
        total += sum;
      }
    }
    return total;
  }

  /// spend(block, gradient) for every block that the frames of the last Forward saw. With `derivatives` each frame has its
  /// own reflectivities; what the loss changes by these goes there.
  template <bool kHasViews = false, class Spend>
  void Backward(Spend&& spend, std::vector<float>* derivatives = nullptr)
  {
    const std::vector<std::uint32_t>& order = field_.Order();
    const bool keepScores = !kHasViews && keepScores_;
    if (keepScores)
    {
      scores_.resize(field_.NumberOfBlocks());
    }
    visible_.ForBlocks(
        [&](std::size_t slot)
        {
          const std::size_t b = visible_.Block(slot);
          field_.PrefetchAverages(b);
          GradientBlock<T> gradient{};
          MomentBlock<T> moments;
          ScoreBlock<T>* scores = keepScores ? &scores_[b] : nullptr;
          std::conditional_t<kHasViews, GaussianBlock<T>, const GaussianBlock<T>&> block = field_.Block(b);
          for (std::size_t f = 0; f < visible_.Views(); ++f)
          {
            const auto& list = visible_.ListOf(slot, f);
            if (list.count == 0)
            {
              continue;
            }
            const SplatRows<T> splats = visible_.Splats(list);
            kernels_.gatherMoments(splats, FrameRows(f), keepScores, moments);
            if constexpr (kHasViews)
            {
              std::copy_n(ReflectivitiesOf(b, f), kBlock, block.reflectivity);
              for (int i = 0; i < list.count; ++i)
              {
                const std::size_t gaussian = order[b * kBlock + static_cast<std::size_t>(splats[kGaussian][i])];
                (*derivatives)[f * order.size() + gaussian] = static_cast<float>(moments.values[kMoment0][i]);
              }
            }
            std::int32_t column, row;
            const View<T> view = LocalView<T>(cameras_[f], field_.Place(b), column, row);
            kernels_.addAdjoints(block, view, splats, moments, gradient, scores);
          }
          spend(b, gradient);
        });
  }

  /// 1 where a pixel of that row counts and 0 elsewhere.
  void ReadCounts(int row, T* counts) const
  {
    const std::size_t first = static_cast<std::size_t>(row) * sweep_->width;
    for (int column = 0; column < sweep_->width; ++column)
    {
      counts[column] = sweep_->IsLit(first + column) ? T(1) : T(0);
    }
  }

  void ReadTruth(std::size_t first, T* truth) const
  {
    if (sweep_->pixelType == Sweep::PixelType::UInt8)
    {
      const auto* pixels = static_cast<const std::uint8_t*>(sweep_->pixels.get()) + first;
      std::transform(pixels, pixels + sweep_->width, truth,
                     [](std::uint8_t pixel) { return static_cast<T>(pixel) * (T(1) / T(255)); });
    }
    else
    {
      std::copy_n(static_cast<const float*>(sweep_->pixels.get()) + first, sweep_->width, truth);
    }
  }

  const Kernels<T> kernels_ = KernelsOfThisMachine<T>();
  CpuField<T> field_;
  VisibleSplats<T> visible_;                // of the last Render or ForwardFrames
  std::vector<GradientBlock<T>> gradient_;  // empty but after Backpropagate
  std::vector<ScoreBlock<T>> scores_;
  bool keepScores_ = false;
  Accuracy accuracy_;
  Exchange* exchange_ = &Exchange::Alone();  // with others that have parts of the same field

  std::shared_ptr<const Sweep> sweep_;
  std::size_t countedPixels_ = 0;
  std::optional<ImageLoss> imageLoss_;  // of the frames' size and mask

  // The last ForwardFrames.
  std::vector<Camera> cameras_;
  std::vector<T> viewed_;  // [frames][blocks][kBlock] of Views; empty without
  std::vector<T> images_;
  std::vector<T> sum_;  // of the images of all processes, packed
  tbb::enumerable_thread_specific<std::vector<T>> bandBuffers_;
};

}  // namespace

std::unique_ptr<Engine> CreateCpuEngine()
{
  return std::make_unique<CpuEngine<float>>();
}

std::unique_ptr<Engine> CreateCpuDoubleEngine()
{
  return std::make_unique<CpuEngine<double>>();
}

}  // namespace bigus
