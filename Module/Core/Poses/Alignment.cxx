// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Poses/Alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"
#include "Core/Numerics/LevenbergMarquardt.h"

namespace bigus
{
namespace
{

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Pixels: halfwidth h of the central differences. With features of standard deviation s pixels the derivative is off by
// h^2 / (6 s^2), 1 % at s = 1, while rounding (5e-7 of I) stays far below a grey level a pixel.
constexpr double kDifferenceStep = 0.25;
constexpr double kConvergedStep = 0.01;  // pixels: motion (root mean square over the image) that is as good as none
constexpr double kRoundingOfI = 1e-6;    // a residual below this is rounding

void CheckRange(const char* name, double value, double low, double high)
{
  if (!(value >= low && value <= high))
  {
    throw Error(std::string("Alignment: ") + name + " is " + std::to_string(value) + "; it must lie between " +
                std::to_string(low) + " and " + std::to_string(high) + ".");
  }
}

/// Every n-th pixel of every n-th row.
SlicePlane Strided(const SlicePlane& plane, int n)
{
  SlicePlane out = plane;
  out.columnStep *= n;
  out.rowStep *= n;
  out.width = (plane.width - 1) / n + 1;
  out.height = (plane.height - 1) / n + 1;
  return out;
}

/// What is seen from one pose.
struct Prediction
{
  std::vector<float> image;  // the pixels compared
  double sumOfSquares = 0;   // of its differences to the frame
  double cost = 0;           // the objective
};

/// What is minimised, and by which steps. The six parameters q are all in mm of displacement, root mean square over the
/// image: q_0..2 the translation, q_3..5 rotation times its lever. One scale for all makes damping mean the same for
/// each.
class Problem
{
public:
  Problem(const std::function<void(const SlicePlane&, float*)>& render, const float* image, const std::uint8_t* mask,
          const SlicePlane& plane, const AlignmentOptions& options)
      : render_(render), plane_(plane), options_(options), pixel_(plane.PixelSize())
  {
    const SlicePlane grid = Strided(plane, options.stride);
    width_ = grid.width;
    for (int y = 0; y < grid.height; ++y)
    {
      for (int x = 0; x < grid.width; ++x)
      {
        const std::size_t p =
            (static_cast<std::size_t>(y) * plane.width + x) * static_cast<std::size_t>(options.stride);
        image_.push_back(image[p]);
        lit_.push_back(!mask || mask[p] != 0);
        count_ += lit_.back();
      }
    }
    // Root mean square distance of the pixels from each axis through the centre.
    const auto spread = [](const Eigen::Vector3d& step, int n)
    { return step.norm() * std::sqrt((static_cast<double>(n) * n - 1) / 12); };
    const double across = spread(plane.columnStep, plane.width);
    const double down = spread(plane.rowStep, plane.height);
    lever_ = {std::max(down, pixel_), std::max(across, pixel_), std::max(Eigen::Vector2d(across, down).norm(), pixel_)};

    for (int k = 0; k < 6; ++k)
    {
      const double deviation =
          k < 3 ? options.translationPrior : options.rotationPrior * kRadiansPerDegree * lever_[k % 3];
      prior_[k] = deviation > 0 ? 1 / (deviation * deviation) : 0;
      if ((k < 3 ? options.maximumTranslation : options.maximumRotation) > 0)
      {
        free_.push_back(k);
      }
    }
  }

  /// Whether there is anything to align by.
  bool HasContrast() const
  {
    float low = 1e30f, high = -1e30f;
    for (std::size_t p = 0; p < image_.size(); ++p)
    {
      if (lit_[p])
      {
        low = std::min(low, image_[p]);
        high = std::max(high, image_[p]);
      }
    }
    return high > low && !free_.empty();
  }

  Eigen::Vector3d Translation(const Vector6& q) const { return q.head<3>(); }
  Eigen::Vector3d Rotation(const Vector6& q) const { return q.tail<3>().cwiseQuotient(lever_) / kRadiansPerDegree; }
  SlicePlane Plane(const Vector6& q) const { return Moved(plane_, Translation(q), Rotation(q)); }

  /// The nearest motion within the bounds.
  Vector6 Bounded(Vector6 q) const
  {
    const double shift = Translation(q).norm();
    const double angle = Rotation(q).norm();
    if (shift > options_.maximumTranslation)
    {
      q.head<3>() *= options_.maximumTranslation / shift;
    }
    if (angle > options_.maximumRotation)
    {
      q.tail<3>() *= options_.maximumRotation / angle;
    }
    return q;
  }

