// The CPU engine: float factor form, TBB, slab culling, amplitude-aware truncation, and a backward pass that
// gathers.
//
// Work is cut into fixed chunks of Gaussians and fixed bands of rows, never by the number of threads; a band
// adds its splats in the order of the Gaussians, a chunk adds its gradients in the order of the frames. So
// the bits do not depend on how many threads there are, and nothing needs an atomic.

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include "CpuKernels.h"
#include "Engine.h"
#include "EngineDetail.h"
#include "Optimizer.h"

namespace bigus
{
namespace
{

constexpr std::size_t kChunk =
    1024;                  // Gaussians projected together: enough work for a task, small enough to balance
constexpr int kBand = 32;  // rows rendered together: a few of them keep every core busy
constexpr float kNegligible = 1e-37f;  // below this an amplitude would be denormal
constexpr float kLowestExponent =
    -85.0f;  // exp(-85) = 1e-37: recurrences stay clear of denormals and of infinity

class CpuEngine final : public Engine
{
public:
  std::string Device() const override
  {
    return std::string("CPU (") + SimdName() + ", " +
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
    origin_ = MiddleOf(field);
    beam_ = field.beam;
    transfer_ = field.transfer;
    gaussians_ = PackField<float>(field, origin_);
    chunks_.assign((gaussians_.size() + kChunk - 1) / kChunk, {});
    adam_ = InheritState(adam_, parents ? field.Size() : 0, parents);
    if (!parents)
    {
      iteration_ = 0;
    }
    gradient_.clear();
    scores_.clear();
  }

  GaussianField GetField() const override { return UnpackField(gaussians_, origin_, beam_, transfer_); }
  std::size_t FieldSize() const override { return gaussians_.size(); }
  void SetAccuracy(const Accuracy& accuracy) override { accuracy_ = accuracy; }

  void Render(const SlicePlane& plane, const Window& window, ViewOutput output, float* image,
              float* coverage) override
  {
    plane.Validate("slice plane");
    CheckWindow(plane, window.firstColumn, window.firstRow, window.columns, window.rows);
    const std::vector<View<float>> views{MakeView<float>(plane, beam_, origin_)};
    // The tolerance is shared out over the Gaussians that reach the whole plane's slab, whatever the window:
    // so a window holds the very bits of the whole.
    const float tolerance = SplatTolerance(views[0]);
    FindVisible(views, window, Multiplier::Reflectivity, nullptr, tolerance);
    const std::size_t stride = static_cast<std::size_t>(window.columns) + kRowPadding;
    ForBands(1, window.rows,
             [&](int, int begin, int end)
             {
               std::vector<float> scattering(stride * (end - begin), 0.0f);
               std::vector<float> support(coverage ? scattering.size() : 0, 0.0f);
               const int firstRow = window.firstRow + begin;
               const PixelRows rows{scattering.data(), window.firstColumn, firstRow, stride};
               const PixelRows supportRows{coverage ? support.data() : nullptr, window.firstColumn, firstRow,
                                           stride};
               for (const Chunk& chunk : chunks_)
               {
                 AddFootprints(chunk.visible[0].data(), chunk.visible[0].size(), firstRow,
                               window.firstRow + end, rows, supportRows);
               }
               for (int row = begin; row < end; ++row)
               {
                 const float* in = scattering.data() + (row - begin) * stride;
                 float* out = image + static_cast<std::size_t>(row) * window.columns;
                 for (int column = 0; column < window.columns; ++column)
                 {
                   out[column] =
                       output == ViewOutput::Intensity ? transfer_.Intensity(in[column]) : in[column];
                 }
                 if (coverage)
                 {
                   std::copy_n(support.data() + (row - begin) * stride, window.columns,
                               coverage + static_cast<std::size_t>(row) * window.columns);
                 }
               }
             });
  }

  void SetFrames(std::shared_ptr<const Sweep> sweep, bool ignoreMasked) override
  {
    sweep->Validate();
    sweep_ = std::move(sweep);
    ignoreMasked_ = ignoreMasked;
    countedPixels_ = 0;
    for (std::size_t pixel = 0; pixel < sweep_->PixelsPerFrame(); ++pixel)
    {
      countedPixels_ += Counts(pixel);
    }
  }

