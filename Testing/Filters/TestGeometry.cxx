// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusReslice puts things where vtkImageReslice puts them.
//
// A field of isolated point-like Gaussians is resliced, and so are two volumes of the same points by
// vtkImageReslice: one that vtkBigusVoxelizer made, and one painted here with nothing of ours. Peaks are
// located to a fraction of a pixel by the centroid around them, and must agree to 0.1 pixel, and with the
// points' known places.

#include <algorithm>

#include "Filters/FilterTestSupport.h"
#include "vtkBigusReslice.h"
#include "vtkBigusVoxelizer.h"
#include "vtkImageReslice.h"
#include "vtkTransform.h"

namespace bigus::test
{
namespace
{

constexpr double pointSize = 0.9;   // mm, standard deviation
constexpr double voxelSize = 0.45;  // mm

/// Points at least 9 mm apart in a box of +-24 mm.
std::vector<Eigen::Vector3d> IsolatedPoints(Random& random, std::size_t count)
{
  std::vector<Eigen::Vector3d> points;
  while (points.size() < count)
  {
    const Eigen::Vector3d point = random.Vector(-24, 24);
    if (std::all_of(points.begin(), points.end(), [&](const auto& other) { return (point - other).norm() > 9; }))
    {
      points.push_back(point);
    }
  }
  return points;
}

GaussianField FieldOf(const std::vector<Eigen::Vector3d>& points)
{
  GaussianField field;
  field.Resize(points.size());
  field.means = points;
  for (Eigen::Vector3d& scale : field.scales)
  {
    scale.setConstant(pointSize);
  }
  std::fill(field.reflectivities.begin(), field.reflectivities.end(), 1.0);
  field.beam.elevationSigma = 0.5;  // round points stay round and in place, whatever the thickness
  return field;
}

/// The points painted voxel by voxel.
vtkSmartPointer<vtkImageData> Paint(const std::vector<Eigen::Vector3d>& points)
{
  auto image = vtkSmartPointer<vtkImageData>::New();
  const int side = 132;
  image->SetDimensions(side, side, side);
  image->SetSpacing(voxelSize, voxelSize, voxelSize);
  image->SetOrigin(-29.5, -29.3, -29.6);
  image->AllocateScalars(VTK_FLOAT, 1);
  image->GetPointData()->GetScalars()->Fill(0);
  for (const Eigen::Vector3d& point : points)
  {
    int low[3], high[3];
    for (int axis = 0; axis < 3; ++axis)
    {
      const double index = (point[axis] - image->GetOrigin()[axis]) / voxelSize;
      low[axis] = std::max(0, static_cast<int>(index - 6 * pointSize / voxelSize));
      high[axis] = std::min(side - 1, static_cast<int>(index + 6 * pointSize / voxelSize) + 1);
    }
    for (int k = low[2]; k <= high[2]; ++k)
    {
      for (int j = low[1]; j <= high[1]; ++j)
      {
        for (int i = low[0]; i <= high[0]; ++i)
        {
          const Eigen::Vector3d x = Eigen::Vector3d(image->GetOrigin()) + voxelSize * Eigen::Vector3d(i, j, k);
          *static_cast<float*>(image->GetScalarPointer(i, j, k)) +=
              static_cast<float>(std::exp(-0.5 * (x - point).squaredNorm() / (pointSize * pointSize)));
        }
      }
    }
  }
  return image;
}

/// Centroid, in indices, of what lies within `reach` pixels of `start`; follows the peak until it rests.
Eigen::Vector3d Peak(vtkImageData* image, Eigen::Vector3d start, const Eigen::Vector3d& reach)
{
  const int* extent = image->GetExtent();
  for (int pass = 0; pass < 20; ++pass)
  {
    Eigen::Vector3i first, last;
    for (int axis = 0; axis < 3; ++axis)
    {
      first[axis] = std::max(extent[2 * axis], static_cast<int>(std::ceil(start[axis] - 3 * reach[axis])));
      last[axis] = std::min(extent[2 * axis + 1], static_cast<int>(std::floor(start[axis] + 3 * reach[axis])));
    }
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 0;
    for (int k = first[2]; k <= last[2]; ++k)
    {
      for (int j = first[1]; j <= last[1]; ++j)
      {
        for (int i = first[0]; i <= last[0]; ++i)
        {
          // A smooth window, so that a pixel on its border does not decide.
          const Eigen::Vector3d index(i, j, k);
          const double distance = (index - start).cwiseQuotient(reach).squaredNorm();
          const double weight = distance < 9 ? FloatAt(image, i, j, k) * std::exp(-0.5 * distance) : 0;
          sum += weight * index;
          weights += weight;
        }
      }
    }
    if (!(weights > 0))
    {
      return Eigen::Vector3d::Constant(std::nan(""));
    }
    start = sum / weights;
  }
  return start;
}

class Geometry : public ::testing::TestWithParam<int>
{
};

TEST_P(Geometry, PeaksLieWhereVtkImageReslicePutsThem)
{
  const int trial = GetParam();
  Random random(1000 + trial);
  const int dimensionality = trial % 2 ? 3 : 2;
  const std::vector<Eigen::Vector3d> points = IsolatedPoints(random, 9);
  const auto field = ToPolyData(FieldOf(points));

  // The transform comes first: axes are chosen so that the plane, after it, passes through three of the
  // points.
  vtkNew<vtkTransform> transform;
  if (trial % 3)
  {
    transform->RotateWXYZ(random.Uniform(-180, 180), random.Vector(-1, 1).data());
    transform->Translate(random.Vector(-8, 8).data());
    transform->Scale(random.Uniform(0.8, 1.25), random.Uniform(0.8, 1.25), random.Uniform(0.8, 1.25));
  }
  const auto toAxes = [&](const Eigen::Vector3d& point)
  {
    Eigen::Vector3d out;
    transform->GetInverse()->TransformPoint(point.data(), out.data());
    return out;
  };
  const Eigen::Vector3d a = toAxes(points[0]), b = toAxes(points[1]), c = toAxes(points[2]);
  Eigen::Matrix3d rotation;
  rotation.col(2) = (b - a).cross(c - a).normalized();
  rotation.col(0) = (Eigen::AngleAxisd(random.Uniform(-3, 3), rotation.col(2)) * (b - a)).normalized();
  rotation.col(1) = rotation.col(2).cross(rotation.col(0));
  const Eigen::Vector3d centre = (a + b + c) / 3 + rotation.leftCols<2>() * Eigen::Vector2d(random.Uniform(-2, 2), 1);
  const auto axes = ToVtk(RigidMatrix(rotation, centre));
  const Eigen::Vector3d spacing(random.Uniform(0.35, 0.6), random.Uniform(0.35, 0.6), random.Uniform(0.5, 0.8));
  // In 2-D the origin along z is 0 whatever is set.
  Eigen::Vector3d origin(random.Uniform(-41, -39), random.Uniform(-41, -39), random.Uniform(-6.2, -5.8));
  const int extent[6] = {-2,
                         static_cast<int>(80 / spacing[0]),
                         5,
                         static_cast<int>(80 / spacing[1]),
                         dimensionality == 3 ? -1 : 0,
                         dimensionality == 3 ? static_cast<int>(12 / spacing[2]) : 0};

  vtkNew<vtkBigusReslice> ours;
  ours->SetInputData(field);
  ours->SetOutputModeToScatteringField();
  vtkNew<vtkBigusVoxelizer> voxelizer;
  voxelizer->SetInputData(field);
  voxelizer->SetOutputModeToScatteringField();
  voxelizer->SetOutputSpacing(voxelSize, voxelSize, voxelSize);
  vtkNew<vtkImageReslice> ofVoxels, ofPainting;
  ofVoxels->SetInputConnection(voxelizer->GetOutputPort());
  const auto painting = Paint(points);
  ofPainting->SetInputData(painting);
  const auto configure = [&](auto* reslice)
  {
    reslice->SetResliceAxes(axes);
    reslice->SetResliceTransform(trial % 3 ? transform.Get() : nullptr);
    reslice->SetOutputSpacing(spacing.data());
    reslice->SetOutputOrigin(origin.data());
    reslice->SetOutputExtent(extent);
    reslice->SetOutputDimensionality(dimensionality);
    reslice->Update();
  };
  configure(ours.Get());
  for (vtkImageReslice* theirs : {ofVoxels.Get(), ofPainting.Get()})
  {
    theirs->SetInterpolationModeToLinear();
    configure(theirs);
  }
  if (dimensionality == 2)
  {
    origin[2] = 0;
  }
  for (int i = 0; i < 3; ++i)
  {
    EXPECT_EQ(ours->GetOutput()->GetSpacing()[i], ofVoxels->GetOutput()->GetSpacing()[i]);
    EXPECT_EQ(ours->GetOutput()->GetOrigin()[i], ofVoxels->GetOutput()->GetOrigin()[i]);
  }

  int compared = 0;
  for (const Eigen::Vector3d& point : points)
  {
    const Eigen::Vector3d place = rotation.transpose() * (toAxes(point) - centre);
    const Eigen::Vector3d index = (place - origin).cwiseQuotient(spacing);
    // A stretched plane near a point shows its flank, whose peak is elsewhere; points in the plane are exact.
    const bool inPlane =
        dimensionality == 3 ? index[2] - extent[4] > 3.5 && extent[5] - index[2] > 3.5 : std::abs(place[2]) < 1e-9;
    const bool inside = (index.head<2>().array() > 12).all() && index[0] < extent[1] - 8 && index[1] < extent[3] - 8;
    if (!inPlane || !inside)
    {
      continue;
    }
    const Eigen::Vector3d reach = Eigen::Vector3d(1, 1, 1).cwiseQuotient(spacing);
    const Eigen::Vector3d here = Peak(ours->GetOutput(), index, reach);
    const Eigen::Vector3d voxels = Peak(ofVoxels->GetOutput(), index, reach);
    const Eigen::Vector3d painted = Peak(ofPainting->GetOutput(), index, reach);
    EXPECT_LT((here - voxels).norm(), 0.1) << here.transpose() << " | " << voxels.transpose();
    EXPECT_LT((here - painted).norm(), 0.1) << here.transpose() << " | " << painted.transpose();
    EXPECT_LT((here - index).norm(), 0.1) << here.transpose() << " | " << index.transpose();
    ++compared;
  }
  EXPECT_GE(compared, 2);
}

INSTANTIATE_TEST_SUITE_P(RandomPoses, Geometry, ::testing::Range(0, 12));

}  // namespace
}  // namespace bigus::test
