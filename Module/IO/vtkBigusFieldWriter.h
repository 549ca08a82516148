// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusFieldWriter
 * @brief   writes a field of signed 3-D Gaussians (.vtp, .pvtp, .ply)
 *
 * The input is a field as vtkBigusFieldReader and vtkBigusTrainer make it; it is checked first, and its cells
 * are not looked at. The name's ending chooses the format:
 *
 * - `.vtp`: native and exact: appended binary data compressed with zlib, numbers in 32 bits where that holds all of an
 * array's values, else in 64.
 * - `.pvtp`: an index and NumberOfPieces files beside it, `field_0.vtp` and so on for `field.pvtp`. Each holds a chunk, so
 * that processes may read and render them piecewise.
 * - `.ply`: binary little-endian, for viewers of 3-D Gaussian splats: x, y, z, normals (0), f_dc_0..2,
 * opacity, scale_0..2 (natural logarithm) and rot_0..3 (w, x, y, z) as float, which show |r|, and an own
 * property `reflectivity` (double, signed). Gamma, the elevation sigma, the format version and the provenance
 * are comment lines. Read back, reflectivity, gamma and elevation sigma are exact, the rest has float
 * precision.
 *
 * The file appears under its name only when it is complete; a failed write leaves nothing behind, and an
 * earlier file of that name as it was. With a Controller this holds for all processes together, and for index and pieces
 * of a `.pvtp`.
 */
#ifndef vtkBigusFieldWriter_h
#define vtkBigusFieldWriter_h

#include <functional>  // for what processes do together

#include "vtkBigusIOModule.h"
#include "vtkVersionMacros.h"
#include "vtkWriter.h"

namespace bigus
{
class Exchange;
}  // namespace bigus
#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkMultiProcessController;
class vtkPolyData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSIO_EXPORT vtkBigusFieldWriter : public vtkWriter
{
public:
  static vtkBigusFieldWriter* New();
  vtkTypeMacro(vtkBigusFieldWriter, vtkWriter);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The file to write, ending in .vtp, .pvtp or .ply. No default.
   */
  vtkSetFilePathMacro(FileName);
  vtkGetFilePathMacro(FileName);
  ///@}

  ///@{
  /**
   * Drop the digits that no picture shows: files of trained fields become a third as large, and pictures change by some
   * 88 dB (PSNR), which costs a field of 60 dB 0.007 dB. Core/Model/FieldRounding.h has the steps. Default off.
   */
  vtkSetMacro(Rounding, bool);
  vtkGetMacro(Rounding, bool);
  vtkBooleanMacro(Rounding, bool);
  ///@}

  ///@{
  /**
   * Of a .pvtp, 1 to 4096, default 16. Only a power of two can be rendered with the same bits by any number of processes.
   */
  vtkSetMacro(NumberOfPieces, int);
  vtkGetMacro(NumberOfPieces, int);
  ///@}

  ///@{
  /**
   * Processes that have one field together, each a part of it, as vtkBigusPartitionField leaves it to them. All call Write()
   * with the same FileName, a .pvtp in a folder that they share, and each writes its part as one piece, whatever
   * NumberOfPieces says. What fails in one process is an error in all. Null (default), or a controller of one process: the
   * input is the whole field.
   */
  virtual void SetController(vtkMultiProcessController*);
  vtkMultiProcessController* GetController() { return this->Controller; }
  ///@}

  int Write() override;

  vtkPolyData* GetInput();

protected:
  vtkBigusFieldWriter();
  ~vtkBigusFieldWriter() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 7, 0)
  bool WriteDataAndReturn() override;
#else
  void WriteData() override;
#endif

  char* FileName;
  bool Rounding = false;
  int NumberOfPieces;
  vtkMultiProcessController* Controller = nullptr;

private:
  vtkBigusFieldWriter(const vtkBigusFieldWriter&) = delete;
  void operator=(const vtkBigusFieldWriter&) = delete;

  void WriteFile();
  /// Does the work, with all processes if there are several. Sets the error code when it fails.
  void Together(const std::function<void(bigus::Exchange&)>& work);

  bool HasTold = false;  // others of this write
};

#endif