  double Backpropagate(const std::vector<int>& frames, LossKind kind) override
  {
    CheckFrames(sweep_, frames);
    gradient_.assign(gaussians_.size(), {});
    scores_.resize(gaussians_.size());
    const float share =
        static_cast<float>(1.0 / (static_cast<double>(std::max<std::size_t>(countedPixels_, 1)) *
                                  static_cast<double>(frames.size())));
    const double loss = ForwardFrames(frames, Multiplier::Reflectivity, nullptr,
                                      [&](int frame, float scattering, float truth, float& derivative)
                                      {
                                        const PixelLoss<float> value =
                                            EvaluateLoss<float>(kind, transfer_, scattering, truth);
                                        const float weight = share * sweep_->Weight(frame);
                                        derivative = weight * value.derivative;
                                        return static_cast<double>(weight) * value.loss;
                                      });
    ForChunks(
        [&](std::size_t c)
        {
          std::vector<Moments<float>> moments;
          for (std::size_t f = 0; f < frames.size(); ++f)
          {
            const std::vector<VisibleSplat>& visible = chunks_[c].visible[f];
            moments.resize(visible.size());
            GatherMoments(visible.data(), visible.size(), FrameRows(f), moments.data());
            for (std::size_t k = 0; k < visible.size(); ++k)
            {
              const std::uint32_t i = visible[k].gaussian;
              // Projected again rather than carrying 25 floats a splat through memory.
              const Projection<float> projection = Project(gaussians_[i], views_[f]);
              const GaussianGradient<float> g = ProjectAdjoint(gaussians_[i], projection, moments[k]);
              AddTo(gradient_[i], g);
              scores_[i].error += moments[k].error;
              scores_[i].visits += 1.0f;
              scores_[i].descent = MultiplyAdd(-1.0f, g.mean, scores_[i].descent);
            }
          }
        });
    return loss;
  }

  void Step(const LearningRates& rates, const ParameterLimits& limits) override
  {
    if (gradient_.size() != gaussians_.size())
    {
      throw Error("CPU engine: Step needs the gradient of a Backpropagate with the present field.");
    }
    adam_.resize(gaussians_.size());
    const AdamStep<float> step(rates, limits, ++iteration_);
    ForChunks(
        [&](std::size_t c)
        {
          const std::size_t end = std::min((c + 1) * kChunk, gaussians_.size());
          for (std::size_t i = c * kChunk; i < end; ++i)
          {
            UpdateGaussian(gaussians_[i], adam_[i], gradient_[i], step);
          }
        });
  }

  double TrainStep(const std::vector<int>& frames, LossKind loss, const LearningRates& rates,
                   const ParameterLimits& limits) override
  {
    const double value = Backpropagate(frames, loss);
    Step(rates, limits);
    return value;
  }

  std::uint64_t GuardedUpdates() const override { return 0; }
  std::size_t MemoryUse() const override { return 0; }

  double SolveReflectivities(const std::vector<int>& frames, int iterations,
                             const std::function<bool(double)>& progress) override
  {
    CheckFrames(sweep_, frames);
    // One pass over the frames for the right-hand side and one for each iteration.
    const double steps = (iterations + 1.0) * static_cast<double>(frames.size());
    double done = 0;
    std::vector<float> r(gaussians_.size());
    for (std::size_t i = 0; i < r.size(); ++i)
    {
      r[i] = gaussians_[i].reflectivity;
    }
    const double residual = ConjugateGradients(
        r, iterations,
        [&](const std::vector<float>& x, bool withTarget)
        {
          std::vector<float> out(x.size(), 0.0f);
          for (std::size_t first = 0; first < frames.size(); first += kSolveBatch)
          {
            const std::vector<int> batch(frames.begin() + first,
                                         frames.begin() + std::min(first + kSolveBatch, frames.size()));
            ForwardFrames(batch, Multiplier::Given, x.data(),
                          [&](int frame, float scattering, float truth, float& derivative)
                          {
                            const float fade = 1.0f - truth;
                            const float target = withTarget ? transfer_.Scattering(truth) : 0.0f;
                            derivative = sweep_->Weight(frame) * fade * fade * (scattering - target);
                            return 0.0;
                          });
            ForChunks(
                [&](std::size_t c)
                {
                  std::vector<Moments<float>> moments;
                  for (std::size_t f = 0; f < batch.size(); ++f)
                  {
                    const std::vector<VisibleSplat>& visible = chunks_[c].visible[f];
                    moments.resize(visible.size());
                    GatherMoments(visible.data(), visible.size(), FrameRows(f), moments.data());
                    for (std::size_t k = 0; k < visible.size(); ++k)
                    {
                      out[visible[k].gaussian] += moments[k].m0;
                    }
                  }
                });
            done += static_cast<double>(batch.size());
            if (progress && !progress(done / steps))
            {
              return std::vector<float>();
            }
          }
          return out;
        });
    for (std::size_t i = 0; i < r.size(); ++i)
    {
      gaussians_[i].reflectivity = r[i];
    }
    return residual;
  }

