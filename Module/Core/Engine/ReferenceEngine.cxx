// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The reference engine: double precision, every Gaussian at every pixel, no shortcut. Slow; what the others must equal.

#include <tbb/parallel_for.h>

#include <cmath>
#include <optional>
#include <type_traits>
#include <utility>

#include "Core/Engine/Checks.h"
#include "Core/Engine/Engine.h"
#include "Core/Engine/FieldState.h"
#include "Core/Engine/ImageLoss.h"
#include "Core/Engine/Packing.h"
#include "Core/Engine/ViewEngine.h"
#include "Core/Formula/Adam.h"
#include "Core/Formula/GaussianBlock.h"

namespace bigus
{
namespace
{

class ReferenceEngine final : public Engine, public ViewEngine
{
public:
  std::string Device() const override { return "CPU (reference, double)"; }

  void SetField(const GaussianField& field, const std::vector<int>* parents) override
  {
    field.Validate();
    origin_ = MiddleOf(field);
    beam_ = field.beam;
    transfer_ = field.transfer;
    gaussians_ = PackField<double>(field, origin_);
    adam_ = InheritState(adam_, field.Size(), parents);
    if (!parents)
    {
      guarded_ = 0;
    }
    gradient_.assign(field.Size(), {});
    ResetScores();
  }

  GaussianField GetField() const override { return UnpackField(gaussians_, origin_, beam_, transfer_); }
  std::size_t FieldSize() const override { return gaussians_.size(); }
  void SetAccuracy(const Accuracy&) override {}  // nothing is ever dropped here

  void Render(const SlicePlane& plane, const Window& window, ViewOutput output, float* image, float* coverage) override
  {
    plane.Validate("slice plane");
    CheckWindow(plane, window.firstColumn, window.firstRow, window.columns, window.rows);
    const std::vector<Projection<double>> projections = ProjectAll(plane);
    tbb::parallel_for(
        0, window.rows,
        [&](int row)
        {
          for (int column = 0; column < window.columns; ++column)
          {
            double s = 0, support = 0;
            for (std::size_t i = 0; i < projections.size(); ++i)
            {
              const double w = Weight(projections[i].splat, window.firstColumn + column, window.firstRow + row);
              s += gaussians_[i].reflectivity * w;
              support += w;
            }
            const std::size_t pixel = static_cast<std::size_t>(row) * window.columns + column;
            image[pixel] = static_cast<float>(output == ViewOutput::Intensity ? transfer_.Intensity(s) : s);
            if (coverage)
            {
              coverage[pixel] = static_cast<float>(support);
            }
          }
        });
  }

  void SetFrames(std::shared_ptr<const Sweep> sweep) override
  {
    sweep->ValidateLayout();
    sweep_ = std::move(sweep);
    imageLoss_.emplace(sweep_->width, sweep_->height, CountedPixels(*sweep_));
  }

  double Backpropagate(const std::vector<int>& frames, const Loss& loss) override
  {
    return Backpropagate(frames, loss, nullptr, nullptr);
  }

  double Backpropagate(const std::vector<int>& frames, const Loss& loss, const std::vector<float>& reflectivities,
                       std::vector<float>& derivatives) override
  {
    derivatives.assign(reflectivities.size(), 0.0f);
    return Backpropagate(frames, loss, reflectivities.data(), derivatives.data());
  }

  std::vector<double> Reflectivities() const override
  {
    std::vector<double> r;
    for (const Gaussian<double>& gaussian : gaussians_)
    {
      r.push_back(gaussian.reflectivity);
    }
    return r;
  }

  void SetReflectivities(const std::vector<double>& reflectivities) override
  {
    for (std::size_t i = 0; i < gaussians_.size(); ++i)
    {
      gaussians_[i].reflectivity = reflectivities[i];
    }
  }

