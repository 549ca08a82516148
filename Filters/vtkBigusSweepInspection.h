// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusSweepInspection
 * @brief   Says what is wrong with recorded frames
 *
 * The input is a sweep as vtkBigusTrainer takes it: an image stack (x, y, frame) with the field data `ImageToReference`.
 * Looked for are frames out of the order of their times, a probe off the skin or at rest, repeated pictures and text of
 * the scanner's screen. Core/Inspection/README.md says how, and what is done about each. This filter only tells:
 * vtkBigusTrainer inspects its input by itself, so it need not come before it.
 *
 * Output 0 is the input, pixels shared, with one more array of field data:
 *
 * | array | tuples | meaning |
 * |---|---|---|
 * | `Finding` [1] | frames | why the frame is left out (contact 2, repeat 3, rest 4, tracking 6); 0: it stays |
 *
 * Output 1 is a vtkTable with a row a finding:
 *
 * | column | type | meaning |
 * |---|---|---|
 * | `Kind` | text | order, contact, repeat, rest, overlay, tracking, fan; or a doubt: gain, depth, levels, poses |
 * | `Frames` | int | how many frames it is about; of a doubt, from how many on it holds, or 0: all |
 * | `Pixels` | int | how many pixels of each, of an overlay or a fan; else 0 |
 * | `Applied` | int | 1: training leaves them out, orders or fills them; 0: it is a doubt, or Keep names the kind |
 * | `Text` | text | what was found, the evidence, what is done, how to undo it |
 *
 * Frames are numbered as in the image. The input's rejected frames (`Status` 0) are not looked at.
 */
#ifndef vtkBigusSweepInspection_h
#define vtkBigusSweepInspection_h

#include <string>  // for Keep

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkImageAlgorithm.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkTable;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSFILTERS_EXPORT vtkBigusSweepInspection : public vtkImageAlgorithm
{
public:
  static vtkBigusSweepInspection* New();
  vtkTypeMacro(vtkBigusSweepInspection, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * Kinds that nothing is done about, as vtkBigusTrainer has them: none (default), all, order, contact, repeat, rest,
   * overlay, tracking, fan, or some of these joined by +.
   */
  vtkSetStdStringFromCharMacro(Keep);
  vtkGetCharFromStdStringMacro(Keep);
  ///@}

  /** Output 1: a row a finding. */
  vtkTable* GetFindings();

protected:
  vtkBigusSweepInspection();
  ~vtkBigusSweepInspection() override = default;

  int FillOutputPortInformation(int port, vtkInformation* info) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  std::string Keep = "none";

private:
  vtkBigusSweepInspection(const vtkBigusSweepInspection&) = delete;
  void operator=(const vtkBigusSweepInspection&) = delete;
};

#endif