  FieldGradient GetGradient() const override { return UnpackGradient(gradient_); }

  Scores GetScores() const override
  {
    Scores out;
    for (const Score& score : scores_)
    {
      out.error.push_back(score.error);
      out.descent.push_back(FromVector3(score.descent));
      out.visits.push_back(score.visits);
    }
    out.error.resize(gaussians_.size(), 0.0);
    out.descent.resize(gaussians_.size(), Eigen::Vector3d::Zero());
    out.visits.resize(gaussians_.size(), 0.0);
    return out;
  }

  void ResetScores() override { scores_.clear(); }

private:
  static constexpr std::size_t kSolveBatch = 8;  // frames held at once while solving

  /// What a footprint is multiplied with.
  enum class Multiplier
  {
    Reflectivity,  ///< the Gaussian's own
    Given          ///< an array's; footprints are then cut as if every |r| were the field's mean
  };

  struct Score
  {
    float error = 0, visits = 0;
    Vector3<float> descent{0, 0, 0};
  };

  /// The splats of kChunk neighbouring Gaussians, for each view in hand.
  struct Chunk
  {
    std::vector<std::vector<VisibleSplat>> visible;
  };

  bool Counts(std::size_t pixel) const { return !ignoreMasked_ || sweep_->IsLit(pixel); }

  template <class Body>
  void ForChunks(Body&& body) const
  {
    tbb::parallel_for(std::size_t(0), chunks_.size(), body);
  }

  /// body(image, first row, last row) for every band of every image.
  template <class Body>
  static void ForBands(int images, int rows, Body&& body)
  {
    const int bands = (rows + kBand - 1) / kBand;
    tbb::parallel_for(std::size_t(0), static_cast<std::size_t>(images) * bands,
                      [&](std::size_t task)
                      {
                        const int begin = static_cast<int>(task % bands) * kBand;
                        body(static_cast<int>(task / bands), begin, std::min(begin + kBand, rows));
                      });
  }

  /// ln(|r| amplitude / eps) bounds how far a Gaussian matters; this is the squared number of standard
  /// deviations.
  static float CutFor(float magnitude, float tolerance)
  {
    // With no tolerance the footprint ends where float underflows: exp(-k^2 / 2) at k^2 = 180 is 1e-39.
    constexpr float kEverything = 180.0f;
    if (!(tolerance > 0))
    {
      return magnitude > 0 ? kEverything : 0.0f;
    }
    return magnitude > tolerance ? std::min(2.0f * std::log(magnitude / tolerance), kEverything) : 0.0f;
  }

  /// Squared distance (mm^2) from a plane beyond which Gaussian i cannot matter: the exact slab test
  /// mu_z^2 <= k^2 t with t at its largest, s_max^2 + sigma_E^2.
  float ReachSquared(const Gaussian<float>& gaussian, float magnitude, float tolerance) const
  {
    const float largest =
        std::exp(2.0f * std::max({gaussian.logScale.x, gaussian.logScale.y, gaussian.logScale.z}));
    return CutFor(magnitude, tolerance) *
           (largest + static_cast<float>(beam_.elevationSigma * beam_.elevationSigma));
  }

