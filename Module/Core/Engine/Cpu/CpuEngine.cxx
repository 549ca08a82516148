// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The CPU engine, in float and in double: blocks of neighbouring Gaussians, projected only where a plane
// crosses them, footprints cut by an error bound and evaluated by recurrence, and a backward pass that
// gathers.
//
// Work is cut into blocks of Gaussians and bands of rows. A band adds its splats in the order of the blocks,
// a block adds its gradients in the order of the frames, and what a pixel gets does not depend on its band.
// So the bits do not depend on the number of threads, and only counts are atomic. A training step passes over
// memory three times: blocks to splats, splats to images and their derivatives, and images back to gradients
// that are spent at once.

#include <tbb/enumerable_thread_specific.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

#include "Core/Engine/BlockField.h"
#include "Core/Engine/Cpu/CpuKernels.h"
#include "Core/Engine/Engine.h"
#include "Core/Engine/EngineDetail.h"
#include "Core/Engine/ImageLoss.h"
#include "Core/Engine/MortonOrder.h"
#include "Core/Formula/Adam.h"
#include "Core/Formula/Truncation.h"

namespace bigus
{
namespace
{

constexpr int kSmallestBand = 32,
              kLargestBand = 128;   // rows rendered together: few footprints should lie in two bands
constexpr std::size_t kGroup = 32;  // neighbouring blocks tested together first: large fields have many blocks

/// While it lives, this thread's results too small for a normal number become 0. They occur far out in
/// footprints, and x86 is slow on them: training a sweep takes 4 % longer with them. (Other machines do not
/// mind.)
class FlushDenormals
{
#if defined(__SSE2__)
public:
  FlushDenormals() : before_(_mm_getcsr())
  {
    _mm_setcsr(before_ | 0x8040);
  }
  ~FlushDenormals()
  {
    _mm_setcsr(before_);
  }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

private:
  unsigned int before_;
#endif
};

/// How many Gaussians may overlap, by tiles of an image. Adding is safe from several threads; sums of whole
/// numbers do not depend on their order.
class TileCounts
{
public:
  TileCounts(int width, int height)
      : grid_(OverlapGrid::For(width, height)),
        counts_(new std::atomic<std::uint32_t>[static_cast<std::size_t>(grid_.columns) * grid_.rows] {})
  {
  }
  void Add(const PixelBox& box, int count)
  {
    ForTiles(box, [count](std::atomic<std::uint32_t>& n) { n.fetch_add(count, std::memory_order_relaxed); });
  }
  std::uint32_t Most(const PixelBox& box) const
  {
    std::uint32_t most = 0;
    ForTiles(box, [&most](const std::atomic<std::uint32_t>& n)
             { most = std::max(most, n.load(std::memory_order_relaxed)); });
    return most;
  }

private:
  template <class Body>
  void ForTiles(const PixelBox& box, Body&& body) const
  {
    const PixelBox tiles = grid_.TilesOf(box);
    for (std::int64_t row = tiles.rowBegin; row < tiles.rowEnd; ++row)
    {
      for (std::int64_t column = tiles.columnBegin; column < tiles.columnEnd; ++column)
      {
        body(counts_[static_cast<std::size_t>(row) * grid_.columns + column]);
      }
    }
  }

  OverlapGrid grid_;
  std::unique_ptr<std::atomic<std::uint32_t>[]> counts_;
};

template <class T>
class CpuEngine final : public Engine
{
public:
  std::string Device() const override
  {
    return std::string("CPU (") + (sizeof(T) == 8 ? "double, " : "") + kernels_.instructionSet + ", " +
           std::to_string(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism)) +
           " threads)";
  }