  void Walk(const std::vector<int>& frames, const std::vector<float>& reflectivities, const ChangeRow& change,
            std::vector<float>* sums) override
  {
    CheckFrames(sweep_, frames);
    const std::size_t n = gaussians_.size();
    if (sums)
    {
      sums->assign(reflectivities.size(), 0.0f);
    }
    for (std::size_t f = 0; f < frames.size(); ++f)
    {
      const std::vector<Projection<double>> projections = ProjectAll(sweep_->Plane(frames[f]));
      const auto first = reflectivities.begin() + static_cast<std::ptrdiff_t>(f * n);
      std::vector<double> image = Scattering(projections, {first, first + static_cast<std::ptrdiff_t>(n)});
      for (int row = 0; row < sweep_->height; ++row)
      {
        const auto from = image.begin() + static_cast<std::ptrdiff_t>(row) * sweep_->width;
        std::vector<float> line(from, from + sweep_->width);
        change(f, row, line.data());
        std::copy(line.begin(), line.end(), from);
      }
      tbb::parallel_for(std::size_t(0), sums ? n : 0,
                        [&](std::size_t i)
                        { (*sums)[f * n + i] = static_cast<float>(GatherMoments(projections[i].splat, image).m0); });
    }
  }

private:
  /// With `reflectivities`, [frames][gaussians], frames have their own, and `derivatives` get the loss's by them.
  double Backpropagate(const std::vector<int>& frames, const Loss& loss, const float* reflectivities,
                       float* derivatives)
  {
    CheckFrames(sweep_, frames);
    loss.Validate();
    imageLoss_->Check(loss);
    gradient_.assign(gaussians_.size(), {});
    const std::size_t pixels = sweep_->PixelsPerFrame();
    std::size_t counted = 0;
    for (std::size_t pixel = 0; pixel < pixels; ++pixel)
    {
      counted += sweep_->IsLit(pixel);
    }
    const double share = 1.0 / (static_cast<double>(counted) * frames.size());
    double sum = 0;
    std::vector<double> derivative(pixels), image(pixels);
    for (std::size_t f = 0; f < frames.size(); ++f)
    {
      const SlicePlane plane = sweep_->Plane(frames[f]);
      const std::vector<Projection<double>> projections = ProjectAll(plane);
      const float* viewed = reflectivities ? reflectivities + f * gaussians_.size() : nullptr;
      const std::vector<double> scattering =
          Scattering(projections, viewed ? std::vector<double>(viewed, viewed + gaussians_.size()) : Reflectivities());
      const std::vector<float> frameTruth = Frame(frames[f]);
      const std::vector<double> truth(frameTruth.begin(), frameTruth.end());
      std::vector<double> others(pixels, 0.0);
      for (std::size_t pixel = 0; pixel < pixels; ++pixel)
      {
        image[pixel] = transfer_.Intensity(scattering[pixel]);
      }
      sum += imageLoss_->Evaluate(loss, 1.0 / static_cast<double>(frames.size()), image.data(), truth.data(),
                                  sweep_->width, others.data());
      for (std::size_t pixel = 0; pixel < pixels; ++pixel)
      {
        const double weight = sweep_->IsLit(pixel) ? share : 0.0;
        const PixelLoss<double> value =
            EvaluateLoss(loss.l1, loss.l2, transfer_.gamma, scattering[pixel], truth[pixel], weight, others[pixel]);
        sum += value.loss;
        derivative[pixel] = value.derivative;
      }
      tbb::parallel_for(std::size_t(0), gaussians_.size(),
                        [&](std::size_t i)
                        {
                          const Moments<double> moments = GatherMoments(projections[i].splat, derivative);
                          Gaussian<double> gaussian = gaussians_[i];
                          if (viewed)
                          {
                            gaussian.reflectivity = viewed[i];
                            derivatives[f * gaussians_.size() + i] = static_cast<float>(moments.m0);
                          }
                          AddTo(gradient_[i], ProjectAdjoint(gaussian, projections[i], moments));
                          scores_[i].error += moments.error;
                          scores_[i].visits += 1;
                        });
    }
    for (std::size_t i = 0; i < gaussians_.size(); ++i)
    {
      scores_[i].descent -= FromVector3(gradient_[i].mean);
    }
    return sum;
  }

public:
  void Step(const LearningRates& rates, const ParameterLimits& limits) override
  {
    const AdamStep step(rates, limits);
    for (std::size_t i = 0; i < gaussians_.size(); ++i)
    {
      guarded_ += UpdateGaussian(gaussians_[i], adam_[i], gradient_[i], step) > 0;
    }
  }