  std::vector<float> Predict(const Vector6& q) const
  {
    std::vector<float> prediction(image_.size());
    render_(Strided(Plane(q), options_.stride), prediction.data());
    return prediction;
  }

  double SumOfSquares(const std::vector<float>& prediction) const
  {
    double sum = 0;
    for (std::size_t p = 0; p < image_.size(); ++p)
    {
      const double r = lit_[p] ? static_cast<double>(prediction[p]) - image_[p] : 0;
      sum += r * r;
    }
    return sum;
  }
  double RootMeanSquare(double sumOfSquares) const
  {
    return std::sqrt(sumOfSquares / static_cast<double>(std::max<std::size_t>(count_, 1)));
  }

  /// Speckle makes residuals of neighbours alike, so n pixels hold fewer independent ones. With correlation rho^|lag|
  /// along rows and columns, of residuals and derivatives alike, n / A with A = (1 + rho^2) / (1 - rho^2) on each axis.
  void CountIndependent(const std::vector<float>& prediction)
  {
    std::vector<double> residual(image_.size(), 0.0);
    double mean = 0;
    for (std::size_t p = 0; p < image_.size(); ++p)
    {
      residual[p] = static_cast<double>(prediction[p]) - image_[p];
      mean += lit_[p] ? residual[p] / static_cast<double>(count_) : 0;
    }
    independent_ = static_cast<double>(count_);
    for (std::size_t lag : {std::size_t(1), static_cast<std::size_t>(width_)})
    {
      double products = 0, squares = 0;
      for (std::size_t p = 0; p + lag < image_.size(); ++p)
      {
        const bool sameRow = lag > 1 || (p + 1) % width_ != 0;
        if (lit_[p] && lit_[p + lag] && sameRow)
        {
          const double a = residual[p] - mean, b = residual[p + lag] - mean;
          products += a * b;
          squares += 0.5 * (a * a + b * b);
        }
      }
      const double rho = squares > 0 ? std::clamp(products / squares, 0.0, 0.99) : 0;
      independent_ *= (1 - rho * rho) / (1 + rho * rho);
    }
  }

  /// Minus twice the logarithm of the posterior: n_ind ln(sum r^2) is that of Gaussian residuals whose level is
  /// unknown, which is to say sigma^2 is the mean square residual of the pose at hand.
  double Objective(const Vector6& q, double sumOfSquares) const
  {
    return independent_ * std::log(Level(sumOfSquares)) + q.cwiseAbs2().dot(prior_);
  }

  Prediction Evaluate(const Vector6& q) const
  {
    Prediction out;
    out.image = Predict(q);
    out.sumOfSquares = SumOfSquares(out.image);
    out.cost = Objective(q, out.sumOfSquares);
    return out;
  }

  /// Half the objective's Hessian (Gauss-Newton) and half its gradient at q; `prediction` is what is seen there.
  std::pair<Matrix6, Vector6> Linearise(const Vector6& q, const Prediction& prediction) const
  {
    const double h = kDifferenceStep * pixel_;
    std::array<std::vector<float>, 6> derivative;
    for (int k : free_)
    {
      derivative[k] = Predict(q + h * Vector6::Unit(k));
      const std::vector<float> before = Predict(q - h * Vector6::Unit(k));
      const float scale = static_cast<float>(0.5 / h);
      for (std::size_t p = 0; p < before.size(); ++p)
      {
        derivative[k][p] = (derivative[k][p] - before[p]) * scale;
      }
    }
    Matrix6 hessian = Matrix6::Zero();
    Vector6 gradient = Vector6::Zero();
    for (std::size_t p = 0; p < image_.size(); ++p)
    {
      if (!lit_[p])
      {
        continue;
      }
      Vector6 row = Vector6::Zero();
      for (int k : free_)
      {
        row[k] = derivative[k][p];
      }
      gradient += (static_cast<double>(prediction.image[p]) - image_[p]) * row;
      hessian.noalias() += row * row.transpose();
    }
    const double weight = independent_ / Level(prediction.sumOfSquares);
    hessian *= weight;
    hessian.diagonal() += prior_;
    gradient = weight * gradient + prior_.cwiseProduct(q);
    for (int k = 0; k < 6; ++k)
    {
      if (std::find(free_.begin(), free_.end(), k) == free_.end())
      {
        gradient[k] = 0;
      }
    }
    return {hessian, gradient};
  }