  void SetField(const GaussianField& field, const std::vector<int>* parents) override
  {
    field.Validate();
    if (field.Size() > std::numeric_limits<std::uint32_t>::max())
    {
      throw Error("CPU engine: " + std::to_string(field.Size()) + " Gaussians are more than 2^32 - 1.");
    }
    std::vector<std::uint32_t> order = MortonOrder(field.means);
    const std::size_t blocks = NumberOfBlocks(field.Size());
    InheritAdam(order, blocks, parents);
    order_ = std::move(order);
    beam_ = field.beam;
    transfer_ = field.transfer;
    blocks_.assign(blocks, {});
    places_.assign(blocks, {});
    groupsAreStale_ = true;
    sharp_.clear();
    sharp_.resize(blocks);
    tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t b) { FillBlock(field, b); });
    gradient_ = {};
    scores_ = {};
    keepScores_ = false;
  }

  GaussianField GetField() const override
  {
    GaussianField field;
    field.beam = beam_;
    field.transfer = transfer_;
    field.Resize(order_.size());
    tbb::parallel_for(
        std::size_t(0), order_.size(),
        [&](std::size_t slot)
        { UnpackGaussian(blocks_[slot / kBlock], slot % kBlock, places_[slot / kBlock], order_[slot], field); });
    return field;
  }

  std::size_t FieldSize() const override { return order_.size(); }
  void SetAccuracy(const Accuracy& accuracy) override { accuracy_ = accuracy; }

  void Render(const SlicePlane& plane, const Window& window, ViewOutput output, float* image, float* coverage) override
  {
    plane.Validate("slice plane");
    CheckWindow(plane, window.firstColumn, window.firstRow, window.columns, window.rows);
    if (std::max(plane.width, plane.height) > kLargestImage)
    {
      throw Error("CPU engine: a plane of " + std::to_string(plane.width) + " x " + std::to_string(plane.height) +
                  " pixels is larger than 16777216 along a side.");
    }
    const std::vector<Camera> cameras{CameraOf(plane, beam_)};
    FindVisible(cameras, plane.width, plane.height, window, FootprintsFor::Rendering);
    const std::size_t stride = static_cast<std::size_t>(window.columns) + kRowPadding;
    ForBands(1, window.rows,
             [&](int, int begin, int end)
             {
               const int firstRow = window.firstRow + begin, lastRow = window.firstRow + end;
               std::vector<T>& buffer = bandBuffers_.local();  // kept: fresh memory would cost as much as its pixels
               buffer.assign(stride * (end - begin), T(0));
               const PixelRows<T> rows{buffer.data(), window.firstColumn, firstRow, stride};
               AddVisible(0, firstRow, lastRow, rows, [this](std::size_t b) { return blocks_[b].reflectivity; });
               for (int row = begin; row < end; ++row)
               {
                 T* line = buffer.data() + (row - begin) * stride;
                 if (output == ViewOutput::Intensity)
                 {
                   kernels_.toIntensity(line, window.columns, static_cast<T>(transfer_.gamma), line);
                 }
                 std::copy_n(line, window.columns, image + static_cast<std::size_t>(row) * window.columns);
               }
               if (coverage)
               {
                 std::fill(buffer.begin(), buffer.end(), T(0));
                 AddVisible(0, firstRow, lastRow, rows, [](std::size_t) -> const T* { return nullptr; });
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
    gradient_.assign(blocks_.size(), {});
    Backward([&](std::size_t b, const GradientBlock<T>& gradient) { gradient_[b] = gradient; });
    return value;
  }

  void Step(const LearningRates& rates, const ParameterLimits& limits) override
  {
    if (gradient_.size() != blocks_.size())
    {
      throw Error("CPU engine: Step needs the gradient of a Backpropagate with the present field.");
    }
    adam_.resize(blocks_.size());
    groupsAreStale_ = true;
    const AdamStep step(rates, limits);
    tbb::parallel_for(std::size_t(0), blocks_.size(),
                      [&](std::size_t b)
                      {
                        const FlushDenormals flush;  // as in TrainStep
                        Update(b, gradient_[b], step);
                      });
  }

  double TrainStep(const std::vector<int>& frames, const Loss& loss, const LearningRates& rates,
                   const ParameterLimits& limits) override
  {
    const double value = Forward(frames, loss);
    gradient_ = {};
    adam_.resize(blocks_.size());
    groupsAreStale_ = true;
    const AdamStep step(rates, limits);
    Backward([&](std::size_t b, const GradientBlock<T>& gradient) { Update(b, gradient, step); });
    return value;
  }

  std::uint64_t GuardedUpdates() const override { return guarded_; }

  std::size_t MemoryUse() const override
  {
    const auto bytes = [](const auto& v) { return v.capacity() * sizeof(v[0]); };
    std::size_t scattered = 0;
    for (const std::vector<T>& buffer : bandBuffers_)
    {
      scattered += bytes(buffer);
    }
    for (const auto& sharp : sharp_)
    {
      scattered += sharp ? sizeof(*sharp) : 0;
    }
    return scattered + bytes(sharp_) + bytes(order_) + bytes(blocks_) + bytes(places_) + bytes(groups_) + bytes(adam_) +
           bytes(gradient_) + bytes(scores_) + bytes(seenBlocks_) + bytes(seen_) + bytes(images_) +
           capacity_ * sizeof(VisibleSplat<T>);
  }

  double SolveReflectivities(const std::vector<int>& frames, int iterations,
                             const std::function<bool(double)>& progress) override
  {
    CheckFrames(sweep_, frames);
    // One pass over the frames for the right-hand side and one for each iteration.
    const double steps = (iterations + 1.0) * static_cast<double>(frames.size());
    double done = 0;
    std::vector<T> r(blocks_.size() * kBlock, T(0));
    for (std::size_t slot = 0; slot < order_.size(); ++slot)
    {
      r[slot] = blocks_[slot / kBlock].reflectivity[slot % kBlock];
    }
    const double residual = ConjugateGradients(
        r, iterations,
        [&](const std::vector<T>& x, bool withTarget)
        {
          std::vector<T> out(x.size(), T(0));
          for (std::size_t first = 0; first < frames.size(); first += kSolveBatch)
          {
            const std::vector<int> batch(frames.begin() + first,
                                         frames.begin() + std::min(first + kSolveBatch, frames.size()));
            ForwardFrames(batch, x.data(),
                          [&](const T* truth, const T* counts, T* line)
                          {
                            for (int column = 0; column < sweep_->width; ++column)
                            {
                              const T fade = T(1) - truth[column];
                              const T target = withTarget ? transfer_.Scattering(truth[column]) : T(0);
                              line[column] = counts[column] * fade * fade * (line[column] - target);
                            }
                            return 0.0;
                          });
            ForSeen(
                [&](std::size_t slot)
                {
                  MomentBlock<T> moments;
                  for (std::size_t f = 0; f < batch.size(); ++f)
                  {
                    const Seen& list = SeenBy(slot, f);
                    const VisibleSplat<T>* splats = splats_.get() + list.offset;
                    kernels_.gatherMoments(splats, list.count, FrameRows(f), false, moments);
                    T* sums = out.data() + seenBlocks_[slot] * std::size_t(kBlock);
                    for (int k = 0; k < list.count; ++k)
                    {
                      sums[static_cast<int>(splats[k].gaussian)] += moments.values[kMoment0][k];
                    }
                  }
                });
            done += static_cast<double>(batch.size());
            if (progress && !progress(done / steps))
            {
              return std::optional<std::vector<T>>();
            }
          }
          return std::make_optional(std::move(out));
        });
    for (std::size_t slot = 0; slot < order_.size(); ++slot)
    {
      blocks_[slot / kBlock].reflectivity[slot % kBlock] = r[slot];
    }
    tbb::parallel_for(std::size_t(0), blocks_.size(), [&](std::size_t b) { Measure(b); });
    groupsAreStale_ = true;
    return residual;
  }

  FieldGradient GetGradient() const override { return GradientOf(gradient_, order_); }
  Scores GetScores() const override { return ScoresOf(scores_, order_); }

  void ResetScores() override
  {
    keepScores_ = true;
    scores_.assign(blocks_.size(), {});
  }

private:
  static constexpr std::size_t kSolveBatch = 8;  // frames held at once while solving

  /// What one view sees of one block: splats_[offset, offset + count), all in rows [rowBegin, rowEnd).
  struct Seen
  {
    std::size_t offset;
    int count, rowBegin, rowEnd;
  };

  const Seen& SeenBy(std::size_t slot, std::size_t view) const { return seen_[slot * views_ + view]; }

  template <class Body>
  void ForSeen(Body&& body) const
  {
    tbb::parallel_for(std::size_t(0), seenBlocks_.size(),
                      [&](std::size_t slot)
                      {
                        const FlushDenormals flush;
                        body(slot);
                      });
  }

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

  // ---- Field
  // -----------------------------------------------------------------------------------------------------

  void FillBlock(const GaussianField& field, std::size_t b)
  {
    places_[b] = PlaceOf(field, order_, b);
    PackBlock(field, order_, b, places_[b], blocks_[b]);
    Measure(b);
    if (sharp_[b])
    {
      PackBlock(field, order_, b, places_[b], *sharp_[b]);  // what float has lost
    }
  }

  /// Brings a block's place, and its parameters in double if it has needles, up to date with its Gaussians.
  void Measure(std::size_t b)
  {
    BlockPlace& place = places_[b];
    const BlockBounds<T> bounds = kernels_.boundsOf(blocks_[b], place.count);
    const auto range = [&](int axis, double centre, double& middle, double& half)
    {
      const double low = bounds.low[axis], high = bounds.high[axis];
      middle = centre + 0.5 * (low + high);
      half = 0.5 * (high - low);
    };
    range(0, place.centre.x, place.middle.x, place.half.x);
    range(1, place.centre.y, place.middle.y, place.half.y);
    range(2, place.centre.z, place.middle.z, place.half.z);
    place.variance = std::exp(2.0 * bounds.logScale);
    place.logMagnitude = std::log(static_cast<double>(bounds.magnitude));  // of 0: -infinity, never seen
    if (sizeof(T) == sizeof(double) || !(bounds.logAspect > kLogSharp))
    {
      sharp_[b].reset();
      return;
    }
    if (!sharp_[b])
    {
      sharp_[b].reset(new GaussianBlock<double>);
    }
    const GaussianBlock<T>& from = blocks_[b];
    GaussianBlock<double>& to = *sharp_[b];
    std::copy_n(from.mean[0], 3 * kBlock, to.mean[0]);
    std::copy_n(from.logScale[0], 3 * kBlock, to.logScale[0]);
    std::copy_n(from.reflectivity, kBlock, to.reflectivity);
    for (int k = 0; k < kBlock; ++k)
    {
      const Eigen::Vector4d q =
          Eigen::Vector4d(from.rotation[0][k], from.rotation[1][k], from.rotation[2][k], from.rotation[3][k])
              .normalized();
      for (int part = 0; part < 4; ++part)
      {
        to.rotation[part][k] = q[part];
      }
    }
  }

  /// Brings the places of groups up to date with those of their blocks, if any has changed.
  void MeasureGroups()
  {
    if (!std::exchange(groupsAreStale_, false))
    {
      return;
    }
    groups_.resize((blocks_.size() + kGroup - 1) / kGroup);
    tbb::parallel_for(std::size_t(0), groups_.size(),
                      [&](std::size_t g)
                      {
                        BlockPlace group = places_[g * kGroup];
                        Vector3<double> low = MultiplyAdd(-1.0, group.half, group.middle);
                        Vector3<double> high = MultiplyAdd(1.0, group.half, group.middle);
                        for (std::size_t b = g * kGroup; b < std::min((g + 1) * kGroup, blocks_.size()); ++b)
                        {
                          const BlockPlace& place = places_[b];
                          const Vector3<double> from = MultiplyAdd(-1.0, place.half, place.middle);
                          const Vector3<double> to = MultiplyAdd(1.0, place.half, place.middle);
                          low = {min(low.x, from.x), min(low.y, from.y), min(low.z, from.z)};
                          high = {max(high.x, to.x), max(high.y, to.y), max(high.z, to.z)};
                          group.variance = max(group.variance, place.variance);
                          group.logMagnitude = max(group.logMagnitude, place.logMagnitude);
                        }
                        group.half = Scaled(0.5, MultiplyAdd(-1.0, low, high));
                        group.middle = MultiplyAdd(1.0, group.half, low);
                        groups_[g] = group;
                      });
  }

  /// The optimizer's averages for a new order of a restructured field. Must be called while order_ is still
  /// the old.
  void InheritAdam(const std::vector<std::uint32_t>& order, std::size_t blocks, const std::vector<int>* parents)
  {
    if (!parents)
    {
      adam_ = {};
      guarded_ = 0;
      return;
    }
    const std::vector<std::int64_t> slots = InheritedSlots(order_, order, *parents);
    if (adam_.empty())
    {
      return;
    }
    std::vector<AdamBlock<T>> adam(blocks, AdamBlock<T>{});
    for (std::size_t slot = 0; slot < slots.size(); ++slot)
    {
      if (slots[slot] < 0)
      {
        continue;
      }
      const AdamBlock<T>& from = adam_[slots[slot] / kBlock];
      AdamBlock<T>& to = adam[slot / kBlock];
      const std::size_t i = slots[slot] % kBlock, k = slot % kBlock;
      for (int p = 0; p < kParametersPerGaussian; ++p)
      {
        to.first[p][k] = from.first[p][i];
        to.second[p][k] = from.second[p][i];
      }
      to.updates[k] = from.updates[i];
    }
    adam_ = std::move(adam);
  }

  void Update(std::size_t b, const GradientBlock<T>& gradient, const AdamStep& step)
  {
    const int guarded = kernels_.updateBlock(blocks_[b], adam_[b], gradient, places_[b].count, step);
    if (guarded > 0)
    {
      guarded_ += guarded;
    }
    Measure(b);
  }

  // ---- What is seen
  // ----------------------------------------------------------------------------------------------

  static PixelBox PixelsOf(const Window& window)
  {
    return {window.firstColumn, window.firstColumn + window.columns, window.firstRow, window.firstRow + window.rows};
  }

  /// Projects a block, in double if it is sharp; each of its Gaussians may drop `share`. Returns how many splats were
  /// found.
  int Project(std::size_t b, const Camera& camera, const Window& window, double slab, double share,
              const Truncation& truncation, SplatBuffer<T>& found) const
  {
    const BlockPlace& place = places_[b];
    const auto task = [&](auto number)
    {
      using U = decltype(number);
      ProjectionTask<U> out;
      out.view = LocalView<U>(camera, place, out.originColumn, out.originRow);
      out.columnBegin = window.firstColumn;
      out.columnEnd = window.firstColumn + window.columns;
      out.rowBegin = window.firstRow;
      out.rowEnd = window.firstRow + window.rows;
      out.slab = static_cast<U>(std::min(slab, 1e30));
      out.tolerance = static_cast<U>(share);
      out.commonMagnitude = static_cast<U>(truncation.commonMagnitude);
      out.leastMagnitude = static_cast<U>(truncation.leastMagnitude);
      out.direct = accuracy_.direct;
      out.lowestExponent = kLowestExponent<T>;
      return out;
    };
    if (!sharp_[b])
    {
      return kernels_.projectBlock(blocks_[b], place.count, task(T()), found);
    }
    SplatBuffer<double> exact;
    const int count = doubleKernels_.projectBlock(*sharp_[b], place.count, task(double()), exact);
    for (int f = 0; f < kSplatFields; ++f)
    {
      std::copy_n(exact.fields[f], count, found.fields[f]);
    }
    return count;
  }

  /// Fills seenBlocks_, seen_ and splats_ with what the cameras see inside the window of their width x height
  /// images.
  void FindVisible(const std::vector<Camera>& cameras, int width, int height, const Window& window,
                   FootprintsFor purpose)
  {
    const Truncation truncation =
        Truncation::For(purpose, accuracy_.tolerance / transfer_.gamma, accuracy_.perSplat, order_.size(),
                        purpose == FootprintsFor::Solving ? MeanMagnitude() : 0.0);
    const PixelBox whole{0, width, 0, height};
    views_ = cameras.size();
    std::vector<TileCounts> overlaps;
    for (std::size_t f = 0; f < (truncation.isShared ? cameras.size() : 0); ++f)
    {
      overlaps.emplace_back(width, height);
    }

    MeasureGroups();
    std::vector<std::uint8_t> reached(blocks_.size());
    const auto lookInto = [&](std::size_t b)
    {
      const BlockPlace& place = places_[b];
      const double logMagnitude = truncation.LogMagnitude(place);
      for (std::size_t f = 0; f < cameras.size() && (truncation.isShared || !reached[b]); ++f)
      {
        Reach reach;
        if (!Reaches<T>(place, cameras[f], logMagnitude, truncation.logFloor, reach) || !Overlap(reach.box, whole))
        {
          continue;
        }
        reached[b] = 1;
        if (truncation.isShared)
        {
          std::int32_t column, row;
          const View<T> view = LocalView<T>(cameras[f], place, column, row);
          const T slab = static_cast<T>(std::min(reach.slab, 1e30));
          overlaps[f].Add(reach.box, kernels_.countInSlab(blocks_[b], place.count, view, slab));
        }
      }
    };
    tbb::parallel_for(
        std::size_t(0), groups_.size(),
        [&](std::size_t g)
        {
          const double logMagnitude = truncation.LogMagnitude(groups_[g]);
          Reach reach;
          if (std::none_of(cameras.begin(), cameras.end(),
                           [&](const Camera& camera)
                           { return Reaches<T>(groups_[g], camera, logMagnitude, truncation.logFloor, reach); }))
          {
            return;
          }
          for (std::size_t b = g * kGroup; b < std::min((g + 1) * kGroup, blocks_.size()); ++b)
          {
            lookInto(b);
          }
        });
    seenBlocks_.clear();
    for (std::size_t b = 0; b < blocks_.size(); ++b)
    {
      if (reached[b])
      {
        seenBlocks_.push_back(static_cast<std::uint32_t>(b));
      }
    }

    seen_.resize(seenBlocks_.size() * cameras.size());
    std::atomic<std::size_t> used;
    do
    {
      // Where a list begins depends on the order in which blocks finish; what it holds does not. When room
      // runs out the pass goes on to learn how much is needed, and is repeated.
      if (used = 0; needed_ > capacity_)
      {
        capacity_ = needed_ + needed_ / 32;
        splats_.reset();
        splats_.reset(new VisibleSplat<T>[capacity_]);
      }
      ForSeen(
          [&](std::size_t slot)
          {
            const std::size_t b = seenBlocks_[slot];
            const BlockPlace& place = places_[b];
            const double logMagnitude = truncation.LogMagnitude(place);
            Reach reach;
            std::uint32_t most = 1;
            if (truncation.isShared)
            {
              for (std::size_t f = 0; f < cameras.size(); ++f)
              {
                if (Reaches<T>(place, cameras[f], logMagnitude, truncation.logFloor, reach))
                {
                  most = std::max(most, overlaps[f].Most(reach.box));
                }
              }
            }
            const double share = truncation.Share(most);
            const double logShare = std::log(share);
            SplatBuffer<T> found;
            for (std::size_t f = 0; f < cameras.size(); ++f)
            {
              Seen& list = seen_[slot * cameras.size() + f];
              list = {0, 0, 0, 0};
              if (!Reaches<T>(place, cameras[f], logMagnitude, logShare, reach) ||
                  !Overlap(reach.box, PixelsOf(window)))
              {
                continue;
              }
              list.count = Project(b, cameras[f], window, reach.slab, share, truncation, found);
              if (list.count == 0)
              {
                continue;
              }
              const T *rowBegin = found.fields[kRowBegin], *rowEnd = found.fields[kRowEnd];
              list.rowBegin = static_cast<int>(*std::min_element(rowBegin, rowBegin + list.count));
              list.rowEnd = static_cast<int>(*std::max_element(rowEnd, rowEnd + list.count));
              list.offset = used.fetch_add(list.count, std::memory_order_relaxed);
              if (list.offset + list.count <= capacity_)
              {
                found.Store(list.count, splats_.get() + list.offset);
              }
            }
          });
      needed_ = used;
    } while (needed_ > capacity_);
  }

  /// Adds all that a view sees to some rows of its image: footprints times valuesOf(block), which gives
  /// kBlock numbers or null for 1.
  template <class ValuesOf>
  void AddVisible(std::size_t view, int rowBegin, int rowEnd, const PixelRows<T>& rows, ValuesOf&& valuesOf) const
  {
    for (std::size_t slot = 0; slot < seenBlocks_.size(); ++slot)
    {
      const Seen& list = SeenBy(slot, view);
      if (list.count > 0 && list.rowBegin < rowEnd && list.rowEnd > rowBegin)
      {
        kernels_.addFootprints(splats_.get() + list.offset, list.count, valuesOf(seenBlocks_[slot]), rowBegin, rowEnd,
                               rows);
      }
    }
  }

  /// Of the field's |r|; 1 where all are 0.
  double MeanMagnitude() const
  {
    double sum = 0;
    for (const GaussianBlock<T>& block : blocks_)
    {
      for (const T r : block.reflectivity)
      {
        sum += std::abs(static_cast<double>(r));
      }
    }
    return sum > 0 ? sum / static_cast<double>(order_.size()) : 1.0;
  }

  // ---- Training
  // --------------------------------------------------------------------------------------------------

  PixelRows<T> FrameRows(std::size_t f)
  {
    const std::size_t stride = static_cast<std::size_t>(sweep_->width) + kRowPadding;
    return {images_.data() + f * stride * sweep_->height, 0, 0, stride};
  }

  /// Renders the frames into images_ (of given values, by slot, if not null) and calls line(truth, counts,
  /// S) for every row, which replaces S by what is to be propagated back. counts is 1 where a pixel
  /// counts and 0 elsewhere. Returns the sum of the results.
  template <class Line>
  double ForwardFrames(const std::vector<int>& frames, const T* values, Line&& line)
  {
    cameras_.clear();
    for (int frame : frames)
    {
      cameras_.push_back(CameraOf(sweep_->Plane(frame), beam_));
    }
    const int width = sweep_->width, height = sweep_->height;
    FindVisible(cameras_, width, height, {0, 0, width, height},
                values ? FootprintsFor::Solving : FootprintsFor::Training);
    const std::size_t stride = static_cast<std::size_t>(width) + kRowPadding;
    images_.resize(frames.size() * stride * height);
    std::vector<double> sums(frames.size() * height);  // of rows: no order to depend on
    ForBands(static_cast<int>(frames.size()), height,
             [&](int f, int begin, int end)
             {
               const PixelRows<T> rows = FrameRows(f);
               std::fill(rows.Row(begin), rows.Row(end), T(0));
               AddVisible(f, begin, end, rows,
                          [this, values](std::size_t b)
                          { return values ? values + b * kBlock : blocks_[b].reflectivity; });
               std::vector<T> truth(stride, T(0)), counts(stride, T(0));
               for (int row = begin; row < end; ++row)
               {
                 const std::size_t pixel = static_cast<std::size_t>(row) * width;
                 ReadTruth(frames[f] * sweep_->PixelsPerFrame() + pixel, truth.data());
                 ReadCounts(row, counts.data());
                 sums[static_cast<std::size_t>(f) * height + row] = line(truth.data(), counts.data(), rows.Row(row));
               }
             });
    double total = 0;
    for (double sum : sums)
    {
      total += sum;
    }
    return total;
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
      return kernels_.toDerivative(static_cast<T>(loss.l1), static_cast<T>(loss.l2), static_cast<T>(transfer_.gamma),
                                   truth, weights, others, sweep_->width, line);
    };
    if (loss.IsPixelwise())
    {
      return ForwardFrames(frames, nullptr,
                           [&](const T* truth, T* weights, T* line)
                           { return toDerivative(truth, weights, nullptr, line); });
    }

    // Terms that look at whole images need all their rows: I of each frame, then dL/dI, then dL/dS.
    ForwardFrames(frames, nullptr, [](const T*, T*, T*) { return 0.0; });
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
                   kernels_.toIntensity(rows.Row(row), width, static_cast<T>(transfer_.gamma),
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

  /// spend(block, gradient) for every block that the frames of the last Forward saw.
  template <class Spend>
  void Backward(Spend&& spend)
  {
    if (keepScores_)
    {
      scores_.resize(blocks_.size());
    }
    ForSeen(
        [&](std::size_t slot)
        {
          const std::size_t b = seenBlocks_[slot];
          GradientBlock<T> gradient{};
          MomentBlock<T> moments;
          ScoreBlock<T>* scores = keepScores_ ? &scores_[b] : nullptr;
          for (std::size_t f = 0; f < views_; ++f)
          {
            const Seen& list = SeenBy(slot, f);
            if (list.count == 0)
            {
              continue;
            }
            const VisibleSplat<T>* splats = splats_.get() + list.offset;
            kernels_.gatherMoments(splats, list.count, FrameRows(f), keepScores_, moments);
            std::int32_t column, row;
            const View<T> view = LocalView<T>(cameras_[f], places_[b], column, row);
            kernels_.addAdjoints(blocks_[b], view, splats, list.count, moments, gradient, scores);
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
  const Kernels<double> doubleKernels_ = KernelsOfThisMachine<double>();
  std::vector<std::uint32_t> order_;  // slot -> index in the field
  std::vector<GaussianBlock<T>> blocks_;
  std::vector<BlockPlace> places_, groups_;  // of blocks, and of kGroup blocks
  bool groupsAreStale_ = true;
  std::vector<std::unique_ptr<GaussianBlock<double>>> sharp_;  // of float blocks with needles
  std::vector<AdamBlock<T>> adam_;                             // empty until the first step
  std::vector<GradientBlock<T>> gradient_;                     // empty but after Backpropagate
  std::vector<ScoreBlock<T>> scores_;
  bool keepScores_ = false;
  std::atomic<std::uint64_t> guarded_{0};
  Beam beam_;
  TransferFunction transfer_;
  Accuracy accuracy_;

  std::shared_ptr<const Sweep> sweep_;
  std::size_t countedPixels_ = 0;
  std::optional<ImageLoss> imageLoss_;  // of the frames' size and mask

  // The last FindVisible and ForwardFrames.
  std::vector<std::uint32_t> seenBlocks_;
  std::vector<Seen> seen_;  // [seenBlocks_][views_]
  std::size_t views_ = 0;
  std::unique_ptr<VisibleSplat<T>[]> splats_;
  std::size_t capacity_ = 0, needed_ = 0;
  std::vector<Camera> cameras_;
  std::vector<T> images_;
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
