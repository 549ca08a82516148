// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusSequenceWriter
 * @brief   writes a tracked ultrasound sweep as a MetaImage sequence (.igs.mha, .mha)
 *
 * The input is a sweep as vtkBigusSequenceReader makes it: an image stack of unsigned char, unsigned short or
 * float scalars with field data `ImageToReference`, and optionally `Timestamp` and `Status`. Pixels are
 * written in marked-far (MF) order. Reading the file back gives the same pixels, poses and timestamps to the
 * last bit.
 *
 * The file appears under its name only when it is complete; a failed write leaves nothing behind, and an
 * earlier file of that name as it was.
 */
#ifndef vtkBigusSequenceWriter_h
#define vtkBigusSequenceWriter_h

#include "vtkBigusIOModule.h"
#include "vtkVersionMacros.h"
#include "vtkWriter.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkImageData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSIO_EXPORT vtkBigusSequenceWriter : public vtkWriter
{
public:
  static vtkBigusSequenceWriter* New();
  vtkTypeMacro(vtkBigusSequenceWriter, vtkWriter);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The file to write, ending in .mha. No default.
   */
  vtkSetFilePathMacro(FileName);
  vtkGetFilePathMacro(FileName);
  ///@}

  ///@{
  /**
   * The names of the frames that the poses lead from and to; they make the transform's name in the file,
   * [FromFrame]To[ToFrame]Transform. Defaults: Image, Reference.
   */
  vtkSetStringMacro(FromFrame);
  vtkGetStringMacro(FromFrame);
  vtkSetStringMacro(ToFrame);
  vtkGetStringMacro(ToFrame);
  ///@}

  ///@{
  /**
   * Compress the pixels with zlib. Default: on.
   */
  vtkSetMacro(Compression, vtkTypeBool);
  vtkGetMacro(Compression, vtkTypeBool);
  vtkBooleanMacro(Compression, vtkTypeBool);
  ///@}

  vtkImageData* GetInput();

protected:
  vtkBigusSequenceWriter();
  ~vtkBigusSequenceWriter() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 7, 0)
  bool WriteDataAndReturn() override;
#else
  void WriteData() override;
#endif

  char* FileName;
  char* FromFrame;
  char* ToFrame;
  vtkTypeBool Compression;

private:
  vtkBigusSequenceWriter(const vtkBigusSequenceWriter&) = delete;
  void operator=(const vtkBigusSequenceWriter&) = delete;

  void WriteFile();  // sets the error code when it fails
};

#endif
