// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusFieldToImage
 * @brief   Base of the filters that render a Gaussian field into an image
 *
 * The input is a field: a vtkPolyData whose points are Gaussians (see vtkBigusTrainer for its arrays). Output 0 is an
 * image of it. This class holds what a pixel shows, how exactly it is computed and by what; a subclass says where the
 * pixels lie.
 *
 * Every slice k of the output is a plane of its own. Any part of the output may be asked for, whole or streamed: each
 * pixel comes out with the same bits. The field stays on the engine between updates; it is uploaded again when the
 * input, Engine or ElevationSigma changes.
 *
 * @sa vtkBigusReslice vtkBigusVoxelizer
 */
#ifndef vtkBigusFieldToImage_h
#define vtkBigusFieldToImage_h

#include <functional>  // for what processes agree on
#include <memory>      // for the renderer

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkImageAlgorithm.h"

namespace bigus
{
class FieldRenderer;
struct GivenGrid;
struct GridPart;
class LabelledField;
struct OutputGrid;
struct PixelBand;
struct Slab;
class StandardError;
}  // namespace bigus

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkMultiProcessController;
class vtkPolyData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSFILTERS_EXPORT vtkBigusFieldToImage : public vtkImageAlgorithm
{
public:
  vtkAbstractTypeMacro(vtkBigusFieldToImage, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * Distance between pixels along each axis of the output, 1e-6 to 1e6 mm. Default: derived, the subclass says how.
   */
  virtual void SetOutputSpacing(double x, double y, double z);
  virtual void SetOutputSpacing(const double spacing[3]);
  vtkGetVector3Macro(OutputSpacing, double);
  void SetOutputSpacingToDefault();
  ///@}

  ///@{
  /**
   * Place of pixel (0, 0, 0), mm. The subclass says in which axes. Default: derived, the subclass says how.
   */
  virtual void SetOutputOrigin(double x, double y, double z);
  virtual void SetOutputOrigin(const double origin[3]);
  vtkGetVector3Macro(OutputOrigin, double);
  void SetOutputOriginToDefault();
  ///@}

  /** What a pixel holds. */
  enum
  {
    Intensity = 0,        ///< displayed grey I in [0, 1); 0 to 255 for 8-bit output
    ScatteringField = 1,  ///< S before the transfer function: signed, linear in reflectivity
    LabelShare = 2        ///< what of a pixel has the label LabelValue, 0 to 1; 0 to 255 for 8-bit output
  };

  ///@{
  /**
   * What a pixel holds, default Intensity. ScatteringField needs float output.
   */
  vtkSetClampMacro(OutputMode, int, Intensity, LabelShare);
  vtkGetMacro(OutputMode, int);
  void SetOutputModeToIntensity() { this->SetOutputMode(Intensity); }
  void SetOutputModeToScatteringField() { this->SetOutputMode(ScatteringField); }
  void SetOutputModeToLabelShare() { this->SetOutputMode(LabelShare); }
  ///@}

  ///@{
  /**
   * Which label LabelShare shows, by its value, 1 (default) to 255. vtkBigusFieldLabeler gives a field labels. The border of
   * what has the label lies at 0.5.
   */
  vtkSetClampMacro(LabelValue, int, 1, 255);
  vtkGetMacro(LabelValue, int);
  ///@}

  ///@{
  /**
   * VTK_FLOAT (default) or VTK_UNSIGNED_CHAR: round(255 I).
   */
  vtkSetMacro(OutputScalarType, int);
  vtkGetMacro(OutputScalarType, int);
  void SetOutputScalarTypeToFloat() { this->SetOutputScalarType(VTK_FLOAT); }
  void SetOutputScalarTypeToUnsignedChar() { this->SetOutputScalarType(VTK_UNSIGNED_CHAR); }
  ///@}

  ///@{
  /**
   * Standard deviation of the elevation profile, mm: how thick a slice is seen. 0 is an infinitely thin plane, which
   * shows the field itself. Negative: the one the field was trained under. It is measured in the field's frame along
   * the normal of the output's slices, whatever the axes scale. Default: -1 in vtkBigusReslice, 0 in
   * vtkBigusVoxelizer.
   */
  vtkSetMacro(ElevationSigma, double);
  vtkGetMacro(ElevationSigma, double);
  ///@}

  ///@{
  /**
   * The most by which a pixel's intensity may be off because Gaussians too faint to matter are left out, 0 to 1,
   * default 1e-4 (a fortieth of a grey level of 255). 0 evaluates every Gaussian at every pixel.
   */
  vtkSetMacro(Tolerance, double);
  vtkGetMacro(Tolerance, double);
  ///@}

  ///@{
  /**
   * The most pixels one update may ask for; more is an error before anything is allocated. Default 2^29 (2 GiB of
   * float), at least 1. A larger output can be streamed.
   */
  vtkSetClampMacro(MaximumOutputPixels, vtkIdType, 1, VTK_ID_MAX);
  vtkGetMacro(MaximumOutputPixels, vtkIdType);
  ///@}

  ///@{
  /**
   * Which engine renders: "auto" (default, the fastest present), "cpu", "cpu-double", "reference" (double precision,
   * every Gaussian at every pixel, slow), or the name of a plug-in.
   */
  vtkSetStringMacro(Engine);
  vtkGetStringMacro(Engine);
  ///@}

  ///@{
  /**
   * Processes that hold one field together, each as its input a part of it; null (default): the input is the whole field.
   * Several need the module FiltersParallel, whose vtkBigusPartitionField makes parts. The same filter with the same settings and the same requests runs in every
   * process, and each gets the whole answer. It has the same bits for any number of processes, as long as the field is
   * split into the same number of chunks. It differs from that of the whole field by rounding and by what Tolerance
   * allows. What fails in one process is an error in all, before anything is added up. Processes without a part give an
   * empty one.
   */
  virtual void SetController(vtkMultiProcessController*);
  vtkMultiProcessController* GetController() { return this->Controller; }
  ///@}

  ///@{
  /**
   * Whether the output of standard errors is filled (4 of vtkBigusReslice, 1 of vtkBigusVoxelizer): a float for every pixel,
   * the standard deviation of what a probe would show there about the intensity, in units of it (1 is white, whatever
   * OutputScalarType and OutputMode are), and not a number where the training frames do not tell (Core/StandardError). It is
   * that of the output's slices, one by one, as thick as they are. The field must have been trained with it, and must be
   * whole. It takes about as long as the image. Default off.
   */
  vtkSetMacro(GenerateStandardErrorOutput, vtkTypeBool);
  vtkGetMacro(GenerateStandardErrorOutput, vtkTypeBool);
  vtkBooleanMacro(GenerateStandardErrorOutput, vtkTypeBool);
  ///@}

  ///@{
  /**
   * The standard error, float, in units of intensity.
   */
  vtkAlgorithmOutput* GetStandardErrorOutputPort() { return this->GetOutputPort(this->StandardErrorPort); }
  vtkImageData* GetStandardErrorOutput();
  ///@}

  /** What rendered the last output, for example "CPU (AVX2, 2 threads)"; empty before. */
  const char* GetDevice() const;

protected:
  vtkBigusFieldToImage();
  ~vtkBigusFieldToImage() override;

  vtkExecutive* CreateDefaultExecutive() override;
  int FillInputPortInformation(int port, vtkInformation* info) override;
  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  /// The grid over the input along unit axes, the columns of a matrix given row by row. The input is brought up to date,
  /// and read again only when it changed. Throws bigus::Error.
  bigus::OutputGrid GridOverInput(const double axes[9], int maximumDimension);

  /// The geometry of the output. `given`: OutputSpacing and OutputOrigin where they are set, found sound. Throws
  /// bigus::Error.
  virtual bigus::OutputGrid ComputeGrid(bigus::GivenGrid given) = 0;

  /// The 4 x 4 matrix, row by row, that takes an output index (i, j, k, 1) to mm in the field's frame. Throws
  /// bigus::Error.
  virtual void ComputeIndexToWorld(const double spacing[3], const double origin[3], double matrix[16]) = 0;

  /// The planes that every slice of the output is joined from; a single one unless a subclass says otherwise. Throws
  /// bigus::Error.
  virtual bigus::Slab ComputeSlab();

  /// Gives the outputs their geometry and memory for their pixels. `extent` is what was asked for.
  virtual void AllocateOutputs(vtkInformationVector* outputs, const int extent[6]);

  /// Whether planes see what the field knows of directions. A volume has none.
  virtual bool SeesDirections() { return false; }
  /// See vtkBigusReslice::GetViewNearness.
  double NearnessOfView() const;
  /// See vtkBigusReslice::GetMeanCoverage.
  double MeanOfCoverage() const;

  /// Whether bands must come with coverage.
  virtual bool NeedsCoverage() { return false; }

  /// Whether the first output has floats as single planes show them, given that planes are not joined.
  virtual bool KeepsIntensities() { return this->OutputMode == Intensity && this->OutputScalarType == VTK_FLOAT; }

  /// Writes what was rendered into the outputs. Bands come in order and cover the extent asked for.
  virtual void StoreBand(const bigus::PixelBand& band, vtkInformationVector* outputs);

  /// Fills outputs that need the whole rendered extent. `render` gives the intensities of single planes in another part of
  /// the same grid, [depth][height][width], by its extent; false: stop, which is handed on. Throws bigus::Error.
  virtual bool CompleteOutputs(const bigus::GridPart& grid, const std::function<bool(const int*, float*)>& render,
                               vtkInformationVector* outputs);

  /// The input. Throws bigus::Error where processes have parts of one, in the name of what needs it whole.
  vtkPolyData* WholeField(const char* output);
  /// The input's labels as it is seen. Throws bigus::Error where it has none.
  bigus::LabelledField& Labelled();
  /// What the last standard error rested on; null: there was none.
  const bigus::StandardError* KeptStandardError() const;

  double OutputSpacing[3] = {1, 1, 1};
  double OutputOrigin[3] = {0, 0, 0};
  bool ComputeOutputSpacing = true;
  bool ComputeOutputOrigin = true;
  int OutputMode = Intensity;
  int LabelValue = 1;
  int OutputScalarType = VTK_FLOAT;
  double ElevationSigma = -1;
  double Tolerance = 1e-4;
  vtkIdType MaximumOutputPixels = vtkIdType(1) << 29;
  vtkTypeBool GenerateStandardErrorOutput = 0;
  int StandardErrorPort = 1;
  char* Engine = nullptr;

private:
  vtkBigusFieldToImage(const vtkBigusFieldToImage&) = delete;
  void operator=(const vtkBigusFieldToImage&) = delete;

  /// Does it, in agreement with all processes if there are several. Throws bigus::Error.
  void Agree(const std::function<void()>& work);
  /// Tells other processes, which wait for this one, that it has no input.
  void TellOfNoInput();

  void LoadStandardError();

  struct Errors;
  std::unique_ptr<Errors> Kept;  // the input's standard error as read last
  std::unique_ptr<bigus::FieldRenderer> Renderer;
  vtkMultiProcessController* Controller = nullptr;
  bool WaitsForInput = false;
};

#endif
