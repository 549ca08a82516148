// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "UltraGaussEngine.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "Core/Engine/Checks.h"
#include "Core/Engine/ImageLoss.h"
#include "Core/Engine/Packing.h"
#include "Core/Formula/Adam.h"
#include "Core/Formula/PixelLoss.h"
#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

constexpr double kLeastWeight = 1e-3;  // where all weights together are less, the image fades to black
constexpr int kBandRows = 16;          // rows rendered by one task

/// A footprint and the pixels where its weight is at least the tolerance.
struct VisibleSplat
{
  std::size_t gaussian;
  Projection<double> projection;
  double cut;  // |eta|^2 inside is at most this
  int columnBegin, columnEnd, rowBegin, rowEnd;
};

/// body(pixel offset in the row, w, eta1, eta2) for every pixel of one row of a footprint.
template <class Body>
void ForRow(const VisibleSplat& visible, int row, Body&& body)
{
  const Splat<double>& s = visible.projection.splat;
  const double eta2 = s.u22 * (row - s.mv);
  for (int column = visible.columnBegin; column < visible.columnEnd; ++column)
  {
    const double eta1 = s.u11 * (column - s.mu) + s.u12 * (row - s.mv);
    const double square = eta1 * eta1 + eta2 * eta2;
    if (square <= visible.cut)
    {
      body(column, s.amplitude * std::exp(-0.5 * square), eta1, eta2);
    }
  }
}

