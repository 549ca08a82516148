#include "VirtualPlanes.h"

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "Baselines.h"
#include "Seeding.h"

namespace bigus
{
namespace
{

constexpr float kWeight = 0.6f;  // below a real frame: the target is a guess
constexpr double kBlur = 0.5;    // standard deviation, pixels

/// The pose a share of the way from one plane to the next: centre and pixel sides linearly, rotation by
/// slerp.
SlicePlane Between(const SlicePlane& from, const SlicePlane& to, double share)
{
  const auto rotationOf = [](const SlicePlane& plane)
  {
    Eigen::Matrix3d r;
    r.col(0) = plane.columnStep.normalized();
    r.col(2) = plane.Normal();
    r.col(1) = r.col(2).cross(r.col(0));
    return Eigen::Quaterniond(r);
  };
  const auto mix = [share](double a, double b) { return (1 - share) * a + share * b; };
  const double i = 0.5 * (from.width - 1), j = 0.5 * (from.height - 1);
  const Eigen::Matrix3d r = rotationOf(from).slerp(share, rotationOf(to)).toRotationMatrix();
  SlicePlane plane = from;
  plane.columnStep = mix(from.columnStep.norm(), to.columnStep.norm()) * r.col(0);
  plane.rowStep = mix(from.rowStep.norm(), to.rowStep.norm()) * r.col(1);
  plane.origin =
      (1 - share) * from.Point(i, j) + share * to.Point(i, j) - i * plane.columnStep - j * plane.rowStep;
  return plane;
}

}  // namespace

std::shared_ptr<const Sweep> AddVirtualPlanes(const Sweep& sweep, const std::vector<int>& frames, int perGap)
{
  auto out = std::make_shared<Sweep>();
  out->width = sweep.width;
  out->height = sweep.height;
  out->pixelType = Sweep::PixelType::Float32;
  out->mask = sweep.mask;
  for (int frame : frames)
  {
    out->imageToReference.push_back(sweep.imageToReference[frame]);
    out->weights.push_back(sweep.Weight(frame));
  }
  const double widest = 4 * MeasureGeometry(sweep, frames).medianSpacing;
  for (std::size_t k = 0; k + 1 < frames.size(); ++k)
  {
    const SlicePlane from = sweep.Plane(frames[k]), to = sweep.Plane(frames[k + 1]);
    const Eigen::Vector3d step = to.Point(0.5 * (to.width - 1), 0.5 * (to.height - 1)) -
                                 from.Point(0.5 * (from.width - 1), 0.5 * (from.height - 1));
    for (int v = 1; v <= perGap && std::abs(step.dot(from.Normal())) <= widest; ++v)
    {
      out->imageToReference.push_back(Between(from, to, v / (perGap + 1.0)).ImageToReference());
      out->weights.push_back(kWeight);
    }
  }
  const std::size_t pixels = sweep.PixelsPerFrame();
  auto values = std::make_shared<std::vector<float>>(pixels * out->imageToReference.size());
  for (std::size_t k = 0; k < out->imageToReference.size(); ++k)
  {
    float* image = values->data() + k * pixels;
    if (k < frames.size())
    {
      sweep.CopyFrame(frames[k], image);
      continue;
    }
    PredictPoseInterpolation(sweep, frames, out->Plane(static_cast<int>(k)), image);
    cv::Mat view(sweep.height, sweep.width, CV_32F, image);
    cv::GaussianBlur(view, view, cv::Size(5, 5), kBlur);
  }
  out->pixels = std::shared_ptr<const void>(values, values->data());
  return out;
}

}  // namespace bigus
