// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Poses/Alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

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
constexpr int kMostSteps = 8;            // each takes 13 renders
constexpr double kMostTranslation = 2;   // mm: an optimum farther away is another place that looks alike
constexpr double kMostRotation = 3;      // degrees

/// What is seen from one pose.
struct Prediction
{
  std::vector<float> image;  // the pixels compared
  double cost = 0;           // sum of the squares of its differences to the frame
};

/// What is minimised, and by which steps. The six parameters q are all in mm of displacement, root mean square over the
/// image: q_0..2 the translation, q_3..5 rotation times its lever. One scale for all makes damping mean the same for
/// each.
class Problem
{
public:
  Problem(Engine& engine, const std::vector<float>& image, const std::vector<std::uint8_t>* mask,
          const SlicePlane& plane)
      : engine_(engine), plane_(plane), pixel_(plane.PixelSize()), image_(image)
  {
    for (std::size_t p = 0; p < image_.size(); ++p)
    {
      lit_.push_back(!mask || (*mask)[p] != 0);
      count_ += lit_.back();
    }
    // Root mean square distance of the pixels from each axis through the centre.
    const auto spread = [](const Eigen::Vector3d& step, int n)
    { return step.norm() * std::sqrt((static_cast<double>(n) * n - 1) / 12); };
    const double across = spread(plane.columnStep, plane.width);
    const double down = spread(plane.rowStep, plane.height);
    lever_ = {std::max(down, pixel_), std::max(across, pixel_), std::max(Eigen::Vector2d(across, down).norm(), pixel_)};
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
    return high > low;
  }

  Eigen::Vector3d Translation(const Vector6& q) const { return q.head<3>(); }
  Eigen::Vector3d Rotation(const Vector6& q) const { return q.tail<3>().cwiseQuotient(lever_) / kRadiansPerDegree; }
  SlicePlane Plane(const Vector6& q) const { return Moved(plane_, Translation(q), Rotation(q)); }

  /// The nearest motion within the bounds.
  Vector6 Bounded(Vector6 q) const
  {
    const double shift = Translation(q).norm();
    const double angle = Rotation(q).norm();
    if (shift > kMostTranslation)
    {
      q.head<3>() *= kMostTranslation / shift;
    }
    if (angle > kMostRotation)
    {
      q.tail<3>() *= kMostRotation / angle;
    }
    return q;
  }

  std::vector<float> Predict(const Vector6& q) const
  {
    std::vector<float> prediction(image_.size());
    engine_.Render(Plane(q), ViewOutput::Intensity, prediction.data());
    return prediction;
  }

  double RootMeanSquare(double sumOfSquares) const
  {
    return std::sqrt(sumOfSquares / static_cast<double>(std::max<std::size_t>(count_, 1)));
  }

  Prediction Evaluate(const Vector6& q) const
  {
    Prediction out;
    out.image = Predict(q);
    for (std::size_t p = 0; p < image_.size(); ++p)
    {
      const double r = lit_[p] ? static_cast<double>(out.image[p]) - image_[p] : 0;
      out.cost += r * r;
    }
    return out;
  }

  /// Half the cost's Hessian (Gauss-Newton) and half its gradient at q; `prediction` is what is seen there.
  std::pair<Matrix6, Vector6> Linearise(const Vector6& q, const Prediction& prediction) const
  {
    const double h = kDifferenceStep * pixel_;
    std::array<std::vector<float>, 6> derivative;
    for (int k = 0; k < 6; ++k)
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
      for (int k = 0; k < 6; ++k)
      {
        row[k] = derivative[k][p];
      }
      gradient += (static_cast<double>(prediction.image[p]) - image_[p]) * row;
      hessian.noalias() += row * row.transpose();
    }
    return {hessian, gradient};
  }

  bool IsConverged(const Vector6& from, const Vector6& to, double /*costFrom*/, double /*costTo*/) const
  {
    return (to - from).norm() <= kConvergedStep * pixel_;
  }

private:
  Engine& engine_;
  const SlicePlane plane_;
  const double pixel_;  // mm
  const std::vector<float>& image_;
  std::vector<char> lit_;
  std::size_t count_ = 0;  // of lit pixels
  Eigen::Vector3d lever_;  // mm
};

}  // namespace

SlicePlane Moved(const SlicePlane& plane, const Eigen::Vector3d& translation, const Eigen::Vector3d& rotation)
{
  const Eigen::Matrix3d axes = AxesOf(plane);
  const double angle = rotation.norm() * kRadiansPerDegree;
  const Eigen::Matrix3d turn = angle > 0 ? Eigen::AngleAxisd(angle, axes * rotation.normalized()).toRotationMatrix()
                                         : Eigen::Matrix3d::Identity().eval();
  const Eigen::Vector3d centre = CentreOf(plane);
  SlicePlane out = plane;
  out.columnStep = turn * plane.columnStep;
  out.rowStep = turn * plane.rowStep;
  out.origin = centre + turn * (plane.origin - centre) + axes * translation;
  return out;
}

RigidAlignment AlignFrame(Engine& engine, const Sweep& sweep, int frame)
{
  std::vector<float> image(sweep.PixelsPerFrame());
  sweep.CopyFrame(frame, image.data());
  Problem problem(engine, image, sweep.mask.get(), sweep.Plane(frame));
  Vector6 q = Vector6::Zero();
  Prediction prediction = problem.Evaluate(q);
  RigidAlignment out;
  out.plane = sweep.Plane(frame);

  if (problem.HasContrast() && problem.RootMeanSquare(prediction.cost) > kRoundingOfI)
  {
    LevenbergMarquardtOptions descent;
    descent.iterations = kMostSteps;
    descent.ridge = 1e-3;
    MinimiseByLevenbergMarquardt(problem, descent, q, prediction);
  }
  if (!q.isZero(0))
  {
    out.plane = problem.Plane(q);
  }
  out.translation = problem.Translation(q).norm();
  out.rotation = problem.Rotation(q).norm();
  return out;
}

}  // namespace bigus
