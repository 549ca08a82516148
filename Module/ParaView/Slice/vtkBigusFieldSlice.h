// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusFieldSlice
 * @brief   A slice of a Gaussian field as one image at its place in space
 *
 * Input 0 is a field (see vtkBigusTrainer). The output is what vtkBigusReslice renders, in the form that ParaView needs: an
 * image whose origin, spacing and direction matrix put it where the plane lies in the field's frame, mm, with all that is
 * known of a pixel as point arrays:
 *
 * | array | type | meaning |
 * |---|---|---|
 * | `Intensity`, `Scattering` or `LabelShare` | float | the pixel, as OutputMode says; active scalars |
 * | `Coverage` | float | summed weight of all footprints: 0 where the sweep saw nothing |
 * | `Distance` | float | mm to the nearest recorded frame; with input 1 |
 * | `Recorded` | as the sweep | what the frame shows; with Frame |
 * | `Labels` | unsigned char | the value of the label that the pixel has, or 0; with Labels |
 * | `StandardError` | float | how far a recorded frame may be from the pixel (vtkBigusReslice, output 4); with StandardError |
 *
 * Input 1, optional, is the sweep that the field was trained on.
 *
 * The plane is given by a point and a normal, as a plane widget gives them. Its picture's rows run along `Down`, as seen
 * in the plane. With Frame set, the plane and its pixels are those of that frame of the sweep instead.
 *
 * On a server of several processes (pvserver) behind a vtkBigusFieldReader each process reads a part of the field, and all
 * render the slice together, with the same bits for any number of them but one.
 *
 * @sa vtkBigusReslice
 */
#ifndef vtkBigusFieldSlice_h
#define vtkBigusFieldSlice_h

#include <string>  // for messages

#include "vtkBigusSliceModule.h"  // for the export macro
#include "vtkImageAlgorithm.h"
#include "vtkNew.h"  // for the reslice

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkAlgorithmOutput;
class vtkPolyData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif
class vtkBigusReslice;

class VTKBIGUSSLICE_EXPORT vtkBigusFieldSlice : public vtkImageAlgorithm
{
public:
  static vtkBigusFieldSlice* New();
  vtkTypeMacro(vtkBigusFieldSlice, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  /** The sweep that the field was trained on (input 1). Default: none. */
  void SetSweepConnection(vtkAlgorithmOutput* port) { this->SetInputConnection(1, port); }

  ///@{
  /**
   * A point of the plane, mm. Default: 0, 0, 0.
   */
  vtkSetVector3Macro(Origin, double);
  vtkGetVector3Macro(Origin, double);
  ///@}

  ///@{
  /**
   * The plane's normal, of any length but 0. Default: 0, 0, 1.
   */
  vtkSetVector3Macro(Normal, double);
  vtkGetVector3Macro(Normal, double);
  ///@}

  ///@{
  /**
   * The direction in which the picture's rows follow each other, brought into the plane; columns run along Down x Normal.
   * Where it is parallel to the normal, z stands in, and then x. Default: 0, 1, 0.
   */
  vtkSetVector3Macro(Down, double);
  vtkGetVector3Macro(Down, double);
  ///@}

  ///@{
  /**
   * Columns and rows, 1 to 16384 each. Default: 512, 512.
   */
  vtkSetVector2Macro(Size, int);
  vtkGetVector2Macro(Size, int);
  ///@}

  ///@{
  /**
   * Side of a pixel, mm. 0 (default): the smallest that shows the whole field, and the picture is centred on the field.
   * Else the picture is centred on Origin.
   */
  vtkSetMacro(PixelSize, double);
  vtkGetMacro(PixelSize, double);
  ///@}

  ///@{
  /**
   * A frame of the sweep, counted from 0, whose plane and pixels are shown. -1 (default): the plane above.
   */
  vtkSetMacro(Frame, int);
  vtkGetMacro(Frame, int);
  ///@}

  ///@{
  /**
   * Whether pixels that the sweep never saw are left out of what is drawn (they are marked as hidden points; their values
   * are there): those whose coverage is at most CoverageThreshold times the field's mean coverage, as in vtkBigusSliceProp.
   * Default: on, 0.1; the threshold is at least 0.
   */
  vtkSetMacro(HideUnseen, vtkTypeBool);
  vtkGetMacro(HideUnseen, vtkTypeBool);
  vtkBooleanMacro(HideUnseen, vtkTypeBool);
  vtkSetClampMacro(CoverageThreshold, double, 0, VTK_DOUBLE_MAX);
  vtkGetMacro(CoverageThreshold, double);
  ///@}

  ///@{
  /**
   * Whether the array StandardError is made, which takes about as long as the slice. An error where the field was trained
   * without it, or lies on several processes. Default: off.
   */
  vtkSetMacro(StandardError, vtkTypeBool);
  vtkGetMacro(StandardError, vtkTypeBool);
  vtkBooleanMacro(StandardError, vtkTypeBool);
  ///@}

  ///@{
  /**
   * Whether the array Labels is made, with names and colours in the field data as in the field (Data/LabelData.h). An error
   * where the field has no labels or lies on several processes. Four labels take as long as one or two slices. Default: off.
   */
  vtkSetMacro(Labels, vtkTypeBool);
  vtkGetMacro(Labels, vtkTypeBool);
  vtkBooleanMacro(Labels, vtkTypeBool);
  ///@}

  ///@{
  /**
   * As in vtkBigusReslice, which holds them.
   */
  void SetOutputMode(int mode);
  int GetOutputMode();
  void SetLabelValue(int value);
  int GetLabelValue();
  void SetElevationSigma(double sigma);
  double GetElevationSigma();
  void SetTolerance(double tolerance);
  double GetTolerance();
  void SetEngine(const char* engine);
  const char* GetEngine();
  ///@}

protected:
  vtkBigusFieldSlice();
  ~vtkBigusFieldSlice() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;
  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  double Origin[3] = {0, 0, 0};
  double Normal[3] = {0, 0, 1};
  double Down[3] = {0, 1, 0};
  int Size[2] = {512, 512};
  double PixelSize = 0;
  int Frame = -1;
  vtkTypeBool HideUnseen = 1;
  double CoverageThreshold = 0.1;
  vtkTypeBool StandardError = 0;
  vtkTypeBool Labels = 0;

private:
  vtkBigusFieldSlice(const vtkBigusFieldSlice&) = delete;
  void operator=(const vtkBigusFieldSlice&) = delete;

  bool Fail(const std::string& message);
  /// The bounds of the whole field; false where a process has no part of it.
  bool MeasureField(vtkPolyData* field);
  bool PlaceAtPlane();
  bool PlaceAtFrame(vtkImageData* sweep);

  vtkNew<vtkBigusReslice> Reslice;
  bool IsInParts = false;  // the update in progress: every process of the server has a part of the field
  double FieldBounds[6];   // mm, of the update in progress
};

#endif
