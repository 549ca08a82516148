// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// NRRD sequences and volumes, volumes as grids, and segmentations as labels of a sweep of 4 x 3 pixels and 3 frames.
#include "Data/LabelData.h"
#include "Fuzz/Harness.h"
#include "IO/Formats/VolumeGrid.h"
#include "Pipeline.h"
#include "vtkBigusLabelReader.h"
#include "vtkImageData.h"
#include "vtkNew.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  const std::string path = Write("input.nrrd", bytes);
  ReadAsSequence(path);
  RunAsProgram(
      [&path](command::Console&)
      {
        ReadVolumeGrid(path, true);
        return command::Success;
      });
  RunAsProgram(
      [&path](command::Console& console)
      {
        vtkNew<vtkBigusLabelReader> reader;
        reader->SetFileName(path.c_str());
        command::Update(reader, console, "Reading");
        vtkNew<vtkImageData> sweep;
        sweep->SetDimensions(4, 3, 3);
        LabelFramesFromImage(reader->GetOutput(), sweep, {0, 2});
        return command::Success;
      });
}

}  // namespace bigus::fuzz
