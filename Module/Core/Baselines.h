// What one can do without a field: four plain ways to predict a frame from other tracked frames.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "SlicePlane.h"
#include "Sweep.h"

namespace bigus
{

/// Each predictor sees only `training` frames of the sweep and writes width * height intensities in [0, 1].
/// Distances between planes are those of their image centres along the target's normal.

/// The training frame whose centre lies nearest to the plane's, pixel for pixel.
void PredictNearest(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane, float* image);

/// Mean of the training frames before and after index `frame` in the sequence, pixel for pixel (poses ignored).
/// At an end of the sweep the single neighbour.
void PredictNeighbourAverage(const Sweep& sweep, const std::vector<int>& training, int frame, float* image);

/// Pose-aware two-frame interpolation: every pixel's point is projected along the normal onto the nearest training
/// plane on either side, both frames sampled bilinearly there and mixed by inverse distance. Pixels with one side
/// only take that side; with none they are 0.
void PredictPoseInterpolation(const Sweep& sweep, const std::vector<int>& training, const SlicePlane& plane,
                              float* image);

/// Voxel compounding: trilinear paste of every training pixel into an axis-aligned grid, mean, holes filled from
/// filled neighbours within three voxels, trilinear reslice.
class Compounding
{
public:
  /// voxelSize in mm; 0 chooses the larger of twice the pixel size and the median plane spacing. Throws Error when
  /// the grid would exceed maximumVoxels.
  Compounding(const Sweep& sweep, const std::vector<int>& training, double voxelSize = 0,
              std::size_t maximumVoxels = std::size_t(1) << 30);
  void Predict(const SlicePlane& plane, float* image) const;
  double VoxelSize() const { return voxelSize_; }

private:
  Eigen::Vector3d origin_;
  Eigen::Vector3i size_;
  double voxelSize_;
  std::vector<float> voxels_;
};

}  // namespace bigus
