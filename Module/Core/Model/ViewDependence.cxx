// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/ViewDependence.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "Core/Model/Error.h"
#include "Core/Model/Sequences.h"
#include "Core/Model/SweepGeometry.h"

namespace bigus
{
namespace
{

constexpr double kDegree = 57.29577951308232;  // in a radian
constexpr double kLeastAngleStep = 0.25;       // degrees: trackers tell no less
constexpr double kUsualReach = 1.5;            // steps, of planes that say what is usual at a place
constexpr double kWhole = 2, kFade = 2;        // steps up to which a = 1, and from there to 0
constexpr double kRotation = 1e-5;             // by which a matrix in a file may be no rotation

Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix)
{
  const Eigen::JacobiSVD<Eigen::Matrix3d> parts(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = parts.matrixU();
  u.col(2) *= (u * parts.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return u * parts.matrixV().transpose();
}

/// Axis times angle, radian.
Eigen::Vector3d Logarithm(const Eigen::Matrix3d& rotation)
{
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

double Angle(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b)
{
  return kDegree * Eigen::AngleAxisd(a.transpose() * b).angle();
}

double MedianAngle(std::vector<double> values)
{
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[values.size() / 2];
}

void RequireRotation(const Eigen::Matrix3d& matrix, const std::string& what)
{
  Require(matrix.allFinite() &&
              (matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= kRotation &&
              matrix.determinant() >= 0,
          "View dependence: ", what, " is not a rotation.");
}

}  // namespace

RecordedViews RecordedViews::Of(const Sweep& sweep, const std::vector<int>& frames)
{
  RecordedViews views;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  std::vector<double> turns;
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    const SlicePlane plane = sweep.Plane(frames[k]);
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose.topLeftCorner<3, 3>() = AxesOf(plane);
    pose.topRightCorner<3, 1>() = CentreOf(plane);
    sum += pose.topLeftCorner<3, 3>();
    if (k > 0 && sweep.SequenceOf(frames[k - 1]) == sweep.SequenceOf(frames[k]))
    {
      turns.push_back(Angle(views.poses.back().topLeftCorner<3, 3>(), pose.topLeftCorner<3, 3>()));
    }
    views.poses.push_back(pose);
  }
  views.mean = NearestRotation(sum);
  double squares = 0;
  for (const Eigen::Matrix4d& pose : views.poses)
  {
    squares += Logarithm(views.mean.transpose() * pose.topLeftCorner<3, 3>()).squaredNorm();
  }
  views.unit = std::sqrt(squares / (3.0 * static_cast<double>(std::max<std::size_t>(frames.size(), 1))));
  const SweepGeometry geometry = MeasureGeometry(sweep, frames);
  views.angleStep = std::max(MedianAngle(turns), kLeastAngleStep);
  views.elevationStep = std::max(geometry.usualSpacing, geometry.pixelSize);
  return views;
}

Eigen::Vector3d RecordedViews::Direction(const SlicePlane& plane) const
{
  return Logarithm(mean.transpose() * AxesOf(plane)) / unit;
}

double RecordedViews::Turn(const SlicePlane& plane) const
{
  const Eigen::Matrix3d axes = AxesOf(plane);
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix4d& pose : poses)
  {
    least = std::min(least, Angle(pose.topLeftCorner<3, 3>(), axes));
  }
  return least;
}

double RecordedViews::Distance(const SlicePlane& plane) const
{
  const Eigen::Matrix3d axes = AxesOf(plane);
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix4d& pose : poses)
  {
    // Measured where the recorded picture is, so that it does not depend on how far the plane's own picture reaches.
    const double elevation = std::abs(axes.col(2).dot(pose.topRightCorner<3, 1>() - plane.origin));
    if (elevation / elevationStep < least)
    {
      least = std::min(least, std::max(elevation / elevationStep, Angle(pose.topLeftCorner<3, 3>(), axes) / angleStep));
    }
  }
  return least;
}

double RecordedViews::Nearness(const SlicePlane& plane) const
{
  return std::clamp(1 - (Distance(plane) - kWhole) / kFade, 0.0, 1.0);
}

std::vector<Eigen::Vector3d> RecordedViews::Directions() const
{
  std::vector<Eigen::Vector3d> directions;
  for (const Eigen::Matrix4d& pose : poses)
  {
    directions.push_back(Logarithm(mean.transpose() * pose.topLeftCorner<3, 3>()) / unit);
  }
  return directions;
}

std::vector<double> RecordedViews::WeightsAt(const Eigen::Vector3d& place) const
{
  const double falloff = 0.5 / std::pow(kUsualReach * elevationStep, 2);
  std::vector<double> weights;
  for (const Eigen::Matrix4d& pose : poses)
  {
    const double z = pose.col(2).head<3>().dot(place - pose.col(3).head<3>());
    weights.push_back(falloff * z * z);
  }
  const double least = *std::min_element(weights.begin(), weights.end());  // so that weights never underflow
  double sum = 0;
  for (double& weight : weights)
  {
    weight = std::exp(least - weight);
    sum += weight;
  }
  for (double& weight : weights)
  {
    weight /= sum;
  }
  return weights;
}

RecordedViews::Usual RecordedViews::UsualAt(const std::vector<Eigen::Vector3d>& places) const
{
  const std::vector<Eigen::Vector3d> directions = Directions();
  Usual usual;
  usual.directions.resize(places.size());
  std::vector<Eigen::Vector3d> variances(places.size());
  const auto look = [&](std::size_t i)
  {
    const std::vector<double> weights = WeightsAt(places[i]);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero(), squares = sum;
    for (std::size_t k = 0; k < weights.size(); ++k)
    {
      sum += weights[k] * directions[k];
      squares += weights[k] * directions[k].cwiseAbs2();
    }
    usual.directions[i] = sum;
    variances[i] = (squares - sum.cwiseAbs2()).cwiseMax(0);
  };
  tbb::parallel_for(std::size_t(0), places.size(), look);
  for (const Eigen::Vector3d& variance : variances)
  {
    usual.spread += variance / static_cast<double>(places.size());
  }
  usual.spread = usual.spread.cwiseSqrt();
  return usual;
}

void RecordedViews::Validate() const
{
  RequireRotation(mean, "the mean orientation");
  const auto require = [](double value, double most, const char* what)
  {
    Require(value > 0 && value <= most, "View dependence: the ", what, " is ", value,
            "; it must be above 0 and at most ", most, ".");
  };
  require(unit, 4, "unit of directions (radian)");
  require(angleStep, 180, "step of angles (degrees)");
  require(elevationStep, GaussianField::kLargestCoordinate, "step between planes (mm)");
  Require(!poses.empty() && poses.size() <= kMostPoses, "View dependence: there are ", poses.size(),
          " recorded poses; 1 to ", kMostPoses, " are needed.");
  for (std::size_t k = 0; k < poses.size(); ++k)
  {
    const std::string what = "recorded pose " + std::to_string(k);
    RequireRotation(poses[k].topLeftCorner<3, 3>(), what);
    const Eigen::Vector3d place = poses[k].topRightCorner<3, 1>();
    Require(place.cwiseAbs().maxCoeff() <= GaussianField::kLargestCoordinate && place.allFinite() &&
                poses[k].row(3) == Eigen::RowVector4d(0, 0, 0, 1),
            "View dependence: ", what, " is not a rigid place in space within 1e12 mm.");
  }
}

void ViewDependence::Validate(std::size_t gaussians) const
{
  views.Validate();
  Require(terms.size() == gaussians, "View dependence: there are ", terms.size(), " terms for ", gaussians,
          " Gaussians.");
  for (std::size_t i = 0; i < terms.size(); ++i)
  {
    if (!terms[i].allFinite() || !(terms[i].cwiseAbs().maxCoeff() <= GaussianField::kLargestReflectivity))
    {
      throw Error("View dependence: the term of Gaussian " + std::to_string(i) + " is not finite or larger than 1e20.");
    }
  }
}

ViewedReflectivities::ViewedReflectivities(const GaussianField& field, ViewDependence view)
    : view_(std::move(view)), own_(field.reflectivities)
{
  view_.Validate(field.Size());
  usual_ = view_.views.UsualAt(field.means).directions;
}

std::vector<double> ViewedReflectivities::At(const SlicePlane& plane, double nearness) const
{
  std::vector<double> reflectivities = own_;
  if (nearness > 0)
  {
    const Eigen::Vector3d direction = view_.views.Direction(plane);
    for (std::size_t i = 0; i < reflectivities.size(); ++i)
    {
      const double there = own_[i] + nearness * view_.terms[i].dot(direction - usual_[i]);
      reflectivities[i] = std::clamp(there, -GaussianField::kLargestReflectivity, GaussianField::kLargestReflectivity);
    }
  }
  return reflectivities;
}

ViewDependence Transformed(ViewDependence view, const Eigen::Matrix4d& transform)
{
  const Eigen::Matrix3d linear = transform.topLeftCorner<3, 3>();
  const double scale = std::cbrt(std::abs(linear.determinant()));
  const bool isMirrored = linear.determinant() < 0;
  const Eigen::Matrix3d turn = linear / scale;
  // The axes (x, y, n) of a plane become (Q x, Q y, +-Q n), because n = x cross y also of the mirrored plane. So with
  // F = diag(1, 1, -1) for a mirror R becomes Q R F, Rm^T R becomes F Rm^T R F, and its logarithm w becomes det(F) F w.
  const Eigen::Vector3d flip(1, 1, isMirrored ? -1 : 1);
  const auto turned = [&](const Eigen::Matrix3d& axes)
  { return NearestRotation(turn * axes * Eigen::Matrix3d(flip.asDiagonal())); };
  for (Eigen::Matrix4d& pose : view.views.poses)
  {
    pose.topLeftCorner<3, 3>() = turned(pose.topLeftCorner<3, 3>());
    pose.topRightCorner<3, 1>() =
        linear * pose.topRightCorner<3, 1>() + Eigen::Vector3d(transform.topRightCorner<3, 1>());
  }
  view.views.mean = turned(view.views.mean);
  view.views.elevationStep *= scale;
  if (isMirrored)
  {
    for (Eigen::Vector3d& term : view.terms)
    {
      term = Eigen::Vector3d(-term.cwiseProduct(flip));
    }
  }
  return view;
}

}  // namespace bigus
