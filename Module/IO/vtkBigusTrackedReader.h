// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusTrackedReader
 * @brief   what readers of tracked data share: the file, and how poses follow from its transforms
 *
 * See vtkBigusSequenceReader, which reads images with their poses, and vtkBigusPoseReader, which reads poses alone.
 */
#ifndef vtkBigusTrackedReader_h
#define vtkBigusTrackedReader_h

#include <exception>
#include <string>

#include "vtkAlgorithm.h"
#include "vtkBigusIOModule.h"

namespace bigus
{
struct PoseOptions;
}

class VTKBIGUSIO_EXPORT vtkBigusTrackedReader : public vtkAlgorithm
{
public:
  vtkAbstractTypeMacro(vtkBigusTrackedReader, vtkAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The file to read, or its header when the pixels are in a file of their own. What it holds is told from its
   * content. No default.
   */
  vtkSetFilePathMacro(FileName);
  vtkGetFilePathMacro(FileName);
  ///@}

  ///@{
  /**
   * A Plus configuration (XML) whose `CoordinateDefinitions` give transforms that the file lacks, such as
   * ImageToProbe. A transform that the file has itself takes precedence. Default: none.
   */
  vtkSetFilePathMacro(ConfigFileName);
  vtkGetFilePathMacro(ConfigFileName);
  ///@}

  ///@{
  /**
   * The coordinate frames that the poses lead from and to, by their names in the file. The shortest chain of
   * transforms and inverses between them is used. Defaults: Image, Reference.
   */
  vtkSetStringMacro(FromFrame);
  vtkGetStringMacro(FromFrame);
  vtkSetStringMacro(ToFrame);
  vtkGetStringMacro(ToFrame);
  ///@}

  ///@{
  /**
   * The size of a pixel along i and j, mm, in the place of that in the transforms; where pixel (0, 0) lies stays. For files
   * whose header alone states it (ElementSpacing). 0, 0: as the transforms say. Default: 0, 0.
   */
  vtkSetVector2Macro(ImageSpacing, double);
  vtkGetVector2Macro(ImageSpacing, double);
  ///@}

  ///@{
  /**
   * Accept a transform that has no status field. Plus writes one with every transform and refuses those
   * without; other programs may not write any. Default: off.
   */
  vtkSetMacro(AssumeMissingStatusOK, vtkTypeBool);
  vtkGetMacro(AssumeMissingStatusOK, vtkTypeBool);
  vtkBooleanMacro(AssumeMissingStatusOK, vtkTypeBool);
  ///@}

  ///@{
  /**
   * Keep the third column of a pose with a negative determinant as it is in the file. Else it is made, right-handed, from
   * the first two, which alone say where pixels lie. Default: off.
   */
  vtkSetMacro(AllowReflectedPoses, vtkTypeBool);
  vtkGetMacro(AllowReflectedPoses, vtkTypeBool);
  vtkBooleanMacro(AllowReflectedPoses, vtkTypeBool);
  ///@}

  vtkTypeBool ProcessRequest(vtkInformation* request, vtkInformationVector** inputs,
                             vtkInformationVector* outputs) override;

protected:
  vtkBigusTrackedReader();
  ~vtkBigusTrackedReader() override;

  virtual int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) { return 1; }
  virtual int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) = 0;

  /// FileName; throws where there is none.
  std::string RequireFileName() const;

  /// The options of this class, as the parsers take them.
  bigus::PoseOptions GetPoseOptions() const;

  /// Reports an error to observers and in the error code. Returns 0, as the caller does then.
  int Fail(const std::exception& error);

  char* FileName = nullptr;
  char* ConfigFileName = nullptr;
  char* FromFrame = nullptr;
  char* ToFrame = nullptr;
  double ImageSpacing[2] = {0, 0};
  vtkTypeBool AssumeMissingStatusOK = 0;
  vtkTypeBool AllowReflectedPoses = 0;

private:
  vtkBigusTrackedReader(const vtkBigusTrackedReader&) = delete;
  void operator=(const vtkBigusTrackedReader&) = delete;
};

#endif
