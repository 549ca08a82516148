// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "PipelineSupport.h"

#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkStreamingDemandDrivenPipeline.h"

namespace bigus
{

void RequestWholeInput(vtkInformationVector* connections)
{
  for (int i = 0; i < connections->GetNumberOfInformationObjects(); ++i)
  {
    vtkInformation* info = connections->GetInformationObject(i);
    if (info->Has(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT()))
    {
      int whole[6];
      info->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), whole);
      info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_EXTENT(), whole, 6);
    }
    info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_PIECE_NUMBER(), 0);
    info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_NUMBER_OF_PIECES(), 1);
    info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_NUMBER_OF_GHOST_LEVELS(), 0);
  }
}

void ForgetRequests(vtkInformationVector* outputs)
{
  const int nothing[6] = {0, -1, 0, -1, 0, -1};
  for (int port = 0; port < outputs->GetNumberOfInformationObjects(); ++port)
  {
    outputs->GetInformationObject(port)->Set(vtkStreamingDemandDrivenPipeline::COMBINED_UPDATE_EXTENT(), nothing, 6);
  }
}

}  // namespace bigus
