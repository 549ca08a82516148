// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusPoseReader
 * @brief   reads slice planes: the poses of a sequence, a CSV of poses, or 3D Slicer's markup planes
 *
 * The output table has one row a plane:
 *
 * - `ImageToReference`: double, 16 components row-major: maps a 0-based pixel index (i, j, 0, 1) to mm in the
 *   world of the field.
 * - `Size`: int, 2 components: width and height in pixels; 0, 0 where the file does not say.
 * - `SourceFrame`: int: 0-based index in the file.
 * - `Timestamp`: double, seconds. Only when every plane has one.
 *
 * A sequence and a CSV are read as by vtkBigusSequenceReader (same rules, same rejections) but without
 * pixels; a CSV takes sizes from optional columns `width` and `height`, else from the PNG images named in
 * `image`. Markups (.mrk.json), to which the options of vtkBigusTrackedReader do not apply, give one plane for each
 * markup of type Plane: columns run along the plane's x axis, rows along its y axis, PixelSpacing mm apart, centred on
 * the plane's centre and covering its size.
 *
 * 3D Slicer's files carry their own coordinate system (LPS by default), while the coordinates of a tracked
 * sequence, as Slicer shows them, are RAS. WorldCoordinateSystem says which of the two the field is in.
 */
#ifndef vtkBigusPoseReader_h
#define vtkBigusPoseReader_h

#include <string>

#include "vtkBigusIOModule.h"
#include "vtkBigusTrackedReader.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkTable;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSIO_EXPORT vtkBigusPoseReader : public vtkBigusTrackedReader
{
public:
  static vtkBigusPoseReader* New();
  vtkTypeMacro(vtkBigusPoseReader, vtkBigusTrackedReader);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  vtkTable* GetOutput();

  ///@{
  /**
   * For markups: distance of neighbouring pixels, mm, > 0. Default: 0.5.
   */
  vtkSetMacro(PixelSpacing, double);
  vtkGetMacro(PixelSpacing, double);
  ///@}

  enum CoordinateSystemType
  {
    RAS = 0,
    LPS = 1
  };

  ///@{
  /**
   * For markups: the patient coordinate system that the field's world stands for. Default: RAS, which is how
   * 3D Slicer places a tracked sequence.
   */
  vtkSetClampMacro(WorldCoordinateSystem, int, RAS, LPS);
  vtkGetMacro(WorldCoordinateSystem, int);
  void SetWorldCoordinateSystemToRAS() { this->SetWorldCoordinateSystem(RAS); }
  void SetWorldCoordinateSystemToLPS() { this->SetWorldCoordinateSystem(LPS); }
  ///@}

  ///@{
  /**
   * After an update: how many poses of the file were rejected, and which and why, in a sentence; 0 and an
   * empty text when none was. Markups are never rejected one by one.
   */
  vtkGetMacro(NumberOfRejectedPoses, int);
  const char* GetRejectionSummary() const { return this->RejectionSummary.c_str(); }
  ///@}

protected:
  vtkBigusPoseReader();
  ~vtkBigusPoseReader() override;

  int FillOutputPortInformation(int port, vtkInformation* info) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  double PixelSpacing = 0.5;
  int WorldCoordinateSystem = RAS;
  int NumberOfRejectedPoses = 0;

private:
  vtkBigusPoseReader(const vtkBigusPoseReader&) = delete;
  void operator=(const vtkBigusPoseReader&) = delete;

  std::string RejectionSummary;
};

#endif