  double TrainStep(const std::vector<int>& frames, const Loss& loss, const LearningRates& rates,
                   const ParameterLimits& limits) override
  {
    const double value = Backpropagate(frames, loss);
    Step(rates, limits);
    return value;
  }

  std::uint64_t GuardedUpdates() const override { return guarded_; }

  std::size_t MemoryUse() const override
  {
    return gaussians_.capacity() * sizeof(gaussians_[0]) + adam_.capacity() * sizeof(adam_[0]) +
           gradient_.capacity() * sizeof(gradient_[0]) + scores_.capacity() * sizeof(scores_[0]);
  }

  void SaveState(StateWriter& to) const override
  {
    SaveBeam(beam_, to);
    to.Number(transfer_.gamma);
    to.Numbers(origin_.data(), 3);
    to.Number<std::uint64_t>(gaussians_.size());
    for (std::size_t i = 0; i < gaussians_.size(); ++i)
    {
      to.Numbers(NumbersOf(gaussians_[i]), kGaussianNumbers);
      to.Numbers(NumbersOf(adam_[i]), kAdamNumbers);
      to.Number(scores_[i].error);
      to.Numbers(scores_[i].descent.data(), 3);
      to.Number(scores_[i].visits);
    }
    to.Number(guarded_);
  }

  void LoadState(StateReader& from) override
  {
    const Beam beam = LoadBeam(from);
    const TransferFunction transfer{from.Number<double>()};
    Eigen::Vector3d origin;
    from.Numbers(origin.data(), 3);
    const std::size_t count = from.Count(sizeof(double) * (kGaussianNumbers + kAdamNumbers + kScoreNumbers));
    std::vector<Gaussian<double>> gaussians(count);
    std::vector<AdamState<double>> adam(count);
    std::vector<Score> scores(count);
    for (std::size_t i = 0; i < count; ++i)
    {
      from.Numbers(NumbersOf(gaussians[i]), kGaussianNumbers);
      from.Numbers(NumbersOf(adam[i]), kAdamNumbers);
      RequireAverages(adam[i].first, adam[i].second, kParametersPerGaussian);
      StateReader::Require(adam[i].updates >= 0, "a negative count");
      scores[i].error = from.Number<double>();
      from.Numbers(scores[i].descent.data(), 3);
      scores[i].visits = from.Number<double>();
    }
    UnpackField(gaussians, origin, beam, transfer).Validate();
    guarded_ = from.Number<std::uint64_t>();
    beam_ = beam;
    transfer_ = transfer;
    origin_ = origin;
    gaussians_ = std::move(gaussians);
    adam_ = std::move(adam);
    scores_ = std::move(scores);
    gradient_.assign(count, {});
  }

  FieldGradient GetGradient() const override { return UnpackGradient(gradient_); }

  Scores GetScores() const override
  {
    Scores out;
    for (const Score& score : scores_)
    {
      out.error.push_back(score.error);
      out.descent.push_back(score.descent);
      out.visits.push_back(score.visits);
    }
    return out;
  }

  void ResetScores() override { scores_.assign(gaussians_.size(), {}); }

private:
  struct Score
  {
    double error = 0;
    Eigen::Vector3d descent = Eigen::Vector3d::Zero();
    double visits = 0;
  };

  static constexpr std::size_t kGaussianNumbers = sizeof(Gaussian<double>) / sizeof(double),
                               kAdamNumbers = sizeof(AdamState<double>) / sizeof(double), kScoreNumbers = 5;

