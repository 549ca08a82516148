// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusFieldReader
 * @brief   reads a field of signed 3-D Gaussians (.vtp, .pvtp, .ply)
 *
 * The output is points in mm (double) with point data `Scale` [3] (standard deviations, mm), `Rotation` [4]
 * (quaternion w, x, y, z) and `Reflectivity` [1] (signed, active scalars), one vertex cell a point, and field
 * data `Gamma` [1], `ElevationSigma` [1] mm, `FormatVersion` [1] and, where the file has it, `Provenance`
 * (strings key=value). A field without any Gaussian is valid.
 *
 * `.vtp` is the native format. `.ply` (ascii or binary) is read both as written by vtkBigusFieldWriter and as
 * 3-D Gaussian splatting programs write it; in the latter case the reflectivity is taken from opacity and
 * colour: r = sigmoid(opacity) * clamp(luminance, 0, 1), where the luminance is that of the colour
 * 0.5 + 0.2821 f_dc with weights 0.2126, 0.7152, 0.0722, Gamma is 1 and ElevationSigma 0. Spherical harmonics above
 * order 0 are ignored.
 *
 * `.pvtp` is an index of `.vtp` files in its folder, which are read one after the other.
 *
 * When piece k of n is asked for (UpdatePiece(k, n, 0), which vtkBigusPartitionField does), a `.vtp` or `.ply` gives the
 * Gaussians that vtkBigusPartitionField with NumberOfChunks would choose, and a `.pvtp` the files of the piece, each of
 * which is a chunk. The field data array `Chunks` says which chunks those are; a piece that
 * cannot be read is empty and has none, and filters behind it still run, so that they can tell other processes. Of a file that vtkBigusFieldWriter wrote
 * nothing else is kept in memory.
 *
 * Arrays that are missing, of the wrong shape or hold a value that is not allowed (not finite, scale <= 0,
 * zero quaternion) are an error that names the file, the array, the index and the value.
 */
#ifndef vtkBigusFieldReader_h
#define vtkBigusFieldReader_h

#include "vtkBigusIOModule.h"
#include "vtkPolyDataAlgorithm.h"

class VTKBIGUSIO_EXPORT vtkBigusFieldReader : public vtkPolyDataAlgorithm
{
public:
  static vtkBigusFieldReader* New();
  vtkTypeMacro(vtkBigusFieldReader, vtkPolyDataAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  /**
   * 1 when the file says that it holds a field: VTK XML PolyData with an array Reflectivity, or PLY with rotations (rot_0).
   * It is read as far as its appended data or the end of its header. Other files are left to VTK's readers.
   */
  virtual int CanReadFile(VTK_FILEPATH const char* fileName);

  ///@{
  /**
   * The file to read; what it holds is told from its content. No default.
   */
  vtkSetFilePathMacro(FileName);
  vtkGetFilePathMacro(FileName);
  ///@}

  ///@{
  /**
   * Into how many chunks a .vtp or .ply is split of which a piece is asked for, 1 to 4096, default 16.
   */
  vtkSetMacro(NumberOfChunks, int);
  vtkGetMacro(NumberOfChunks, int);
  ///@}

protected:
  vtkBigusFieldReader();
  ~vtkBigusFieldReader() override;

  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  char* FileName;
  int NumberOfChunks;

private:
  vtkBigusFieldReader(const vtkBigusFieldReader&) = delete;
  void operator=(const vtkBigusFieldReader&) = delete;
};

#endif