  bool IsConverged(const Vector6& from, const Vector6& to, double /*costFrom*/, double /*costTo*/) const
  {
    return (to - from).norm() <= kConvergedStep * pixel_;
  }

private:
  double Level(double sumOfSquares) const
  {
    return std::max(sumOfSquares, kRoundingOfI * kRoundingOfI * static_cast<double>(count_));
  }

  const std::function<void(const SlicePlane&, float*)>& render_;
  const SlicePlane plane_;
  const AlignmentOptions options_;
  const double pixel_;  // mm
  int width_ = 0;       // of the pixels compared
  std::vector<float> image_;
  std::vector<char> lit_;
  std::size_t count_ = 0;  // of lit pixels
  double independent_ = 0;
  Eigen::Vector3d lever_;  // mm
  Vector6 prior_;          // 1 / variance of q
  std::vector<int> free_;  // parameters that may change
};

}  // namespace

SlicePlane Moved(const SlicePlane& plane, const Eigen::Vector3d& translation, const Eigen::Vector3d& rotation)
{
  Eigen::Matrix3d axes;
  axes.col(0) = plane.columnStep.normalized();
  axes.col(2) = plane.Normal();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  const double angle = rotation.norm() * kRadiansPerDegree;
  const Eigen::Matrix3d turn = angle > 0 ? Eigen::AngleAxisd(angle, axes * rotation.normalized()).toRotationMatrix()
                                         : Eigen::Matrix3d::Identity().eval();
  const Eigen::Vector3d centre = plane.Point(0.5 * (plane.width - 1), 0.5 * (plane.height - 1));
  SlicePlane out = plane;
  out.columnStep = turn * plane.columnStep;
  out.rowStep = turn * plane.rowStep;
  out.origin = centre + turn * (plane.origin - centre) + axes * translation;
  return out;
}

void AlignmentOptions::Validate() const
{
  CheckRange("the maximum translation (mm)", maximumTranslation, 0, 1000);
  CheckRange("the maximum rotation (degrees)", maximumRotation, 0, 45);
  CheckRange("the translation prior (mm)", translationPrior, 0, 1e9);
  CheckRange("the rotation prior (degrees)", rotationPrior, 0, 1e9);
  CheckRange("the number of iterations", iterations, 0, 1000);
  CheckRange("the stride", stride, 1, 4096);
}

RigidAlignment AlignImage(const std::function<void(const SlicePlane&, float*)>& render, const float* image,
                          const std::uint8_t* mask, const SlicePlane& plane, const AlignmentOptions& options)
{
  options.Validate();
  plane.Validate("Alignment");
  Problem problem(render, image, mask, plane, options);
  Vector6 q = Vector6::Zero();
  Prediction prediction = problem.Evaluate(q);
  problem.CountIndependent(prediction.image);
  prediction.cost = problem.Objective(q, prediction.sumOfSquares);
  RigidAlignment out;
  out.plane = plane;
  out.residualBefore = problem.RootMeanSquare(prediction.sumOfSquares);

  if (problem.HasContrast() && out.residualBefore > kRoundingOfI)
  {
    LevenbergMarquardtOptions descent;
    descent.iterations = options.iterations;
    descent.ridge = 1e-3;
    out.iterations = MinimiseByLevenbergMarquardt(problem, descent, q, prediction);
  }
  if (!q.isZero(0))
  {
    out.plane = problem.Plane(q);
  }
  out.translation = problem.Translation(q).norm();
  out.rotation = problem.Rotation(q).norm();
  out.residualAfter = problem.RootMeanSquare(prediction.sumOfSquares);
  return out;
}

RigidAlignment AlignFrame(Engine& engine, const Sweep& sweep, int frame, const AlignmentOptions& options)
{
  std::vector<float> image(sweep.PixelsPerFrame());
  sweep.CopyFrame(frame, image.data());
  return AlignImage([&engine](const SlicePlane& plane, float* out)
                    { engine.Render(plane, ViewOutput::Intensity, out); },
                    image.data(), sweep.mask ? sweep.mask->data() : nullptr, sweep.Plane(frame), options);
}

}  // namespace bigus
