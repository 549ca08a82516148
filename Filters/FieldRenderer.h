// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field rendered on a grid of planes: what vtkBigusFieldToImage and its subclasses compute with.
#ifndef BigusFieldRenderer_h
#define BigusFieldRenderer_h

#include <Eigen/Dense>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Core/Engine/Engine.h"
#include "FieldParts.h"
#include "vtkType.h"

class vtkImageData;
class vtkPolyData;

namespace bigus
{

/// An axis-aligned grid of cubic voxels.
struct FieldGrid
{
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< centre of voxel (0, 0, 0), along the grid's axes
  double spacing = 1;                                ///< mm
  Eigen::Vector3i dimensions = Eigen::Vector3i::Ones();
};

/// The grid along the columns of `axes` (unit vectors) that holds every Gaussian to three standard
/// deviations, with `maximumDimension` voxels along its longest side. The empty field gets one voxel at 0. `parts`: of
/// the whole field, of which `field` is the part of this process; null: it is whole.
FieldGrid GridOver(const GaussianField& field, const Eigen::Matrix3d& axes, int maximumDimension,
                   const FieldParts* parts = nullptr);

/// Throws Error unless a grid's spacing and origin (mm) can be worked with.
void CheckGrid(const double spacing[3], const double origin[3]);

/// Number of indices in a VTK extent, as a double because that cannot overflow.
double ExtentSize(const int extent[6]);

/// Gives the image its extent and pixels, whose values are not set yet.
void AllocatePixels(vtkImageData* image, const int extent[6], int scalarType, const char* name);

/// Writes values into pixels from `first` on: as they are in float, round(255 v) clamped in unsigned char.
void StorePixels(const float* values, vtkIdType first, vtkIdType count, vtkImageData* image);

/// Some whole rows of one slice, or several whole slices.
struct PixelBand
{
  vtkIdType first, count;  ///< pixels, counted from the start of the extent asked for
  float* image;            ///< [count], may be changed
  const float* coverage;   ///< [count], or null when not asked for
  double fraction;         ///< of the whole work, after this band
};

/// A thick slice: several parallel planes, joined pixel by pixel into one. What vtkImageReslice calls a slab.
struct Slab
{
  enum Mode
  {
    Min,
    Max,
    Mean,
    Sum
  };
  int planes = 1;          ///< 1 is a single plane, as it is
  double spacing = 1;      ///< between the planes, in steps between two slices of the grid
  Mode mode = Mean;        ///< how pixels are joined; coverage is always the largest of the planes'
  bool trapezoid = false;  ///< the first and last plane count half in Mean and Sum
};

/// A field on an engine, rendered on a grid of planes band by band.
class FieldRenderer
{
public:
  struct Settings
  {
    std::string engine = "auto";
    double elevationSigma = -1;  ///< mm, of every plane; negative: the field's beam (Core/Model/Beam.h)
    double tolerance = 1e-4;     ///< on the intensity of a pixel; 0 leaves nothing out
  };

  /// The fields given are parts of one, which several processes render together; null: they are whole. Then every
  /// process calls all other members in the same order, with the same settings and planes.
  void SetParts(std::unique_ptr<FieldParts> parts);
  const FieldParts* Parts() const { return parts_.get(); }

  /// The field of this input, read again only when it changed. Throws Error.
  const GaussianField& Load(vtkPolyData* input);

  /// Makes the engine hold the field of this input. Uploads only what changed since the last call. Throws Error.
  void Upload(vtkPolyData* input, const Settings& settings);

  /// Renders `extent`, a part of `whole`, of the grid whose index (i, j, k) lies at `indexToWorld` (i, j, k, 1), mm. Every
  /// slice k is a slab of its own, whose middle lies there. What a pixel gets does not depend on `extent`. `receive` takes
  /// the bands in order and returns false to stop; then Render returns false, too.
  bool Render(const Eigen::Matrix4d& indexToWorld, const int whole[6], const int extent[6], ViewOutput output,
              bool coverage, const Slab& slab, const std::function<bool(const PixelBand&)>& receive);

  const std::string& Device() const { return device_; }

private:
  void UploadHere(vtkPolyData* input, const Settings& settings);
  void RenderWindow(const SlicePlane& plane, const Engine::Window& window, ViewOutput output, float* image,
                    float* coverage);

  std::unique_ptr<FieldParts> parts_;
  FieldChunks chunks_;
  TransferFunction transfer_;  // of the whole field, where there are parts
  GaussianField field_;
  vtkPolyData* input_ = nullptr;  // compared, never followed
  vtkMTimeType inputTime_ = 0;
  std::vector<std::unique_ptr<Engine>> engines_;  // one, or one for each chunk of this process
  std::string engineName_, device_;
  std::optional<double> uploadedSigma_;            // mm, of the field on the engine; none when it holds another
  std::vector<float> image_, coverage_;            // of a band, kept because memory that is new is slow
  std::vector<float> planeImage_, planeCoverage_;  // of one plane of a slab
  double pixelsPerBand_ = 0;                       // as many as take about 30 ms, so that an abort is heard in time
};

}  // namespace bigus

#endif
