// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What vtkBigusReslice and vtkBigusVoxelizer share: a field on an engine, rendered on a grid of planes band
// by band.
#ifndef vtkBigusFieldRenderer_h
#define vtkBigusFieldRenderer_h

#include <Eigen/Dense>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "vtkType.h"

class vtkAlgorithm;
class vtkImageData;
class vtkInformationVector;
class vtkPolyData;

namespace bigus
{

/// Reports progress from 0 to 1 to the filter's observers; false when they asked it to stop.
bool ReportProgress(vtkAlgorithm* filter, double fraction);

/// An axis-aligned grid of cubic voxels.
struct FieldGrid
{
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< centre of voxel (0, 0, 0), along the grid's axes
  double spacing = 1;                                ///< mm
  Eigen::Vector3i dimensions = Eigen::Vector3i::Ones();
};

/// The grid along the columns of `axes` (unit vectors) that holds every Gaussian to three standard
/// deviations, with `maximumDimension` voxels along its longest side. The empty field gets one voxel at 0.
FieldGrid GridOver(const GaussianField& field, const Eigen::Matrix3d& axes, int maximumDimension);

/// Brings the filter's first input up to date and returns it; null when there is none.
vtkPolyData* UpdatedInput(vtkAlgorithm* filter);

/// Asks the connections of an input port for all of their data, whole images and undivided fields.
void RequestWholeInput(vtkInformationVector* connections);

/// Withdraws what was asked of a filter that failed: VTK keeps it otherwise, and adds it to every later
/// request.
void ForgetRequests(vtkInformationVector* outputs);

/// Throws Error unless pixels of this type can hold what is wanted.
void CheckPixelFormat(ViewOutput output, int scalarType);

/// Throws Error unless a grid's spacing and origin (mm) can be worked with.
void CheckGrid(const double spacing[3], const double origin[3]);

/// Number of indices in a VTK extent, as a double because that cannot overflow.
double ExtentSize(const int extent[6]);

/// Throws Error when the extent holds more pixels than allowed.
void CheckOutputSize(const int extent[6], vtkIdType maximum);

/// Gives the image its extent and pixels, all 0.
void AllocatePixels(vtkImageData* image, const int extent[6], int scalarType, const char* name);

/// Writes values into pixels from `first` on: as they are in float, round(255 v) clamped in unsigned char.
void StorePixels(const float* values, vtkIdType first, vtkIdType count, vtkImageData* image);

class FieldRenderer
{
public:
  struct Settings
  {
    std::string engine = "auto";
    double elevationSigma = -1;  ///< mm; negative: the field's own
    double tolerance = 1e-4;     ///< on the intensity of a pixel; 0 leaves nothing out
  };

  /// The field of this input, read again only when it changed. Throws Error.
  const GaussianField& Load(vtkPolyData* input);

  /// Makes the engine hold the field of this input. Uploads only what changed since the last call. Throws
  /// Error.
  void Upload(vtkPolyData* input, const Settings& settings);

  /// Some whole rows of one slice, or several whole slices.
  struct Band
  {
    vtkIdType first, count;  ///< pixels, counted from the start of the extent asked for
    float* image;            ///< [count], may be changed
    const float* coverage;   ///< [count], or null when not asked for
    double fraction;         ///< of the whole work, after this band
  };

  /// Renders `extent`, a part of `whole`, of the grid whose index (i, j, k) lies at `indexToWorld` (i, j, k,
  /// 1), mm. Every slice k is a plane of its own. What a pixel gets does not depend on `extent`. `receive`
  /// takes the bands in order and returns false to stop; so does Render then.
  bool Render(const Eigen::Matrix4d& indexToWorld, const int whole[6], const int extent[6], ViewOutput output,
              bool coverage, const std::function<bool(const Band&)>& receive);

  const std::string& Device() const { return device_; }

private:
  GaussianField field_;
  vtkPolyData* input_ = nullptr;  // compared, never followed
  vtkMTimeType inputTime_ = 0;
  std::unique_ptr<Engine> engine_;
  std::string engineName_, device_;
  std::optional<double> uploadedSigma_;  // mm, of the field on the engine; none when it holds another
  double pixelsPerBand_ = 0;             // as many as take about 30 ms, so that an abort is heard in time
};

}  // namespace bigus

#endif