  /// The tolerance of one splat. Shared out, so that the sum of all that is dropped at a pixel stays below
  /// it.
  float SplatTolerance(const View<float>& view) const
  {
    const float tolerance = static_cast<float>(accuracy_.tolerance / transfer_.gamma);
    if (accuracy_.perSplat || tolerance == 0)
    {
      return tolerance;
    }
    // A splat whose peak is below tolerance / size is dropped whole; all of them together stay below the
    // tolerance, so half of it goes to them and half to the tails of the rest.
    const float floor = tolerance / (2.0f * static_cast<float>(std::max<std::size_t>(gaussians_.size(), 1)));
    std::vector<std::size_t> counts(chunks_.size(), 0);
    ForChunks(
        [&](std::size_t c)
        {
          const std::size_t end = std::min((c + 1) * kChunk, gaussians_.size());
          for (std::size_t i = c * kChunk; i < end; ++i)
          {
            const float z = Dot(view.n, MultiplyAdd(-1.0f, view.origin, gaussians_[i].mean));
            counts[c] += z * z <= ReachSquared(gaussians_[i], std::abs(gaussians_[i].reflectivity), floor);
          }
        });
    std::size_t reached = 0;
    for (std::size_t count : counts)
    {
      reached += count;
    }
    return 0.5f * tolerance / static_cast<float>(std::max<std::size_t>(reached, 1));
  }

  /// Fills chunks_[c].visible[view] with what each view sees of each chunk inside the window.
  void FindVisible(const std::vector<View<float>>& views, const Window& window, Multiplier multiplier,
                   const float* given, float tolerance)
  {
    float common = 0;
    if (multiplier == Multiplier::Given)
    {
      double sum = 0;
      for (const Gaussian<float>& gaussian : gaussians_)
      {
        sum += std::abs(gaussian.reflectivity);
      }
      common = sum > 0 ? static_cast<float>(sum / static_cast<double>(gaussians_.size())) : 1.0f;
    }
    ForChunks(
        [&](std::size_t c)
        {
          std::vector<std::vector<VisibleSplat>>& visible = chunks_[c].visible;
          visible.resize(views.size());
          for (std::vector<VisibleSplat>& list : visible)
          {
            list.clear();
          }
          const std::size_t end = std::min((c + 1) * kChunk, gaussians_.size());
          for (std::size_t i = c * kChunk; i < end; ++i)
          {
            const Gaussian<float>& gaussian = gaussians_[i];
            const float value = given ? given[i] : gaussian.reflectivity;
            const float magnitude = multiplier == Multiplier::Given ? common : std::abs(value);
            const float reach = ReachSquared(gaussian, magnitude, tolerance);
            for (std::size_t f = 0; f < views.size(); ++f)
            {
              const float z = Dot(views[f].n, MultiplyAdd(-1.0f, views[f].origin, gaussian.mean));
              if (z * z > reach)
              {
                continue;
              }
              VisibleSplat s;
              s.splat = Project(gaussian, views[f]).splat;
              s.cut = CutFor(magnitude * s.splat.amplitude, tolerance);
              if (!(s.splat.amplitude > kNegligible) || !(s.cut > 0))
              {
                continue;
              }
              s.logAmplitude = std::log(s.splat.amplitude);
              if (!Clip(window, accuracy_.direct, s))
              {
                continue;
              }
              s.value = value;
              s.gaussian = static_cast<std::uint32_t>(i);
              visible[f].push_back(s);
            }
          }
        });
  }

  /// Bounds the ellipse |U (p - m)|^2 <= cut by rows and columns of the window; false when nothing is left.
  /// Chooses between recurrence and direct evaluation from the unclipped box, so that the choice is the same
  /// for any window.
  static bool Clip(const Window& window, bool direct, VisibleSplat& s)
  {
    const float k = std::sqrt(s.cut);
    const float halfV = k / s.splat.u22;
    const float halfU =
        k * std::sqrt(1.0f + (s.splat.u12 / s.splat.u22) * (s.splat.u12 / s.splat.u22)) / s.splat.u11;
    const auto clamp = [](float value, int first, int count)
    {
      return static_cast<int>(
          std::min(std::max(value, static_cast<float>(first)), static_cast<float>(first + count)));
    };
    s.columnBegin = clamp(std::ceil(s.splat.mu - halfU), window.firstColumn, window.columns);
    s.columnEnd = clamp(std::floor(s.splat.mu + halfU) + 1.0f, window.firstColumn, window.columns);
    s.rowBegin = clamp(std::ceil(s.splat.mv - halfV), window.firstRow, window.rows);
    s.rowEnd = clamp(std::floor(s.splat.mv + halfV) + 1.0f, window.firstRow, window.rows);
    constexpr float kFarRow = 1e9f;
    s.firstRow = static_cast<int>(std::min(std::max(std::ceil(s.splat.mv - halfV), -kFarRow), kFarRow));

    // The lowest exponent in the box is at a corner, |eta1| = largest, |eta2| = k; ln q is linear and largest
    // there too.
    const float curvature = s.splat.u12 * s.splat.u12 + s.splat.u22 * s.splat.u22;
    const float largest = s.splat.u11 * halfU + std::abs(s.splat.u12) * halfV;
    const float lowest = s.logAmplitude - 0.5f * (largest * largest + s.cut);
    const float steepest = std::abs(s.splat.u12) * largest + s.splat.u22 * k + 0.5f * curvature;
    // !(a && b) rather than its inverse, so that a NaN chooses direct.
    s.direct = direct || !(lowest > kLowestExponent && steepest < -kLowestExponent);
    s.rowFactor = s.direct ? 0.0f : std::exp(-curvature);
    return s.columnBegin < s.columnEnd && s.rowBegin < s.rowEnd;
  }

