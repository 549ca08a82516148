// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusLabelReader
 * @brief   reads label pictures of a sweep's frames
 *
 * FileName is a segmentation of 3D Slicer (`.seg.nrrd`; of layers as one picture in which later segments cover earlier
 * ones), another `.nrrd` or `.mha` with a slice a picture, or a folder of PNG images, in which frame_2 comes before frame_10.
 * The output is a stack of unsigned char, values 0 (no label) to 255. Its field data have, of a segmentation, `LabelNames`,
 * `LabelValues` and `LabelColors` (Data/LabelData.h), and, of PNG images whose names all have a number, `SourceFrame`, int: the
 * last number in each name, which says what frame it is of, counted from 0. Pixels are in marked-far order, as those of
 * vtkBigusSequenceReader are. Options of transforms mean nothing here. The extent of a cropped segmentation begins where its
 * file says that its first voxel lies in the whole one.
 *
 * @sa vtkBigusFieldLabeler
 */
#ifndef vtkBigusLabelReader_h
#define vtkBigusLabelReader_h

#include "vtkBigusIOModule.h"
#include "vtkBigusTrackedReader.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkImageData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSIO_EXPORT vtkBigusLabelReader : public vtkBigusTrackedReader
{
public:
  static vtkBigusLabelReader* New();
  vtkTypeMacro(vtkBigusLabelReader, vtkBigusTrackedReader);
  vtkImageData* GetOutput();

protected:
  vtkBigusLabelReader() = default;
  ~vtkBigusLabelReader() override = default;

  int FillOutputPortInformation(int port, vtkInformation* info) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

private:
  vtkBigusLabelReader(const vtkBigusLabelReader&) = delete;
  void operator=(const vtkBigusLabelReader&) = delete;
};

#endif
