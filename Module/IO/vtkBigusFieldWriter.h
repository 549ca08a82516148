// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusFieldWriter
 * @brief   writes a field of signed 3-D Gaussians (.vtp, .ply)
 *
 * The input is a field as vtkBigusFieldReader and vtkBigusTrainer make it; it is checked first, and its cells
 * are not looked at. The name's ending chooses the format:
 *
 * - `.vtp`: native and exact: appended binary data compressed with zlib, numbers in 32 bits where that holds all of an
 * array's values, else in 64.
 * - `.ply`: binary little-endian, for viewers of 3-D Gaussian splats: x, y, z, normals (0), f_dc_0..2,
 * opacity, scale_0..2 (natural logarithm) and rot_0..3 (w, x, y, z) as float, which show |r|, and an own
 * property `reflectivity` (double, signed). Gamma, the elevation sigma, the format version and the provenance
 * are comment lines. Read back, reflectivity, gamma and elevation sigma are exact, the rest has float
 * precision.
 *
 * The file appears under its name only when it is complete; a failed write leaves nothing behind, and an
 * earlier file of that name as it was.
 */
#ifndef vtkBigusFieldWriter_h
#define vtkBigusFieldWriter_h

#include "vtkBigusIOModule.h"
#include "vtkVersionMacros.h"
#include "vtkWriter.h"

class vtkPolyData;

class VTKBIGUSIO_EXPORT vtkBigusFieldWriter : public vtkWriter
{
public:
  static vtkBigusFieldWriter* New();
  vtkTypeMacro(vtkBigusFieldWriter, vtkWriter);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The file to write, ending in .vtp or .ply. No default.
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

private:
  vtkBigusFieldWriter(const vtkBigusFieldWriter&) = delete;
  void operator=(const vtkBigusFieldWriter&) = delete;

  void WriteFile();  // sets the error code when it fails
};

#endif