  /// The members of a structure of doubles.
  template <class Structure>
  static const double* NumbersOf(const Structure& structure)
  {
    static_assert(sizeof(Structure) % sizeof(double) == 0 && std::is_trivially_copyable_v<Structure>);
    return reinterpret_cast<const double*>(&structure);
  }
  template <class Structure>
  static double* NumbersOf(Structure& structure)
  {
    return const_cast<double*>(NumbersOf(std::as_const(structure)));
  }

  static double Weight(const Splat<double>& splat, double u, double v)
  {
    const double eta2 = splat.u22 * (v - splat.mv);
    const double eta1 = splat.u11 * (u - splat.mu) + splat.u12 * (v - splat.mv);
    return splat.amplitude * std::exp(-0.5 * (eta1 * eta1 + eta2 * eta2));
  }

  std::vector<Projection<double>> ProjectAll(const SlicePlane& plane) const
  {
    const View<double> view = MakeView<double>(plane, beam_, origin_);
    std::vector<Projection<double>> projections(gaussians_.size());
    for (std::size_t i = 0; i < gaussians_.size(); ++i)
    {
      const Projection<double> projection = Project(gaussians_[i], view);
      // Not where either is not a number: a projection of zeros has no footprint.
      if (std::abs(projection.splat.mu) < kFarthestPixel && std::abs(projection.splat.mv) < kFarthestPixel)
      {
        projections[i] = projection;
      }
    }
    return projections;
  }

  std::vector<float> Frame(int frame) const
  {
    std::vector<float> image(sweep_->PixelsPerFrame());
    sweep_->CopyFrame(frame, image.data());
    return image;
  }

  /// S of a whole frame for reflectivities x.
  std::vector<double> Scattering(const std::vector<Projection<double>>& projections, const std::vector<double>& x) const
  {
    std::vector<double> scattering(sweep_->PixelsPerFrame(), 0.0);
    tbb::parallel_for(0, sweep_->height,
                      [&](int row)
                      {
                        for (int column = 0; column < sweep_->width; ++column)
                        {
                          double s = 0;
                          for (std::size_t i = 0; i < projections.size(); ++i)
                          {
                            s += x[i] * Weight(projections[i].splat, column, row);
                          }
                          scattering[static_cast<std::size_t>(row) * sweep_->width + column] = s;
                        }
                      });
    return scattering;
  }

  Moments<double> GatherMoments(const Splat<double>& splat, const std::vector<double>& derivative) const
  {
    Moments<double> m{};
    for (int row = 0; row < sweep_->height; ++row)
    {
      for (int column = 0; column < sweep_->width; ++column)
      {
        const double g = derivative[static_cast<std::size_t>(row) * sweep_->width + column];
        const double w = Weight(splat, column, row);
        const double eta2 = splat.u22 * (row - splat.mv);
        const double eta1 = splat.u11 * (column - splat.mu) + splat.u12 * (row - splat.mv);
        m.m0 += g * w;
        m.m1 += g * w * eta1;
        m.m2 += g * w * eta2;
        m.m11 += g * w * eta1 * eta1;
        m.m12 += g * w * eta1 * eta2;
        m.m22 += g * w * eta2 * eta2;
        m.error += std::abs(g) * w;
      }
    }
    return m;
  }

  std::vector<Gaussian<double>> gaussians_;
  std::vector<AdamState<double>> adam_;
  std::vector<GaussianGradient<double>> gradient_;
  std::vector<Score> scores_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  Beam beam_;
  TransferFunction transfer_;
  std::shared_ptr<const Sweep> sweep_;
  std::optional<ImageLoss> imageLoss_;  // of the frames' size and mask
  std::uint64_t guarded_ = 0;
};

}  // namespace

std::unique_ptr<Engine> CreateReferenceEngine()
{
  return std::make_unique<ReferenceEngine>();
}

}  // namespace bigus