class UltraGaussEngine final : public Engine
{
public:
  std::string Device() const override { return "CPU (UltraGauss, double)"; }

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
    visits_.assign(field.Size(), 0);
    scores_ = {};
  }

  GaussianField GetField() const override { return UnpackField(gaussians_, origin_, beam_, transfer_); }
  std::size_t FieldSize() const override { return gaussians_.size(); }
  void SetAccuracy(const Accuracy& accuracy) override { accuracy_ = accuracy; }

  void Render(const SlicePlane& plane, const Window& window, ViewOutput output, float* image, float* coverage) override
  {
    plane.Validate("slice plane");
    CheckWindow(plane, window.firstColumn, window.firstRow, window.columns, window.rows);
    const Images images = AddUp(FindVisible(plane, window), window);
    for (std::size_t p = 0; p < images.scattering.size(); ++p)
    {
      const double s = images.scattering[p], w = images.weight[p];
      image[p] = static_cast<float>(output == ViewOutput::Intensity ? s / (kLeastWeight + w) : s);
      if (coverage)
      {
        coverage[p] = static_cast<float>(w);
      }
    }
  }

  void SetFrames(std::shared_ptr<const Sweep> sweep) override
  {
    sweep->ValidateLayout();
    sweep_ = std::move(sweep);
    const std::vector<std::uint8_t> counted = CountedPixels(*sweep_);
    countedPixels_ = counted.empty() ? sweep_->PixelsPerFrame()
                                     : static_cast<std::size_t>(std::count(counted.begin(), counted.end(), 1));
    imageLoss_.emplace(sweep_->width, sweep_->height, counted);
  }

  /// With g = dL/dI: dL/dS = g / W and dL/dW = -g I / W, so that a footprint gets r dL/dS + dL/dW where the other engines
  /// have r dL/dS. The moments of both images add up to those of a Gaussian of reflectivity 1, and dL/dr is the zeroth
  /// moment of dL/dS.
  double Backpropagate(const std::vector<int>& frames, const Loss& loss) override
  {
    CheckFrames(sweep_, frames);
    loss.Validate();
    imageLoss_->Check(loss);
    gradient_.assign(gaussians_.size(), {});
    visits_.assign(gaussians_.size(), 0);
    const std::size_t pixels = sweep_->PixelsPerFrame();
    const double ofFrame = 1.0 / static_cast<double>(frames.size());
    const double ofPixel = ofFrame / static_cast<double>(std::max<std::size_t>(countedPixels_, 1));
    std::vector<float> recorded(pixels);
    double sum = 0;
    for (int frame : frames)
    {
      const Window whole{0, 0, sweep_->width, sweep_->height};
      const std::vector<VisibleSplat> visible = FindVisible(sweep_->Plane(frame), whole);
      Images images = AddUp(visible, whole);
      sweep_->CopyFrame(frame, recorded.data());
      const std::vector<double> truth(recorded.begin(), recorded.end());
      std::vector<double> image(pixels), others(pixels, 0.0);
      for (std::size_t p = 0; p < pixels; ++p)
      {
        image[p] = images.scattering[p] / (kLeastWeight + images.weight[p]);
      }
      sum += imageLoss_->Evaluate(loss, ofFrame, image.data(), truth.data(), sweep_->width, others.data());
      for (std::size_t p = 0; p < pixels; ++p)
      {
        const PixelLoss<double> value =
            EvaluateError(loss.l1, loss.l2, image[p] - truth[p], sweep_->IsLit(p) ? ofPixel : 0.0, others[p]);
        sum += value.loss;
        images.scattering[p] = value.derivative / (kLeastWeight + images.weight[p]);
        images.weight[p] = -images.scattering[p] * image[p];
      }
      tbb::parallel_for(std::size_t(0), visible.size(), [&](std::size_t k) { AddGradient(visible[k], images); });
    }
    for (std::size_t i = 0; i < scores_.size(); ++i)
    {
      scores_[i].descent -= FromVector3(gradient_[i].mean);
    }
    return sum;
  }

  void Step(const LearningRates& rates, const ParameterLimits& limits) override
  {
    const AdamStep step(rates, limits);
    for (std::size_t i = 0; i < gaussians_.size(); ++i)
    {
      if (visits_[i] > 0)
      {
        guarded_ += UpdateGaussian(gaussians_[i], adam_[i], gradient_[i], step) > 0;
      }
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
    return gaussians_.size() * (sizeof(gaussians_[0]) + sizeof(adam_[0]) + sizeof(gradient_[0]) + sizeof(visits_[0])) +
           scores_.size() * sizeof(scores_[0]);
  }

  FieldGradient GetGradient() const override { return UnpackGradient(gradient_); }

  Scores GetScores() const override
  {
    Scores out;
    const std::size_t n = gaussians_.size();
    out.error.assign(n, 0.0);
    out.descent.assign(n, Eigen::Vector3d::Zero());
    out.visits.assign(n, 0.0);
    for (std::size_t i = 0; i < scores_.size(); ++i)
    {
      out.error[i] = scores_[i].error;
      out.descent[i] = scores_[i].descent;
      out.visits[i] = scores_[i].visits;
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

  /// S and sum w of a window's pixels; then dL/dS and dL/dW.
  struct Images
  {
    std::vector<double> scattering, weight;
  };

  /// What a plane sees inside a window, in the order of the field.
  std::vector<VisibleSplat> FindVisible(const SlicePlane& plane, const Window& window) const
  {
    const View<double> view = MakeView<double>(plane, beam_, origin_);
    std::vector<VisibleSplat> all(gaussians_.size());
    std::vector<char> seen(gaussians_.size());
    tbb::parallel_for(std::size_t(0), gaussians_.size(),
                      [&](std::size_t i)
                      {
                        all[i].gaussian = i;
                        all[i].projection = Project(gaussians_[i], view);
                        seen[i] = Bound(window, all[i]);
                      });
    std::vector<VisibleSplat> visible;
    for (std::size_t i = 0; i < all.size(); ++i)
    {
      if (seen[i])
      {
        visible.push_back(all[i]);
      }
    }
    return visible;
  }

  /// Finds where a footprint ends; returns whether any of it lies in the window.
  bool Bound(const Window& window, VisibleSplat& visible) const
  {
    const Splat<double>& s = visible.projection.splat;
    if (!(s.amplitude > accuracy_.tolerance))
    {
      return false;
    }
    // amplitude exp(-|eta|^2 / 2) >= tolerance. The ellipse |eta|^2 <= cut spans these pixels around (mu, mv).
    visible.cut = 2 * std::log(s.amplitude / accuracy_.tolerance);  // infinite where nothing may be dropped
    const double radius = std::sqrt(visible.cut);
    const double rows = radius / s.u22, columns = radius * std::hypot(1.0, s.u12 / s.u22) / s.u11;
    const auto between = [](double low, double high, int first, int count, int& begin, int& end)
    {
      const double last = first + static_cast<double>(count);
      begin = static_cast<int>(std::clamp(std::ceil(low), static_cast<double>(first), last));
      end = static_cast<int>(std::clamp(std::floor(high) + 1, static_cast<double>(first), last));
    };
    between(s.mu - columns, s.mu + columns, window.firstColumn, window.columns, visible.columnBegin, visible.columnEnd);
    between(s.mv - rows, s.mv + rows, window.firstRow, window.rows, visible.rowBegin, visible.rowEnd);
    return visible.columnBegin < visible.columnEnd && visible.rowBegin < visible.rowEnd;
  }

  /// Adds in the order of the splats, whatever the number of threads.
  Images AddUp(const std::vector<VisibleSplat>& visible, const Window& window) const
  {
    const std::size_t pixels = static_cast<std::size_t>(window.columns) * window.rows;
    Images images{std::vector<double>(pixels, 0.0), std::vector<double>(pixels, 0.0)};
    const int bands = (window.rows + kBandRows - 1) / kBandRows;
    tbb::parallel_for(0, bands,
                      [&](int band)
                      {
                        const int first = window.firstRow + band * kBandRows;
                        const int last = std::min(first + kBandRows, window.firstRow + window.rows);
                        for (const VisibleSplat& splat : visible)
                        {
                          const double r = gaussians_[splat.gaussian].reflectivity;
                          for (int row = std::max(first, splat.rowBegin); row < std::min(last, splat.rowEnd); ++row)
                          {
                            const std::size_t line = static_cast<std::size_t>(row - window.firstRow) * window.columns;
                            ForRow(splat, row,
                                   [&](int column, double w, double, double)
                                   {
                                     images.scattering[line + column - window.firstColumn] += r * w;
                                     images.weight[line + column - window.firstColumn] += w;
                                   });
                          }
                        }
                      });
    return images;
  }

  /// Adds one frame's derivatives to a Gaussian's gradient; `images` are dL/dS and dL/dW.
  void AddGradient(const VisibleSplat& visible, const Images& images)
  {
    const std::size_t i = visible.gaussian;
    const double r = gaussians_[i].reflectivity;
    Moments<double> m{};
    double slope = 0;
    for (int row = visible.rowBegin; row < visible.rowEnd; ++row)
    {
      const std::size_t line = static_cast<std::size_t>(row) * sweep_->width;
      ForRow(visible, row,
             [&](int column, double w, double eta1, double eta2)
             {
               const double ofScattering = w * images.scattering[line + column];
               const double g = r * ofScattering + w * images.weight[line + column];
               m.m0 += g;
               m.m1 += g * eta1;
               m.m2 += g * eta2;
               m.m11 += g * eta1 * eta1;
               m.m12 += g * eta1 * eta2;
               m.m22 += g * eta2 * eta2;
               m.error += std::abs(ofScattering);
               slope += ofScattering;
             });
    }
    Gaussian<double> unit = gaussians_[i];
    unit.reflectivity = 1;
    GaussianGradient<double> gradient = ProjectAdjoint(unit, visible.projection, m);
    gradient.reflectivity = slope;
    AddTo(gradient_[i], gradient);
    ++visits_[i];
    if (!scores_.empty())
    {
      scores_[i].error += m.error;
      scores_[i].visits += 1;
    }
  }

  std::vector<Gaussian<double>> gaussians_;
  std::vector<AdamState<double>> adam_;
  std::vector<GaussianGradient<double>> gradient_;
  std::vector<int> visits_;    // frames of the last Backpropagate that saw a Gaussian
  std::vector<Score> scores_;  // empty until asked for
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  Beam beam_;
  TransferFunction transfer_;
  Accuracy accuracy_;
  std::shared_ptr<const Sweep> sweep_;
  std::size_t countedPixels_ = 0;
  std::optional<ImageLoss> imageLoss_;  // of the frames' size and mask
  std::uint64_t guarded_ = 0;
};

}  // namespace

std::unique_ptr<Engine> CreateUltraGaussEngine()
{
  return std::make_unique<UltraGaussEngine>();
}

}  // namespace bigus