  PixelRows FrameRows(std::size_t slot)
  {
    const std::size_t stride = static_cast<std::size_t>(sweep_->width) + kRowPadding;
    return {images_.data() + slot * stride * sweep_->height, 0, 0, stride};
  }

  /// Renders the frames into images_, then replaces each counted pixel by what pixel(frame, S, truth, out)
  /// writes to `out` (other pixels become 0) and returns the sum of its results.
  template <class Pixel>
  double ForwardFrames(const std::vector<int>& frames, Multiplier multiplier, const float* given,
                       Pixel&& pixel)
  {
    views_.clear();
    for (int frame : frames)
    {
      views_.push_back(MakeView<float>(sweep_->Plane(frame), beam_, origin_));
    }
    const int width = sweep_->width, height = sweep_->height;
    FindVisible(views_, {0, 0, width, height}, multiplier, given, static_cast<float>(accuracy_.tolerance / transfer_.gamma));
    const std::size_t stride = static_cast<std::size_t>(width) + kRowPadding;
    images_.assign(frames.size() * stride * height, 0.0f);
    const int bands = (height + kBand - 1) / kBand;
    std::vector<double> sums(frames.size() * bands, 0.0);
    ForBands(static_cast<int>(frames.size()), height,
             [&](int f, int begin, int end)
             {
               const PixelRows rows = FrameRows(f);
               for (const Chunk& chunk : chunks_)
               {
                 AddFootprints(chunk.visible[f].data(), chunk.visible[f].size(), begin, end, rows,
                               {nullptr, 0, 0, 0});
               }
               const std::size_t frameStart = frames[f] * sweep_->PixelsPerFrame();
               double sum = 0;
               for (int row = begin; row < end; ++row)
               {
                 float* line = rows.data + row * stride;
                 for (int column = 0; column < width; ++column)
                 {
                   const std::size_t index = static_cast<std::size_t>(row) * width + column;
                   float out = 0;
                   if (Counts(index))
                   {
                     sum += pixel(frames[f], line[column], Truth(frameStart + index), out);
                   }
                   line[column] = out;
                 }
                 std::fill_n(line + width, kRowPadding, 0.0f);
               }
               sums[f * bands + begin / kBand] = sum;
             });
    double total = 0;
    for (double sum : sums)
    {
      total += sum;
    }
    return total;
  }

  float Truth(std::size_t index) const
  {
    return sweep_->pixelType == Sweep::PixelType::UInt8
               ? static_cast<const std::uint8_t*>(sweep_->pixels.get())[index] * (1.0f / 255.0f)
               : static_cast<const float*>(sweep_->pixels.get())[index];
  }

  std::vector<Gaussian<float>> gaussians_;
  std::vector<AdamState<float>> adam_;
  std::vector<GaussianGradient<float>> gradient_;
  std::vector<Score> scores_;
  std::vector<Chunk> chunks_;
  std::vector<View<float>> views_;
  std::vector<float> images_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  Beam beam_;
  TransferFunction transfer_;
  Accuracy accuracy_;
  std::shared_ptr<const Sweep> sweep_;
  bool ignoreMasked_ = false;
  std::size_t countedPixels_ = 0;
  std::int64_t iteration_ = 0;
};

}  // namespace

std::unique_ptr<Engine> CreateCpuEngine()
{
  return std::make_unique<CpuEngine>();
}

}  // namespace bigus
