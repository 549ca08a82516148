// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusLabelReader
 * @brief   reads label pictures of a sweep's frames
 *
 * FileName is a segmentation of 3D Slicer (`.seg.nrrd`; of layers as one picture in which later segments cover earlier
 * ones), another `.nrrd` or `.mha` with a slice a picture, or a folder of PNG images, in which frame_2 comes before frame_10.
 * The output is a stack of unsigned char, values 0 (no label) to 255, with the field data `SourceFrame`, int: the frame that
 * each picture is of, counted from 0, which for PNG images is the number in the name; and of a segmentation `LabelNames`,
 * `LabelValues` and `LabelColors` (Data/LabelData.h). A segmentation that says where it was cropped from has no
 * `SourceFrame`: its extent begins there, and vtkBigusFieldLabeler takes all else for unlabelled. Pixels are in marked-far
 * order, as those of vtkBigusSequenceReader are. Options of transforms mean nothing here.
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
  void PrintSelf(ostream& os, vtkIndent indent) override;

  vtkImageData* GetOutput();

  ///@{
  /** More pictures than this, 1 to 1000000, are an error. Default: 1000000. */
  vtkSetClampMacro(MaximumPictures, int, 1, 1000000);
  vtkGetMacro(MaximumPictures, int);
  ///@}

  /** Whether the last update took numbers of frames from names of files. */
  vtkGetMacro(Numbered, bool);

protected:
  vtkBigusLabelReader();
  ~vtkBigusLabelReader() override = default;

  int FillOutputPortInformation(int port, vtkInformation* info) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  int MaximumPictures = 1000000;
  bool Numbered = false;

private:
  vtkBigusLabelReader(const vtkBigusLabelReader&) = delete;
  void operator=(const vtkBigusLabelReader&) = delete;
};

#endif
